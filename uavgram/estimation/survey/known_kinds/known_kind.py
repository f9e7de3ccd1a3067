"""What every kind of known thing provides: its rows, and what it is called.

Reading, adjustment, tests, simulation, tables and messages loop over kinds. A kind is a `KnownKind`
in a file of this folder, registered in `known_kinds/kinds.py`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from uavgram.model.arrays import Floats, Ints
from uavgram.model.survey.known import KnownThing
from uavgram.model.survey.survey import Survey

Needs = Literal["nothing", "height", "relief", "tilt", "world"]
"""What makes a thing an observation where all of its points are on the ground: ``height``, as on
the ground no point is above another; ``relief``, as smooth ground is a plane; ``tilt``, as that of
a free gauge is level. ``world``: it refers to north or to the map, wherever its points are."""


class Alike(NamedTuple):
    """N things of one kind with k points each, all on the ground or none.

    Attributes
    ----------
    things
        What is known.
    world, feet
        (N, k, 3) the points, and the places on the smooth ground straight below them.
    on_ground
        Whether all points lie on the ground.
    survey
        Which of the points are on the ground, and how rough that is.
    """

    things: tuple[KnownThing, ...]
    world: Floats
    feet: Floats
    on_ground: bool
    survey: Survey


class Departures(NamedTuple):
    """By how much N things are not what is known of them, each in m rows, in their unit.

    Attributes
    ----------
    value
        (N, m) as it is, less as it is known.
    by_point
        (N, m, k, 3) derivatives by the points.
    by_foot
        (N, m, k, 3) by the places on the smooth ground straight below them; None: all 0.
    rough
        (N, m) sigma that the roughness of the ground below adds; None: 0.
    covariance
        (N, m, m) of what is known, where its rows are correlated.
    """

    value: Floats
    by_point: Floats
    by_foot: Floats | None = None
    rough: Floats | None = None
    covariance: Floats | None = None


@dataclass(frozen=True)
class KnownKind:
    """A kind of known thing.

    Attributes
    ----------
    name
        In the table of known things.
    words, shown
        What one is called in a sentence, and in the table of the report; empty: by its name.
    points
        Least and greatest number of points; None: any number. Kinds of measurement have theirs in
        the table of these.
    unit
        Of its value and sigma.
    has_value
        Whether a number is known, or a condition holds.
    is_directed
        Whether it has another value from its last point to its first.
    parameters
        Numbers that it may have beside its points.
    needs
        See `Needs`.
    unplaced
        Why it is no observation without a world, and what to do.
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

    def departures(self, alike: Alike) -> Departures:
        """Compute by how much things that are alike are not what is known of them."""
        raise NotImplementedError

    def row_count(self, thing: KnownThing, *, on_ground: bool) -> int:
        """Count the rows of one thing."""
        del thing, on_ground
        return 1

    def is_observation(self, survey: Survey, thing: KnownThing) -> bool:
        """Whether a thing adds to what the ground alone implies, or rules out."""
        label = list(thing.label)
        if self.needs == "world":
            return survey.gauge == "world"
        if self.is_from_ground(thing):
            return bool((survey.is_free[label] | (survey.height_sigma_m[label] > 0)).any())
        if survey.off_ground[label].any() or self.needs == "nothing":
            return True
        return self.needs != "height" and not _is_plane(survey, survey.area[label], self.needs)

    def gives_scale(self, value: float) -> bool:
        """Whether a thing of that value determines the scale."""
        return self.unit != "deg" and bool(np.isfinite(value)) and value != 0.0

    def is_from_ground(self, thing: KnownThing) -> bool:
        """Whether it is measured from the ground straight below its points."""
        del thing
        return False

    def fault(self, value: float) -> str:
        """Say why a value cannot be; empty where it can."""
        del value
        return ""

    def points_fault(self, points: tuple[str, ...]) -> str:
        """Say why points mean nothing; empty where they do."""
        del points
        return ""

    def adjusted(self, thing: KnownThing, off: float) -> float:
        """Value of a thing that is off by so much."""
        return off + (thing.value if self.has_value else 0.0)


def _is_plane(survey: Survey, area: Ints, needs: Needs) -> bool:
    """Whether points lie in one plane by the ground alone; where it is asked, in a level one."""
    areas = set(area.tolist())
    grounds = [survey.grounds[a] for a in areas]
    smooth = all(one.roughness_sigma_m == 0 and one.relief is None for one in grounds)
    is_level = survey.gauge == "plane" and areas == {0}
    return smooth and len(areas) == 1 and (needs != "tilt" or is_level)
