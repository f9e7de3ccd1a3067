"""Scenario of a synthetic survey: every number that defines it, with the demo's as defaults.

These classes are the schema of configs/demo.yaml, and keep its units (degrees). Sigmas are of
normal distributions; the values drawn from them are in `SurveyTruth` (survey.py).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from datetime import datetime
from typing import Literal

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.limits import require, require_sizes
from uavgram.model.naming import LARGEST_PLATE_M, PLATE_CORNERS, corner_label
from uavgram.model.observations import MeasurementRequest
from uavgram.model.planned import PlanRequest
from uavgram.synthetic.accident_scene import (
    DEMO_LINES,
    DEMO_POINTS,
    RoadLayout,
    SceneLine,
    ScenePoint,
)
from uavgram.synthetic.errors import ErrorSpec, FixedErrors, StatedSpec, TelemetryClass

Shape = Literal["plane", "level", "slope", "crown", "relief"]

SLOPE_DEG, CROWN_PERCENT, RELIEF_M = 5.0, 2.0, 0.05
"""Default sizes of shapes: a steep road, a road's crown, worn asphalt with ruts."""


@dataclass(frozen=True, kw_only=True)
class GroundSpec:
    """Departure of the ground from the plane of `Site`.

    Attributes
    ----------
    shape
        ``plane``: as in `Site`; ``level``: without its slope; ``slope``, ``crown``, ``relief``:
        with one of these in its default size, unless a size is given.
    slope_deg
        Upwards along the scene's x axis, in addition to the site's slope.
    crown_percent
        Fall of the ground to both sides of the scene's x axis.
    slope_break_percent
        Rise of the ground to the left of the scene's x axis.
    kerb_m, kerb_y_m
        Step up to the left of a line parallel to the scene's x axis.
    relief_m, relief_length_m
        Standard deviation and correlation length of the ground's departure from all that; with a
        length of 0 each point has its own.
    height_sigma_m, slope_sigma_deg
        The plane is drawn again in each repetition: height and each slope about those of `Site`.
    """

    shape: Shape = "plane"
    slope_deg: float = 0.0
    crown_percent: float = 0.0
    slope_break_percent: float = 0.0
    kerb_m: float = 0.0
    kerb_y_m: float = 3.5
    relief_m: float = 0.0
    relief_length_m: float = 5.0
    height_sigma_m: float = 0.0
    slope_sigma_deg: float = 0.0

    def __post_init__(self) -> None:
        require_sizes(self, "relief_m", "relief_length_m", "height_sigma_m", "slope_sigma_deg")
        require(abs(self.slope_deg) < 30, "slope_deg must lie between -30 and 30")
        usual = {
            "slope": ("slope_deg", SLOPE_DEG),
            "crown": ("crown_percent", CROWN_PERCENT),
            "relief": ("relief_m", RELIEF_M),
        }
        if self.shape in usual and not getattr(self, usual[self.shape][0]):
            object.__setattr__(self, *usual[self.shape])

    @property
    def is_plane(self) -> bool:
        """Return whether the ground is a plane, as the program assumes."""
        sizes = (self.crown_percent, self.slope_break_percent, self.kerb_m, self.relief_m)
        return not any(sizes)


MIN_EXPOSURES = 10
"""Number of exposures on strips from which on their gaps match camera events in one way only."""

Pattern = Literal["strips", "strip", "grid", "orbit", "single", "poses"]


def _is_instant(text: str) -> bool:
    """Return whether a text is a date and a time with its zone."""
    try:
        return datetime.fromisoformat(text).tzinfo is not None
    except ValueError:
        return False


@dataclass(frozen=True, kw_only=True)
class Station:
    """Hovering position of a photo.

    Attributes
    ----------
    x_m, y_m
        Scene axes.
    height_m
        Above home.
    heading_deg
        Heading of the vehicle's nose and of the image's top: from the scene's x axis,
        counterclockwise.
    pitch_deg
        Of the optical axis, -90 straight down.
    """

    x_m: float
    y_m: float
    height_m: float
    heading_deg: float = 0.0
    pitch_deg: float = -90.0


@dataclass(frozen=True, kw_only=True)
class FlightPlan:
    """Flight plan of the photos, by default two strips along the road, there and back, nose first.

    Attributes
    ----------
    pattern
        ``strips``: two along the scene's x axis, one on each side; ``strip``: one over it;
        ``grid``: `grid_strips` along it and as many across; ``orbit``: `frames` photos on a circle
        that look at its middle; ``single``: one photo of the scene's middle; ``poses``: those of
        `poses`.
    start_utc
        ISO 8601 with its zone: start of the recording, 8 s before take-off.
    boot_s
        Autopilot's time since boot at that moment.
    height_m
        Above home.
    strip_offset_m, strip_half_length_m
        Distance of the strips from the scene's axis (half the distance between them); half the
        length over which photos are spread.
    photos_per_strip
        Exposures on each strip.
    grid_strips
        Number of strips of a grid in each direction.
    frames, radius_m
        Of an orbit.
    poses
        Positions of the photos, where the pattern is ``poses``.
    trigger_jitter_m
        Half range of each exposure's position along the strip (uniform).
    wobble_m, tilt_wobble_deg, gimbal_wobble_deg
        Sigmas of the true motion about the plan: position, body roll and pitch, gimbal.
    gimbal_pitch_deg
        Of the optical axis, -90 straight down.
    """

    pattern: Pattern = "strips"
    start_utc: str = "2026-05-09T13:05:00Z"
    boot_s: float = 84.5
    height_m: float = 31.6
    speed_m_s: float = 4.5
    strip_offset_m: float = 4.0
    strip_half_length_m: float = 20.0
    photos_per_strip: int = 7
    grid_strips: int = 3
    frames: int = 8
    radius_m: float = 20.0
    poses: tuple[Station, ...] = ()
    trigger_jitter_m: float = 0.5
    wobble_m: float = 0.15
    tilt_wobble_deg: float = 0.6
    gimbal_pitch_deg: float = -80.0
    gimbal_wobble_deg: float = 0.4

    def __post_init__(self) -> None:
        for name in ("height_m", "speed_m_s", "strip_half_length_m", "radius_m"):
            require(getattr(self, name) > 0, f"{name} must be greater than 0")
        require(self.photos_per_strip >= 2, "photos_per_strip must be at least 2")
        require(1 <= self.grid_strips <= 50, "grid_strips must lie between 1 and 50")
        require(2 <= self.frames <= 500, "frames must lie between 2 and 500")
        require(-90 <= self.gimbal_pitch_deg < -30, "gimbal_pitch_deg must lie in [-90, -30)")
        require_sizes(self, "wobble_m", "tilt_wobble_deg", "gimbal_wobble_deg", "trigger_jitter_m")
        require(_is_instant(self.start_utc), f"start_utc must be such as {FlightPlan.start_utc}")
        stated = self.pattern == "poses"
        require(
            bool(self.poses) == stated, "poses must be given where pattern is poses, only there"
        )

    @property
    def start_utc_s(self) -> float:
        """Start of the recording, seconds since the Unix epoch."""
        return datetime.fromisoformat(self.start_utc).timestamp()

    @property
    def is_hovering(self) -> bool:
        """Return whether photos are taken while hovering, one every few seconds."""
        return self.pattern in {"orbit", "single", "poses"}

    @property
    def tells_clock(self) -> bool:
        """Return whether exposures are numerous and irregular enough to find the clock offset."""
        return self.photo_count >= MIN_EXPOSURES and not self.is_hovering

    @property
    def photo_count(self) -> int:
        """Number of exposures of the flight."""
        return {
            "strips": 2 * self.photos_per_strip,
            "strip": self.photos_per_strip,
            "grid": 2 * self.grid_strips * self.photos_per_strip,
            "orbit": self.frames,
            "single": 1,
            "poses": len(self.poses),
        }[self.pattern]


PLATE_FAMILY = "aruco-4x4-50"
MAX_PLATES = 50


@dataclass(frozen=True, kw_only=True)
class PlateSpec:
    """Coded plates of one size.

    Attributes
    ----------
    side_m, sigma_m
        Side of the black square, and its standard deviation, as in a project's `targets`.
    corner_px
        Standard deviation of a corner found by the program.
    at
        Positions (x, y, turn): scene axes [m], and rotation of their sides counterclockwise from
        the x axis [deg].
    """

    side_m: float = 0.5
    sigma_m: float = 0.0005
    corner_px: float = 0.1
    at: tuple[tuple[float, float, float], ...] = ()

    def __post_init__(self) -> None:
        require(0 < self.side_m <= LARGEST_PLATE_M, "side_m must be above 0, at most 10 m")
        require(
            0 < self.sigma_m <= 0.1 * self.side_m, "sigma_m must be above 0, at most side_m / 10"
        )
        require(self.corner_px > 0, "corner_px must be greater than 0")
        require(len(self.at) <= MAX_PLATES, f"at must name at most {MAX_PLATES} plates")

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of all corners, plate by plate."""
        return tuple(corner_label(k, c) for k in range(len(self.at)) for c in range(PLATE_CORNERS))


MAX_SLOPE_DEG = 45.0
"""Largest slope of the ground; steeper ground is never measured."""


@dataclass(frozen=True, kw_only=True)
class Site:
    """Position of the scene on the earth.

    Attributes
    ----------
    latitude_deg, longitude_deg, height_msl_m
        Home, the origin of the world: WGS 84, height above mean sea level.
    undulation_m
        Height of the geoid above the ellipsoid.
    scene_east_m, scene_north_m
        The scene's origin, from home.
    road_azimuth_deg
        Of the scene's x axis, from north, clockwise.
    ground_height_m, ground_slope_deg
        Of the ground at the scene's origin, above home; [d up / d east, d up / d north].
    """

    latitude_deg: float = 50.4452000
    longitude_deg: float = -104.6189000
    height_msl_m: float = 577.0
    undulation_m: float = -20.6
    scene_east_m: float = 26.0
    scene_north_m: float = 17.0
    road_azimuth_deg: float = 62.0
    ground_height_m: float = -0.4
    ground_slope_deg: tuple[float, float] = (0.25, -0.15)

    def __post_init__(self) -> None:
        require(abs(self.latitude_deg) < 90, "latitude_deg must lie between -90 and 90")
        require(abs(self.longitude_deg) <= 180, "longitude_deg must lie between -180 and 180")
        require(
            max(abs(slope) for slope in self.ground_slope_deg) <= MAX_SLOPE_DEG,
            f"ground_slope_deg must lie between -{MAX_SLOPE_DEG:g} and {MAX_SLOPE_DEG:g}",
        )

    @property
    def axes(self) -> Floats:
        """(2, 2) rotation ``east_north = axes @ scene_xy``."""
        azimuth = np.deg2rad(self.road_azimuth_deg)
        return np.array([[np.sin(azimuth), -np.cos(azimuth)], [np.cos(azimuth), np.sin(azimuth)]])

    @property
    def middle_m(self) -> Floats:
        """(2,) east and north of the scene's origin."""
        return np.array([self.scene_east_m, self.scene_north_m])

    def in_world(self, scene_xy_m: Floats) -> Floats:
        """Convert scene axes to (N, 2) east and north."""
        return np.asarray(scene_xy_m @ self.axes.T + self.middle_m)

    def in_scene(self, east_north_m: Floats) -> Floats:
        """Convert east and north to (N, 2) scene axes."""
        return np.asarray((east_north_m - self.middle_m) @ self.axes)


@dataclass(frozen=True, kw_only=True)
class CameraSpec:
    """Calibration of the camera (Brown model), from which the true camera is drawn.

    Attributes
    ----------
    file, drone
        A camera file, or the name of a drone's camera in the program's table, that replaces the
        values below; at most one of the two.
    focal_mm
        Of that drone's lens, where the table has none.
    parameters, sigma
        fx fy cx cy [px] k1 k2 p1 p2 k3.
    focal_correlation
        Between the errors of fx and fy.
    """

    file: str | None = None
    drone: str | None = None
    focal_mm: float | None = None
    name: str = "uavgram demo camera"
    width_px: int = 2000
    height_px: int = 1500
    parameters: tuple[float, ...] = (2100.0, 2101.0, 1006.5, 744.0, -0.1, 0.03, 3e-4, -2e-4, 0.0)
    sigma: tuple[float, ...] = (4.0, 4.0, 2.5, 2.5, 0.002, 0.004, 1e-4, 1e-4, 0.001)
    focal_correlation: float = 0.97

    def __post_init__(self) -> None:
        require(self.file is None or self.drone is None, "file and drone: give one of the two")
        for name in ("parameters", "sigma"):
            require(len(getattr(self, name)) == 9, f"{name} must hold fx fy cx cy k1 k2 p1 p2 k3")
        require(min(self.sigma) > 0, "sigma must be greater than 0")
        require(min(self.parameters[:2]) > 0, "parameters: fx and fy must be greater than 0")
        require(abs(self.focal_correlation) < 1, "focal_correlation must lie between -1 and 1")
        require(min(self.width_px, self.height_px) > 0, "width_px and height_px must be positive")


DEMO_MEASUREMENTS: tuple[MeasurementRequest, ...] = (
    MeasurementRequest(name="skid left", kind="distance", points=("P1", "P2")),
    MeasurementRequest(name="skid left path", kind="polyline", points=("P1", "P15", "P2")),
    MeasurementRequest(
        name="speed from skid",
        kind="skid_speed",
        points=("P1", "P2"),
        parameters=(("mu", 0.7), ("mu_sigma", 0.05)),
    ),
    MeasurementRequest(name="skid right", kind="distance", points=("P3", "P4")),
    MeasurementRequest(name="car to car", kind="distance", points=("P5", "P7")),
    MeasurementRequest(name="scene diagonal", kind="distance", points=("R5", "R4")),
    MeasurementRequest(name="debris field", kind="area", points=("P9", "P10", "P11", "P12")),
    MeasurementRequest(name="angle of approach", kind="angle", points=("P3", "P8", "P13")),
    MeasurementRequest(name="impact to footpath", kind="line_distance", points=("P8", "R2", "R3")),
    MeasurementRequest(name="impact", kind="coordinate", points=("P8",)),
)


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """Complete description of a simulated survey: it gives the same survey bit for bit.

    Attributes
    ----------
    name, seed
        Of the survey, and of its draws.
    site, ground
        Position, and departure of the ground from a plane.
    camera, flight
        Of the photos.
    telemetry
        Source of the log's positions; ``none``: there is no log. `scenario_file.py` fills in its
        default errors.
    errors, stated
        True sizes of all errors, and their sigmas stated in the project.
    habits
        Fixed errors that violate the program's assumptions.
    road, points, lines, measurements
        Objects on the ground, taped lengths and measurements.
    plates
        Coded plates on the ground.
    control
        Labels of points whose coordinates are known and used.
    plan
        Request for `uavgram plan`, the only command that reads it.
    """

    name: str = "demo"
    seed: int = 20140321
    site: Site = field(default_factory=Site)
    ground: GroundSpec = field(default_factory=GroundSpec)
    camera: CameraSpec = field(default_factory=CameraSpec)
    flight: FlightPlan = field(default_factory=FlightPlan)
    telemetry: TelemetryClass = "consumer"
    errors: ErrorSpec = field(default_factory=ErrorSpec)
    stated: StatedSpec = field(default_factory=StatedSpec)
    habits: FixedErrors = field(default_factory=FixedErrors)
    road: RoadLayout = field(default_factory=RoadLayout)
    points: tuple[ScenePoint, ...] = DEMO_POINTS
    lines: tuple[SceneLine, ...] = DEMO_LINES
    plates: PlateSpec = field(default_factory=PlateSpec)
    control: tuple[str, ...] = ()
    measurements: tuple[MeasurementRequest, ...] = DEMO_MEASUREMENTS
    plan: PlanRequest | None = None

    def __post_init__(self) -> None:
        require(self.seed >= 0, "seed must not be negative")
        labels = self.labels
        twice = sorted({label for label in labels if labels.count(label) > 1})
        require(not twice, f"points: labels given twice: {', '.join(twice)}")
        for what, names in (
            ("lines", [line.name for line in self.lines]),
            ("measurements", [request.name for request in self.measurements]),
        ):
            twice = sorted({name for name in names if names.count(name) > 1})
            require(not twice, f"{what}: names given twice: {', '.join(twice)}")
        used = {end for line in self.lines for end in (line.start, line.end)}
        used |= {label for request in self.measurements for label in request.points}
        used |= {*self.control, *self.habits.labels}
        unknown = sorted(used - set(labels))
        require(
            not unknown,
            f"lines, measurements, control and habits name unknown points: {', '.join(unknown)}"
            f"{self._name_demo_sections()}",
        )
        wrong = {one.name for one in self.habits.wrong_lengths}
        strange = sorted(wrong - {line.name for line in self.lines})
        require(not strange, f"habits: wrong_lengths names unknown lines: {', '.join(strange)}")
        count, lost = self.flight.photo_count, self.errors.lost_exposure
        if self.flight.pattern == "strips" and lost is not None:
            require(
                0 <= lost < count,
                f"lost_exposure must lie between 0 and {count - 1}, or be null: none is lost",
            )

    def replace_seed(self, seed: int) -> Scenario:
        """Return the same scenario with another draw of every error."""
        return dataclasses.replace(self, seed=seed)

    def _name_demo_sections(self) -> str:
        """Name the sections with points that are the demo's, though the points are not."""
        sections = {"lines": DEMO_LINES, "measurements": DEMO_MEASUREMENTS}
        same = [name for name, usual in sections.items() if getattr(self, name) == usual]
        if not same or self.points == DEMO_POINTS:
            return ""
        return f"; {' and '.join(same)} are the demo's: write your own, such as {same[0]}: []"

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of all points, and of the corners of all plates."""
        return (*(point.label for point in self.points), *self.plates.labels)

    @property
    def lost_exposure(self) -> int | None:
        """Index of the exposure without a stored photo, if there is one."""
        return self.errors.lost_exposure if self.flight.pattern == "strips" else None


@dataclass(frozen=True, kw_only=True)
class RepeatedSurvey:
    """A real survey, repeated with the same flight and other errors.

    Attributes
    ----------
    name, seed
        Of the simulation.
    lines
        Additional lengths that were not taped, between picked points, to study their effect.
    tape_m
        Standard deviation of these.
    """

    name: str = "repeated survey"
    seed: int = 0
    lines: tuple[SceneLine, ...] = ()
    tape_m: float = 0.01

    def __post_init__(self) -> None:
        require(self.seed >= 0, "seed must not be negative")
        require(self.tape_m > 0, "tape_m must be greater than 0")
