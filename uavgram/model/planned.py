"""Plans: what a person asks, what to fly and lay out, and what will then be known how well."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np

from uavgram.model.arrays import NAN_IS_NONE, Floats, FrozenArrays
from uavgram.model.camera.calibration import Calibration
from uavgram.model.limits import require
from uavgram.model.message import Message
from uavgram.model.survey.observations import MeasurementKind


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedFrames(FrozenArrays):
    """F photos to be taken, in the order of the flight.

    Attributes
    ----------
    name
        (F,) such as ``P1``.
    center_world_m, world_from_camera
        (F, 3), (F, 3, 3) poses.
    heading_deg, gimbal_pitch_deg
        (F,) where the drone's nose points, from north, clockwise; -90 looks straight down.
    height_above_ground_m
        (F,) at the place of the photo.
    footprint_world_m
        (F, V, 3) what each photo shows of the ground, counterclockwise from above, not closed.
    safe_footprint_world_m
        (F, V, 3) what it shows even where the drone departs from the plan.
    """

    name: Annotated[tuple[str, ...], "n"]
    center_world_m: Annotated[Floats, "n", 3]
    world_from_camera: Annotated[Floats, "n", 3, 3]
    heading_deg: Annotated[Floats, "n"]
    gimbal_pitch_deg: Annotated[Floats, "n"]
    height_above_ground_m: Annotated[Floats, "n"]
    footprint_world_m: Annotated[Floats, "n", "v", 3]
    safe_footprint_world_m: Annotated[Floats, "n", "v", 3]


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedLines(FrozenArrays):
    """L reference lines to be laid out, marked at both ends, and taped.

    Attributes
    ----------
    name
        (L,) such as ``L1``; the ends' labels are ``L1a`` and ``L1b``.
    start_world_m, end_world_m
        (L, 3) ends on the ground.
    length_m, sigma_m
        (L,) and the standard deviation of the tape reading.
    frames_seen
        (L,) in how many photos both ends are.
    redundancy
        (L,) 0 (nothing checks its reading) to 1.
    mdb_m
        (L,) the smallest mistake of its reading that the survey will notice; NaN where none is.
    mean_sigma_without
        (L,) `FlightPlanned.mean_sigma` if this line is lost; NaN where nothing holds it then.
    """

    name: Annotated[tuple[str, ...], "n"]
    start_world_m: Annotated[Floats, "n", 3]
    end_world_m: Annotated[Floats, "n", 3]
    length_m: Annotated[Floats, "n"]
    sigma_m: Annotated[Floats, "n"]
    frames_seen: Annotated[Floats, "n"]
    redundancy: Annotated[Floats, "n"]
    mdb_m: Annotated[Floats, "n", NAN_IS_NONE]
    mean_sigma_without: Annotated[Floats, "n", NAN_IS_NONE]

    @property
    def start_label(self) -> tuple[str, ...]:
        """(L,) label of the first end of each."""
        return tuple(f"{name}a" for name in self.name)

    @property
    def end_label(self) -> tuple[str, ...]:
        """(L,) label of the other end of each."""
        return tuple(f"{name}b" for name in self.name)


def _none() -> Floats:
    return np.zeros(0)


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedPlates(FrozenArrays):
    """L coded plates to be laid flat; none where lines are taped.

    Attributes
    ----------
    name
        (L,) as the program calls them, ``T0``: what is printed on it has that number.
    corner_world_m
        (L, 4, 3) corners of the black square, counterclockwise from above.
    side_m
        Of each.
    frames_seen
        (L,) in how many photos all of it is.
    mean_sigma_without
        (L,) `FlightPlanned.mean_sigma` if it is lost; NaN where nothing holds it then.
    """

    name: Annotated[tuple[str, ...], "n"] = ()
    corner_world_m: Annotated[Floats, "n", 4, 3] = field(
        default_factory=lambda: np.zeros((0, 4, 3))
    )
    side_m: float = 0.0
    frames_seen: Annotated[Floats, "n"] = field(default_factory=_none)
    mean_sigma_without: Annotated[Floats, "n", NAN_IS_NONE] = field(default_factory=_none)

    @property
    def center_world_m(self) -> Floats:
        """(L, 3) their middles."""
        return np.asarray(self.corner_world_m.mean(axis=1))


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedPoints(FrozenArrays):
    """K points that what is wanted is measured between: (K,) labels, (K, 3) places."""

    label: Annotated[tuple[str, ...], "n"]
    world_m: Annotated[Floats, "n", 3]


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedMeasurements(FrozenArrays):
    """M values that will be measured; none where only the map was asked for.

    Attributes
    ----------
    name, kind, unit
        (M,) as in results.json.
    points
        (M,) labels of `PlannedPoints`, in order.
    value, sigma
        (M,) what it will be by the plan's points, and the standard deviation to expect.
    wanted_sigma
        (M,) what is good enough; NaN where nobody said.
    """

    name: Annotated[tuple[str, ...], "n"]
    kind: Annotated[tuple[str, ...], "n"]
    unit: Annotated[tuple[str, ...], "n"]
    points: Annotated[tuple[tuple[str, ...], ...], "n"]
    value: Annotated[Floats, "n"]
    sigma: Annotated[Floats, "n"]
    wanted_sigma: Annotated[Floats, "n", NAN_IS_NONE]


@dataclass(frozen=True, kw_only=True, eq=False)
class AccuracyGrid(FrozenArrays):
    """How well lengths will be known over the area.

    Attributes
    ----------
    center_world_m
        (K, 3) middles of square cells, on the ground.
    cell_m
        Their side.
    length_m
        Of the length about each middle whose standard deviation is told.
    sigma_m
        (K,) root mean square over lengths to the east and to the north; NaN where no photo shows
        them.
    """

    center_world_m: Annotated[Floats, "n", 3]
    cell_m: float
    length_m: float
    sigma_m: Annotated[Floats, "n", NAN_IS_NONE]


Corners = tuple[tuple[float, float], ...]
"""Of a polygon: x, y in the scene's axes [m]."""

FlightPattern = Literal["single", "strip", "grid", "orbit"]
Laid = Literal["lines", "plates"]
"""What is laid out to be known: lines for a tape, or coded plates."""

MOST_CHOICES = 30
"""Heights, pitches, numbers of photos or patterns to choose from: each is flown with each other."""


@dataclass(frozen=True, kw_only=True)
class WantedMeasurement:
    """Something that shall be measured, and how well.

    Attributes
    ----------
    name, kind
        As in measure.csv.
    points
        Labels of the scenario, or places (x, y) in the scene's axes [m].
    sigma_m
        Standard deviation that is good enough, in the unit of the kind; None: as good as may be.
    parameters
        Numbers that the kind needs, as in measure.csv.
    """

    name: str
    kind: MeasurementKind = "distance"
    points: tuple[str | tuple[float, float], ...]
    sigma_m: float | None = None
    parameters: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        require(self.sigma_m is None or self.sigma_m > 0, "sigma_m must be greater than 0")


@dataclass(frozen=True, kw_only=True)
class PlanRequest:
    """What shall be planned.

    Attributes
    ----------
    area
        What shall be measured: corners (x, y) in the scene's axes [m], or a GeoJSON or KML file
        with a polygon.
    no_go
        Where neither a tape nor the drone may pass: polygons as `area`, or a file.
    longest_tape_m, shortest_line_m
        Between which lengths a reference line lies.
    lay
        What is laid out: reference lines, coded plates of the scenario's size, or the better one.
    lines
        How many reference lines, or plates; None: as few as reach what is wanted.
    most_lines
        The most that the program may choose.
    wanted
        What shall be measured; nothing: lengths anywhere in the area.
    patterns
        Flights to choose from.
    heights_m, pitches_deg, frames
        Heights above the ground, gimbal pitches (-90 straight down) and numbers of photos to choose
        from; nothing: the program's own.
    max_height_m, min_height_m
        Above the ground.
    battery_min
        Time that one battery flies, all in.
    speed_m_s, seconds_per_photo
        From photo to photo; hovering at each.
    deviation_m, deviation_deg
        Standard deviations of how the drone departs from the plan: what lies close to a photo's
        edge may be missing in it.
    roughness_m
        By how much the ground departs from a plane, a standard deviation.
    robust
        Whether the layout must bear the loss of any one line.
    """

    area: str | Corners
    no_go: str | tuple[Corners, ...] = ()
    longest_tape_m: float = 15.0
    shortest_line_m: float = 3.0
    lay: Literal["lines", "plates", "either"] = "lines"
    lines: int | None = None
    most_lines: int = 8
    wanted: tuple[WantedMeasurement, ...] = ()
    patterns: tuple[FlightPattern, ...] = ("single", "strip")
    heights_m: tuple[float, ...] = ()
    pitches_deg: tuple[float, ...] = ()
    frames: tuple[int, ...] = ()
    max_height_m: float = 120.0
    min_height_m: float = 10.0
    battery_min: float = 20.0
    speed_m_s: float = 4.0
    seconds_per_photo: float = 4.0
    deviation_m: float = 2.0
    deviation_deg: float = 1.8
    roughness_m: float = 0.05
    robust: bool = False

    def __post_init__(self) -> None:
        positive = ("max_height_m", "min_height_m", "battery_min", "speed_m_s")
        for name in (*positive, "shortest_line_m", "longest_tape_m"):
            require(getattr(self, name) > 0, f"{name} must be greater than 0")
        for name in ("deviation_m", "deviation_deg", "roughness_m", "seconds_per_photo"):
            require(getattr(self, name) >= 0, f"{name} must not be negative")
        longest, shortest = self.longest_tape_m, self.shortest_line_m
        require(
            longest >= shortest,
            f"longest_tape_m ({longest:g}) must not be less than shortest_line_m ({shortest:g}): "
            f"add `shortest_line_m: {longest / 2:g}` for a tape as short as that",
        )
        require(self.lines is None or 0 <= self.lines <= 30, "lines must lie between 0 and 30")
        require(1 <= self.most_lines <= 30, "most_lines must lie between 1 and 30")
        for name in ("patterns", "heights_m", "pitches_deg", "frames"):
            count = len(getattr(self, name))
            require(count <= MOST_CHOICES, f"{name} may name at most {MOST_CHOICES} (got {count})")
        require(bool(self.patterns), "patterns must name at least one")
        require(
            all(-90 <= pitch <= -20 for pitch in self.pitches_deg),
            "pitches_deg must lie between -90 (straight down) and -20",
        )
        require(all(1 <= n <= 100 for n in self.frames), "frames must lie between 1 and 100")
        require(all(h > 0 for h in self.heights_m), "heights_m must be greater than 0")
        names = [wanted.name for wanted in self.wanted]
        twice = sorted({name for name in names if names.count(name) > 1})
        require(not twice, f"wanted: names given twice: {', '.join(twice)}")


ChosenBy = Literal["mean", "shares"]
"""What a layout makes smallest: the mean of lengths' sigmas, or the mean of all sigmas as shares of
what is wanted of them. Where nobody states that, lengths are shares of their mean sigma, and values
of other units of their own, with the first few lines."""


@dataclass(frozen=True, kw_only=True)
class PlannedSite:
    """Where the world's origin lies: WGS 84, height above mean sea level, geoid above ellipsoid.

    `ground_height_m` is that of the ground at the middle of the area, above the origin.
    """

    latitude_deg: float
    longitude_deg: float
    height_msl_m: float
    undulation_m: float = 0.0
    ground_height_m: float = 0.0


@dataclass(frozen=True, kw_only=True)
class FlightFacts:
    """The flight in numbers.

    Attributes
    ----------
    pattern
        How the photos lie.
    height_m
        Above the ground at the middle of the area.
    gimbal_pitch_deg
        -90 looks straight down.
    speed_m_s, seconds_per_photo
        From photo to photo; hovering at each.
    path_m, duration_s, battery_s
        Way from photo to photo; time from take-off to landing; what the battery gives.
    max_height_m
        Above the ground, that must not be passed.
    ground_sample_m
        What a pixel in the middle of a photo is on the ground.
    """

    pattern: FlightPattern
    height_m: float
    gimbal_pitch_deg: float
    speed_m_s: float
    seconds_per_photo: float
    path_m: float
    duration_s: float
    battery_s: float
    max_height_m: float
    ground_sample_m: float


@dataclass(frozen=True, kw_only=True)
class Assumptions:
    """What the prediction rests on: standard deviations.

    Attributes
    ----------
    telemetry
        Class of the log: ``consumer``, ``rtk``, ``ppk``, ``none``.
    pick_sigma_px, tape_sigma_m, tape_scale_sigma, roughness_m
        Of picks, tape readings, what all readings of the tape have in common, the ground about its
        plane.
    deviation_m, deviation_deg
        How the drone departs from the plan.
    """

    telemetry: str
    pick_sigma_px: float
    tape_sigma_m: float
    tape_scale_sigma: float
    roughness_m: float
    deviation_m: float
    deviation_deg: float


@dataclass(frozen=True, kw_only=True)
class Gain:
    """What another choice would bring.

    Attributes
    ----------
    what
        In words: ``one more line``.
    mean_sigma
        `FlightPlanned.mean_sigma` then.
    worst_without
        The same if the line is lost that matters most then; None of choices that are not about
        that, or where nothing holds the survey then.
    """

    what: str
    mean_sigma: float
    worst_without: float | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class FlightPlanned(FrozenArrays):
    """A plan, completely.

    Attributes
    ----------
    name
        Of the scenario.
    site
        Of the world's axes (east, north, up).
    camera
        With its covariance.
    drone
        Its name, empty where it is not known.
    area_world_m
        (V, 3) corners on the ground, counterclockwise from above, not closed.
    no_go_world_m
        Polygons (v, 3) likewise.
    flight, assumptions
        The flight in numbers; what the prediction rests on.
    frames, lines, plates, points, measurements, grid
        See each.
    mean_sigma
        Plain mean of the predicted standard deviations of the lengths that are wanted (of the map's
        where nothing else is; of all values where none is a length).
    chosen_by
        What the layout makes smallest, which is `mean_sigma` only where it is ``mean``.
    gains
        What one more line or photo would bring, and a layout that bears a loss would cost.
    messages
        What to know before flying.
    """

    name: str
    site: PlannedSite
    camera: Calibration
    drone: str = ""
    area_world_m: Annotated[Floats, "v", 3]
    no_go_world_m: tuple[Floats, ...] = ()
    flight: FlightFacts
    assumptions: Assumptions
    frames: PlannedFrames
    lines: PlannedLines
    plates: PlannedPlates = field(default_factory=PlannedPlates)
    points: PlannedPoints
    measurements: PlannedMeasurements
    grid: AccuracyGrid
    mean_sigma: float
    chosen_by: ChosenBy = "mean"
    gains: tuple[Gain, ...] = ()
    messages: tuple[Message, ...] = ()

    @property
    def laid(self) -> PlannedLines | PlannedPlates:
        """What is laid out to be known: plates, or lines where there are none."""
        return self.plates if self.plates.name else self.lines


@dataclass(frozen=True, kw_only=True, eq=False)
class NextLines(FrozenArrays):
    """Gains and losses of a survey's reference lines, by the mean sigma of its measurements.

    Attributes
    ----------
    mean_sigma
        Of the survey as it is: of lengths [m], where any are measured.
    unit
        Of `mean_sigma`.
    start_world_m, end_world_m
        (N, 3) lines that would have helped most, the best first; each is reckoned alone.
    near
        (N,) pairs of the labels that the two ends lie nearest to.
    near_m
        (N, 2) and how far from them.
    with_it
        (N,) the mean sigma with each.
    name, without_it
        (L,) the survey's lines, and the mean sigma without each; NaN where nothing holds it then.
    """

    mean_sigma: float
    unit: str
    start_world_m: Annotated[Floats, "n", 3]
    end_world_m: Annotated[Floats, "n", 3]
    near: Annotated[tuple[tuple[str, str], ...], "n"]
    near_m: Annotated[Floats, "n", 2]
    with_it: Annotated[Floats, "n"]
    name: Annotated[tuple[str, ...], "l"]
    without_it: Annotated[Floats, "l", NAN_IS_NONE]
