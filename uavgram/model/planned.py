"""Plans: the request, the planned flight and layout, and the predicted accuracy."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np

from uavgram.model.arrays import NAN_IS_NONE, Floats, FrozenArrays
from uavgram.model.camera import Calibration
from uavgram.model.limits import require
from uavgram.model.message import Message
from uavgram.model.naming import OPTIONAL
from uavgram.model.observations import MeasurementKind


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
        (F,) heading of the drone's nose, from north, clockwise; -90 is straight down.
    height_above_ground_m
        (F,) above the ground below the photo.
    footprint_world_m
        (F, V, 3) ground area in each photo, counterclockwise from above, not closed.
    safe_footprint_world_m
        (F, V, 3) ground area in each photo even where the drone departs from the plan.
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
        (L,) length, and standard deviation of the tape reading.
    frames_seen
        (L,) number of photos with both ends.
    redundancy
        (L,) 0 (no other observation checks its reading) to 1.
    mdb_m
        (L,) minimal detectable bias of its reading; NaN where no bias is detectable.
    mean_sigma_without
        (L,) `FlightPlanned.mean_sigma` if this line is lost; NaN where the survey is then
        undetermined.
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
        """(L,) label of the first end of each line."""
        return tuple(f"{name}a" for name in self.name)

    @property
    def end_label(self) -> tuple[str, ...]:
        """(L,) label of the other end of each line."""
        return tuple(f"{name}b" for name in self.name)


def _none() -> Floats:
    return np.zeros(0)


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedPlates(FrozenArrays):
    """L coded plates to be laid flat; empty where lines are taped.

    Attributes
    ----------
    name
        (L,) names in the program, ``T0``; the printed code has that number.
    corner_world_m
        (L, 4, 3) corners of the black square, counterclockwise from above.
    side_m
        Side of each plate.
    frames_seen
        (L,) number of photos with the entire plate.
    mean_sigma_without
        (L,) `FlightPlanned.mean_sigma` if it is lost; NaN where the survey is then undetermined.
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
        """(L, 3) centres of the plates."""
        return np.asarray(self.corner_world_m.mean(axis=1))


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedPoints(FrozenArrays):
    """K end points of the wanted measurements: (K,) labels, (K, 3) world coordinates."""

    label: Annotated[tuple[str, ...], "n"]
    world_m: Annotated[Floats, "n", 3]


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedMeasurements(FrozenArrays):
    """M values to be measured; empty where only the accuracy map was requested.

    Attributes
    ----------
    name, kind, unit
        (M,) as in results.json.
    points
        (M,) labels of `PlannedPoints`, in order.
    value, sigma
        (M,) value from the planned points, and its expected standard deviation.
    wanted_sigma
        (M,) required standard deviation; NaN where none was given.
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
    """Expected accuracy of lengths over the area.

    Attributes
    ----------
    center_world_m
        (K, 3) centres of square cells, on the ground.
    cell_m
        Side of a cell.
    length_m
        Length, centred on each cell, whose standard deviation is given.
    sigma_m
        (K,) root mean square over lengths to the east and to the north; NaN where no photo shows
        them.
    """

    center_world_m: Annotated[Floats, "n", 3]
    cell_m: float
    length_m: float
    sigma_m: Annotated[Floats, "n", NAN_IS_NONE]


Corners = tuple[tuple[float, float], ...]
"""Corners of a polygon: x, y in the scene's axes [m]."""

FlightPattern = Literal["single", "strip", "grid", "orbit"]
ReferenceKind = Literal["lines", "plates"]
"""Reference to lay out: lines for a tape, or coded plates."""

MAX_CHOICES = 30
"""Largest number of heights, pitches, photo counts or patterns; all combinations are planned."""


@dataclass(frozen=True, kw_only=True)
class WantedMeasurement:
    """Requested measurement and its required accuracy.

    Attributes
    ----------
    name, kind
        As in measure.csv.
    points
        Labels of the scenario, or points (x, y) in the scene's axes [m].
    sigma_m
        Required standard deviation, in the unit of the kind; None: as small as possible.
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
    """Request for a plan.

    Attributes
    ----------
    area
        Area to be measured: corners (x, y) in the scene's axes [m], or a GeoJSON or KML file with a
        polygon.
    no_go
        Areas closed to both tape and drone: polygons as `area`, or a file.
    longest_tape_m, shortest_line_m
        Limits of the length of a reference line.
    lay
        Reference to lay out: lines, coded plates of the scenario's size, or the better one.
    lines
        Number of reference lines or plates; None: the fewest that meet the requirements.
    most_lines
        Largest number that the program may choose.
    wanted
        Requested measurements; empty: lengths anywhere in the area.
    patterns
        Flight patterns to choose from.
    heights_m, pitches_deg, frames
        Heights above the ground, gimbal pitches (-90 straight down) and numbers of photos to choose
        from; empty: the program's own.
    max_height_m, min_height_m
        Limits of the height above the ground.
    battery_min
        Total flight time of one battery.
    speed_m_s, seconds_per_photo
        Speed from photo to photo; hover time at each.
    deviation_m, deviation_deg
        Standard deviations of the drone's departure from the plan; points close to a photo's edge
        may then be outside it.
    roughness_m
        Standard deviation of the ground from a plane.
    robust
        Whether the layout must tolerate the loss of any one line.
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
            require(count <= MAX_CHOICES, f"{name} may name at most {MAX_CHOICES} (got {count})")
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
"""Criterion that a layout minimises.

The mean of the lengths' sigmas, or the mean of all sigmas relative to their required values.
Without required values, lengths are relative to their mean sigma, and values of other units to
their own with the first few lines.
"""


@dataclass(frozen=True, kw_only=True)
class PlannedSite:
    """Origin of the world: WGS 84, height above mean sea level, geoid above ellipsoid.

    `ground_height_m` is that of the ground at the middle of the area, above the origin.
    """

    latitude_deg: float
    longitude_deg: float
    height_msl_m: float
    undulation_m: float = 0.0
    ground_height_m: float = 0.0


@dataclass(frozen=True, kw_only=True)
class FlightFacts:
    """Numbers of the planned flight.

    Attributes
    ----------
    pattern
        Arrangement of the photos.
    height_m
        Above the ground at the middle of the area.
    gimbal_pitch_deg
        -90 is straight down.
    speed_m_s, seconds_per_photo
        Speed from photo to photo; hover time at each.
    path_m, duration_s, battery_s
        Path from photo to photo; time from take-off to landing; flight time of the battery.
    max_height_m
        Largest permitted height above the ground.
    ground_sample_m
        Ground sampling distance in the middle of a photo.
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
    """Assumed standard deviations on which the prediction is based.

    Attributes
    ----------
    telemetry
        Class of the log: ``consumer``, ``rtk``, ``ppk``, ``none``.
    pick_sigma_px, tape_sigma_m, tape_scale_sigma, roughness_m
        Of picks, of tape readings, of the common scale of all readings, of the ground from its
        plane.
    deviation_m, deviation_deg
        Departure of the drone from the plan.
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
    """Effect of another choice.

    Attributes
    ----------
    what
        Text, such as ``one more line``.
    mean_sigma
        `FlightPlanned.mean_sigma` with that choice.
    worst_without
        The same after the loss of the most important line; None for choices that do not concern
        that, or where the survey is then undetermined.
    """

    what: str
    mean_sigma: float
    worst_without: float | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class FlightPlanned(FrozenArrays):
    """Complete plan.

    Attributes
    ----------
    name
        Name of the scenario.
    site
        Origin of the world's axes (east, north, up).
    camera
        Calibration with its covariance.
    drone
        Name of the drone, empty where unknown.
    area_world_m
        (V, 3) corners on the ground, counterclockwise from above, not closed.
    no_go_world_m
        Polygons (v, 3) likewise.
    flight, assumptions
        Numbers of the flight; assumptions of the prediction.
    frames, lines, plates, points, measurements, grid
        See each class.
    mean_sigma
        Plain mean of the predicted standard deviations of the requested lengths (of the map's where
        nothing else is requested; of all values where none is a length).
    chosen_by
        Criterion of the layout, which is `mean_sigma` only where it is ``mean``.
    gains
        Effect of one more line or photo, and cost of a layout that tolerates a loss.
    messages
        Messages to read before flying.
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
    plates: Annotated[PlannedPlates, OPTIONAL] = field(default_factory=PlannedPlates)
    points: PlannedPoints
    measurements: PlannedMeasurements
    grid: AccuracyGrid
    mean_sigma: float
    chosen_by: ChosenBy = "mean"
    gains: tuple[Gain, ...] = ()
    messages: tuple[Message, ...] = ()

    @property
    def laid(self) -> PlannedLines | PlannedPlates:
        """References to lay out: plates, or lines where there are none."""
        return self.plates if self.plates.name else self.lines


@dataclass(frozen=True, kw_only=True, eq=False)
class NextLines(FrozenArrays):
    """Gains and losses of a survey's reference lines, by the mean sigma of its measurements.

    Attributes
    ----------
    mean_sigma
        Mean sigma of the survey as it is: of its lengths [m], where any are measured.
    unit
        Unit of `mean_sigma`.
    start_world_m, end_world_m
        (N, 3) additional lines that would have helped most, the best first; each is evaluated
        alone.
    near
        (N,) pairs of the labels nearest to the two ends.
    near_m
        (N, 2) distances from those labels.
    with_it
        (N,) the mean sigma with each.
    name, without_it
        (L,) the survey's lines, and the mean sigma without each; NaN where the survey is then
        undetermined.
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
