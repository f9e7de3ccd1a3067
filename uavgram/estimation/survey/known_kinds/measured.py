"""Known values of measurable quantities: distances, areas, angles, heights, volumes.

The residuals are the functions of the measurements minus the known value. A distance from a line
has no derivative at zero: for a known value of zero its offset, a signed number or a vector, takes
its place.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np

from uavgram.estimation.survey.ground_below import find_ground_below
from uavgram.estimation.survey.known_kinds.known_kind import AlikeThings, KnownKind, KnownResiduals
from uavgram.geometry.ground import conditions, measurements
from uavgram.model.arrays import Floats
from uavgram.model.limits import length_fault, number_fault
from uavgram.model.observations import KnownThing, MeasurementKind
from uavgram.model.survey import Survey


@dataclass(frozen=True, kw_only=True)
class MeasuredKind(KnownKind):
    """Kind of measurement whose value is known.

    Attributes
    ----------
    is_positive
        Whether its value is a size.
    limits, limits_words
        Range in which the value must be [deg], and the words for that.
    """

    has_value: bool = True
    is_positive: bool = False
    limits: tuple[float, float] = (-np.inf, np.inf)
    limits_words: str = ""

    def departures(self, alike: AlikeThings) -> KnownResiduals:
        """Compute the measured values minus the known ones.

        Where there is no derivative (points that coincide), the gradient is zero and the value is
        the limit on the way there: no direction reduces it.
        """
        each = [
            self._departure(thing, world, feet, alike.survey)
            for thing, world, feet in zip(alike.things, alike.world, alike.feet, strict=True)
        ]
        value, by_point, by_foot, rough = (
            np.array(column)[:, None] for column in zip(*each, strict=True)
        )
        return KnownResiduals(value, by_point, by_foot, rough)

    def _departure(
        self, thing: KnownThing, world: Floats, feet: Floats, survey: Survey
    ) -> tuple[float, Floats, Floats, float]:
        """Compute value, gradients and roughness sigma of one thing, as in `Departures`."""
        kind, parameters = cast("MeasurementKind", thing.kind), dict(thing.parameters)
        nothing = np.zeros((len(world), 3))
        try:
            if not self.is_from_ground(thing):
                value, gradient = measurements.measure_shape(kind, world, parameters)
                return value - thing.value, gradient, nothing, 0.0
            below = find_ground_below(survey, np.array(thing.label), world, feet)
            value, gradient, by_feet = measurements.measure_over_ground(
                kind, world, below.feet, parameters
            )
        except measurements.UnmeasurableError:
            return -thing.value, nothing, nothing, 0.0
        # Where the ground point moves with the point, its derivatives add to those of the point.
        is_below = below.is_determined[:, None]
        return (
            value - thing.value,
            gradient + np.where(is_below, by_feet, 0.0),
            np.where(is_below, 0.0, by_feet),
            float(np.linalg.norm(by_feet[:, 2] * below.sigma_m)),
        )

    def is_from_ground(self, thing: KnownThing) -> bool:
        """Return whether it is measured from the ground straight below its points."""
        return measurements.refers_to_ground(thing.kind, len(thing.label), dict(thing.parameters))

    def fault(self, value: float) -> str:
        """Describe why a value is impossible."""
        least, greatest = self.limits
        if self.limits_words and not least < value < greatest:
            return self.limits_words
        return length_fault(value) if self.is_positive else number_fault(value)


class LineDistance(MeasuredKind):
    """Distance from a line; the offset from it if the known distance is zero."""

    def departures(self, alike: AlikeThings) -> KnownResiduals:
        """Compute the distances minus the known ones, or the offsets."""
        if alike.things[0].value != 0.0:
            return super().departures(alike)
        value, gradient = conditions.line_offset(alike.world, on_ground=alike.on_ground)
        return KnownResiduals(np.nan_to_num(value), np.nan_to_num(gradient))

    def row_count(self, thing: KnownThing, *, on_ground: bool) -> int:
        """Count the axes of the offset."""
        return 2 if thing.value == 0.0 and not on_ground else 1

    def fault(self, value: float) -> str:
        """Describe why a distance is impossible."""
        return "must not be negative" if value < 0 else super().fault(value)


MEASURED = (
    MeasuredKind("distance", is_positive=True),
    MeasuredKind("polyline", "length along points", is_positive=True),
    MeasuredKind("area", unit="m2", is_positive=True),
    MeasuredKind(
        "angle",
        unit="deg",
        limits=(0.0, 180.0),
        limits_words="must lie between 0 and 180 degrees; for points in line use kind collinear",
    ),
    LineDistance("line_distance", "distance from a line"),
    MeasuredKind("height", needs="tilt", is_directed=True),
    MeasuredKind("horizontal_distance", is_positive=True),
    MeasuredKind("vertical_distance", needs="tilt", is_directed=True),
    MeasuredKind(
        "slope",
        unit="deg",
        needs="tilt",
        is_directed=True,
        limits=(-90.0, 90.0),
        limits_words="must lie between -90 and 90 degrees",
    ),
    MeasuredKind("plane_distance", needs="relief"),
    MeasuredKind("volume", unit="m3", parameters=("top", "level", "plane")),
)
