"""Kinds of known things: measured values, azimuths, lines of position and conditions.

Reading, adjustment, tests, simulation, tables and messages loop over kinds. A kind is a `KnownKind`
that is registered in `ALL_KINDS`.

The residuals are the functions of the measurements minus the known value. A distance from a line
has no derivative at zero: for a known value of zero its offset, a signed number or a vector, takes
its place.

To add a kind, write its class here and name it in `ALL_KINDS`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, cast

import numpy as np

from uavgram.estimation.survey.ground_planes import find_ground_below
from uavgram.geometry.ground import conditions, measurements
from uavgram.geometry.ground.conditions import (
    Residuals,
    compute_joint_covariance,
    compute_line_offsets,
)
from uavgram.model.arrays import Floats, Ints
from uavgram.model.limits import find_length_fault, find_number_fault
from uavgram.model.observations import (
    MEASUREMENT_FORMS,
    ON_LINE,
    KnownThing,
    KnownThings,
    MeasurementKind,
)
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
        Smallest and largest number of points; None: any number.
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

    def compute_adjusted_value(self, thing: KnownThing, off: float) -> float:
        """Return the adjusted value of a thing from its residual."""
        return off + (thing.value if self.has_value else 0.0)


def _is_plane(survey: Survey, area: Ints, needs: Needs) -> bool:
    """Return whether the ground alone puts points in one plane, for ``tilt`` in a level one."""
    areas = set(area.tolist())
    grounds = [survey.grounds[a] for a in areas]
    smooth = all(one.roughness_sigma_m == 0 and one.relief is None for one in grounds)
    is_level = survey.gauge == "plane" and areas == {0}
    return smooth and len(areas) == 1 and (needs != "tilt" or is_level)


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

    @classmethod
    def of(cls, name: MeasurementKind, **own: Any) -> MeasuredKind:  # noqa: ANN401  (its fields)
        """Return the kind of known thing of a kind of measurement."""
        form = MEASUREMENT_FORMS[name]
        alike = {"shown": form.words, "points": form.points, "unit": form.unit}
        return cls(name, **alike, parameters=form.optional, **own)  # type: ignore[arg-type]

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
        return find_length_fault(value) if self.is_positive else find_number_fault(value)


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
    MeasuredKind.of("distance", is_positive=True),
    MeasuredKind.of("polyline", words="length along points", is_positive=True),
    MeasuredKind.of("area", is_positive=True),
    MeasuredKind.of(
        "angle",
        limits=(0.0, 180.0),
        limits_words="must lie between 0 and 180 degrees; for points in line use kind collinear",
    ),
    LineDistance.of("line_distance", words="distance from a line"),
    MeasuredKind.of("height", needs="tilt", is_directed=True),
    MeasuredKind.of("horizontal_distance", is_positive=True),
    MeasuredKind.of("vertical_distance", needs="tilt", is_directed=True),
    MeasuredKind.of(
        "slope",
        needs="tilt",
        is_directed=True,
        limits=(-90.0, 90.0),
        limits_words="must lie between -90 and 90 degrees",
    ),
    MeasuredKind.of("plane_distance", needs="relief"),
    MeasuredKind.of("volume"),
)


class Azimuth(KnownKind):
    """Direction in plan from a first point to a second, clockwise from north [deg].

    North is that of the world's axes, true north at the origin. The azimuth of a grid bearing is
    the bearing plus ``convergence_deg``, the angle by which grid north is east of true north.
    """

    def departures(self, alike: AlikeThings) -> KnownResiduals:
        """Compute azimuths minus known ones, from -180 to 180 degrees; 0 if the points coincide."""
        known = [
            thing.value + dict(thing.parameters).get(CONVERGENCE, 0.0) for thing in alike.things
        ]
        ahead = alike.world[:, 1, :2] - alike.world[:, 0, :2]
        square = np.sum(ahead**2, axis=1)
        is_apart = square > 0.0
        azimuth = np.degrees(np.arctan2(ahead[:, 0], ahead[:, 1]))
        value = np.where(is_apart, (azimuth - known + 180.0) % 360.0 - 180.0, 0.0)
        # Gradient of atan2(east, north): (north, -east) / distance^2.
        turn = np.degrees(ahead[:, ::-1] * [1.0, -1.0] / np.where(is_apart, square, 1.0)[:, None])
        gradient = np.zeros((len(known), 1, 2, 3))
        gradient[:, 0, 0, :2], gradient[:, 0, 1, :2] = -turn, turn
        return KnownResiduals(value[:, None], gradient)

    def fault(self, value: float) -> str:
        """Describe why an azimuth is impossible."""
        return "" if 0.0 <= value < 360.0 else "must lie from 0 to less than 360 degrees"

    def compute_adjusted_value(self, thing: KnownThing, off: float) -> float:
        """Return the adjusted azimuth, from 0 to less than 360 degrees."""
        return (thing.value + off) % 360.0


CONVERGENCE = "convergence_deg"

AZIMUTH = Azimuth(
    "azimuth",
    shown="azimuth",
    points=(2, 2),
    unit="deg",
    has_value=True,
    is_directed=True,
    parameters=(CONVERGENCE,),
    needs="world",
    unplaced=(
        "nothing else determines where north is",
        "It takes the flight log, two control points or three points on lines of known position.",
    ),
)


class OnLine(KnownKind):
    """Points that were picked somewhere on a line with known coordinates."""

    def departures(self, alike: AlikeThings) -> KnownResiduals:
        """Compute the offsets of the points from their line; all share the errors of its ends."""
        value, gradient, covariance = [], [], []
        for thing, world in zip(alike.things, alike.world, strict=True):
            line = thing.position
            assert line is not None  # noqa: S101  (of this kind)
            beside = compute_line_offsets(world, line.ends_m, upwards=line.has_height)
            k, axes = beside.value.shape
            by_point = np.zeros((k, axes, k, 3))
            by_point[np.arange(k), :, np.arange(k)] = beside.gradient
            # Covariance of all offsets: errors of the line's ends, shared, and its straightness.
            joint = compute_joint_covariance(beside.by_ends, line.sigma_m, line.straightness_m)
            value.append(beside.value.ravel())
            gradient.append(by_point.reshape(k * axes, k, 3))
            covariance.append(joint * (thing.sigma / line.across_m) ** 2)
        return KnownResiduals(np.array(value), np.array(gradient), covariance=np.array(covariance))

    def row_count(self, thing: KnownThing, *, on_ground: bool) -> int:
        """Count the axes of all points."""
        del on_ground
        return len(thing.label) * (1 + (thing.position is not None and thing.position.has_height))

    def gives_scale(self, value: float) -> bool:
        """Return True: the known ends of the line determine the scale."""
        del value
        return True


LINE_OF_POSITION = OnLine(
    ON_LINE,
    "place of the line",
    "on a line of known position",
    needs="world",
    unplaced=(
        "no other observation places this survey on the map, and such lines are too few for it",
        "It takes three picked points on lines that are not all parallel (or the flight log, or "
        "two control points).",
    ),
)


@dataclass(frozen=True, kw_only=True)
class Condition(KnownKind):
    """Condition, which has no value.

    Attributes
    ----------
    function
        Residuals as a function of points (N, k, 3), and of whether they are on the ground.
    count
        Number of rows of a thing, from its number of points and the number of axes across a line:
        one along the ground, and one more upwards if the points are off it.
    lines
        Whether its points are the ends of lines.
    """

    function: Callable[[Floats, bool], Residuals]
    count: Callable[[int, int], int] = lambda *_: 1
    lines: bool = False

    def departures(self, alike: AlikeThings) -> KnownResiduals:
        """Compute the residuals; 0 where there is no derivative, as no direction reduces them."""
        value, gradient = self.function(alike.world, alike.on_ground)
        return KnownResiduals(np.nan_to_num(value), np.nan_to_num(gradient))

    def row_count(self, thing: KnownThing, *, on_ground: bool) -> int:
        """Count the rows of one thing."""
        return self.count(len(thing.label), 1 if on_ground else 2)

    def points_fault(self, points: tuple[str, ...]) -> str:
        """Describe why the points are no valid ends of lines."""
        if not self.lines:
            return ""
        if len(points) % 2:
            return f"needs both ends of each line (got {len(points)} points)"
        ends = [frozenset(points[i : i + 2]) for i in range(0, len(points), 2)]
        is_twice = len(set(ends)) < len(ends)
        return "names one line twice: that adds no information" if is_twice else ""


CONDITIONS = (
    Condition(
        "right_angle",
        shown="right angle",
        points=(3, 3),
        unit="deg",
        function=lambda points, _: conditions.right_angle(points),
    ),
    Condition(
        "collinear",
        "straight line",
        "on a straight line",
        points=(3, None),
        function=lambda points, flat: conditions.collinear(points, on_ground=flat),
        count=lambda points, across: across * (points - 2),
    ),
    Condition(
        "parallel",
        "pair of parallel lines",
        "parallel lines",
        points=(4, 4),
        unit="deg",
        function=lambda points, flat: conditions.parallel(points, on_ground=flat),
        count=lambda _, across: across,
        lines=True,
    ),
    Condition(
        "coplanar",
        "plane",
        "in one plane",
        points=(4, None),
        needs="relief",
        function=lambda points, _: conditions.coplanar(points),
        count=lambda points, _: points - 3,
    ),
    Condition(
        "level",
        "level line",
        "at one height",
        points=(2, None),
        needs="tilt",
        function=lambda points, _: conditions.level(points),
        count=lambda points, _: points - 1,
    ),
    Condition(
        "vertical",
        shown="one above the other",
        points=(2, 2),
        needs="height",
        function=lambda points, _: conditions.vertical(points),
        count=lambda *_: 2,
    ),
    Condition(
        "equal_lengths",
        "set of equal lengths",
        "equally long",
        points=(4, None),
        function=lambda points, _: conditions.equal_lengths(points),
        count=lambda points, _: points // 2 - 1,
        lines=True,
    ),
)


ALL_KINDS: dict[str, KnownKind] = {
    one.name: one for one in (*MEASURED, *CONDITIONS, AZIMUTH, LINE_OF_POSITION)
}
"""All kinds by name."""

KNOWN_KINDS = {name: one for name, one in ALL_KINDS.items() if name != ON_LINE}
"""Kinds of the table of known things; lines of known position have a table of their own."""


def determine_scale(known: KnownThings) -> bool:
    """Return whether any known thing that is an observation determines the scale."""
    rows = zip(known.kind, known.value.tolist(), known.adjust.tolist(), strict=True)
    return any(ALL_KINDS[kind].gives_scale(value) for kind, value, adjust in rows if adjust)
