"""Protocol of the kinds of known things: rows of residuals, names and checks.

Reading, adjustment, tests, simulation, tables and messages loop over kinds. A kind is a `KnownKind`
in a file of this folder, registered in `known_kinds/kinds.py`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from uavgram.model.arrays import Floats, Ints
from uavgram.model.observations import KnownThing
from uavgram.model.survey import Survey

Needs = Literal["nothing", "height", "relief", "tilt", "world"]
"""Condition under which a thing whose points are all on the ground is an observation.

``height``: never, because on the ground no point is above another; ``relief``: not on smooth
ground, which is a plane; ``tilt``: not on the ground of a free gauge, which is level. ``world``:
the thing refers to north or to the map, wherever its points are.
"""


class AlikeThings(NamedTuple):
    """N things of one kind with k points each, all on the ground or none.

    Attributes
    ----------
    things
        The known things.
    world, feet
        (N, k, 3) the points, and the places on the smooth ground straight below them.
    on_ground
        Whether all points are on the ground.
    survey
        Survey, which holds the points that are on the ground and the roughness of the ground.
    """

    things: tuple[KnownThing, ...]
    world: Floats
    feet: Floats
    on_ground: bool
    survey: Survey


class KnownResiduals(NamedTuple):
    """Residuals of N things against their known values, each in m rows, in the unit of the thing.

    Attributes
    ----------
    value
        (N, m) computed minus known values.
    by_point
        (N, m, k, 3) derivatives with respect to the points.
    by_foot
        (N, m, k, 3) derivatives with respect to the places on the smooth ground straight below
        them; None: all 0.
    rough
        (N, m) sigma that the roughness of the ground below adds; None: 0.
    covariance
        (N, m, m) covariance of the known values, where the rows are correlated.
    """

    value: Floats
    by_point: Floats
    by_foot: Floats | None = None
    rough: Floats | None = None
    covariance: Floats | None = None


@dataclass(frozen=True)
class KnownKind:
    """Kind of known thing.

    Attributes
    ----------
    name
        Name in the table of known things.
    words, shown
        Name in a sentence, and in the table of the report; empty: `name`.
    points
        Smallest and largest number of points; None: any number. Kinds of measurement have theirs in
        the table of measurements.
    unit
        Unit of value and sigma.
    has_value
        Whether a number is known (otherwise a condition holds).
    is_directed
        Whether the value differs if the points are taken from last to first.
    parameters
        Names of the numbers that may be given beside the points.
    needs
        See `Needs`.
    unplaced
        Why it is no observation without a world, and the remedy.
    """

    name: str
    words: str = ""
    shown: str = ""
    points: tuple[int, int | None] = (1, None)
    unit: str = "m"
    has_value: bool = False
    is_directed: bool = False
    parameters: tuple[str, ...] = ()
    needs: Needs = "nothing"
    unplaced: tuple[str, str] = ("", "")

    def departures(self, alike: AlikeThings) -> KnownResiduals:
        """Compute the residuals of things that are alike."""
        raise NotImplementedError

    def row_count(self, thing: KnownThing, *, on_ground: bool) -> int:
        """Count the rows of one thing."""
        del thing, on_ground
        return 1

    def is_observation(self, survey: Survey, thing: KnownThing) -> bool:
        """Return whether a thing adds to, or contradicts, what the ground alone implies."""
        label = list(thing.label)
        if self.needs == "world":
            return survey.gauge == "world"
        if self.is_from_ground(thing):
            return bool((survey.is_free[label] | (survey.height_sigma_m[label] > 0)).any())
        if survey.off_ground[label].any() or self.needs == "nothing":
            return True
        return self.needs != "height" and not _is_plane(survey, survey.area[label], self.needs)

    def gives_scale(self, value: float) -> bool:
        """Return whether a thing of this value determines the scale."""
        return self.unit != "deg" and bool(np.isfinite(value)) and value != 0.0

    def is_from_ground(self, thing: KnownThing) -> bool:
        """Return whether it is measured from the ground straight below its points."""
        del thing
        return False

    def fault(self, value: float) -> str:
        """Describe why a value is impossible; empty if it is possible."""
        del value
        return ""

    def points_fault(self, points: tuple[str, ...]) -> str:
        """Describe why points are meaningless; empty if they are valid."""
        del points
        return ""

    def adjusted(self, thing: KnownThing, off: float) -> float:
        """Return the adjusted value of a thing from its residual."""
        return off + (thing.value if self.has_value else 0.0)


def _is_plane(survey: Survey, area: Ints, needs: Needs) -> bool:
    """Return whether the ground alone puts points in one plane, for ``tilt`` in a level one."""
    areas = set(area.tolist())
    grounds = [survey.grounds[a] for a in areas]
    smooth = all(one.roughness_sigma_m == 0 and one.relief is None for one in grounds)
    is_level = survey.gauge == "plane" and areas == {0}
    return smooth and len(areas) == 1 and (needs != "tilt" or is_level)
