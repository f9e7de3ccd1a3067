"""The scenario of a simulated survey: every number that defines it, with the demo's as defaults.

These classes are the schema of configs/demo.yaml, and keep its units (degrees). Sigmas are of
normal distributions; what is drawn from them is in `SurveyTruth` (model/scenario/simulated.py).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field

from uavgram.model.planned.request import PlanRequest
from uavgram.model.scenario.checks import require
from uavgram.model.scenario.errors import ErrorSpec, StatedSpec, TelemetryClass
from uavgram.model.scenario.flight import FlightPlan
from uavgram.model.scenario.ground import GroundSpec
from uavgram.model.scenario.habits import HabitSpec
from uavgram.model.scenario.plates import PlateSpec
from uavgram.model.scenario.road import (
    DEMO_LINES,
    DEMO_POINTS,
    RoadLayout,
    SceneLine,
    ScenePoint,
)
from uavgram.model.survey.observations import MeasurementRequest

STEEPEST_DEG = 45.0
"""Ground on which nobody measures."""


@dataclass(frozen=True, kw_only=True)
class Site:
    """Where the scene lies.

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
            max(abs(slope) for slope in self.ground_slope_deg) <= STEEPEST_DEG,
            f"ground_slope_deg must lie between -{STEEPEST_DEG:g} and {STEEPEST_DEG:g}",
        )


@dataclass(frozen=True, kw_only=True)
class CameraSpec:
    """The camera's calibration (Brown model), from which the true camera is drawn.

    Attributes
    ----------
    file, drone
        A camera file, or the name of a drone's camera in the program's table, that says all the
        rest; at most one of the two.
    focal_mm
        Of that drone's lens, where the table does not say.
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
    """A simulated survey, completely: the same scenario gives the same survey, bit for bit.

    Attributes
    ----------
    name, seed
        Of the survey, and of its draws.
    site, ground
        Where it is, and how the ground differs from a plane.
    camera, flight
        Of the photos.
    telemetry
        What the log's positions come from; ``none``: there is no log. `config/scenario.py` fills
        in what is usual of it.
    errors, stated
        How wrong everything is, and what the project states of that.
    habits
        What the program does not take for granted.
    road, points, lines, measurements
        What lies on the ground, and what is taped and measured of it.
    plates
        Coded plates on the ground.
    control
        Labels of points whose coordinates are known and used.
    plan
        What `uavgram plan` is asked for; nothing else reads it.
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
    habits: HabitSpec = field(default_factory=HabitSpec)
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
            f"{self._of_the_demo()}",
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

    def with_seed(self, seed: int) -> Scenario:
        """Give the same scenario with another draw of every error."""
        return dataclasses.replace(self, seed=seed)

    def _of_the_demo(self) -> str:
        """Which of what names points is the demo's, though the points are not."""
        sections = {"lines": DEMO_LINES, "measurements": DEMO_MEASUREMENTS}
        same = [name for name, usual in sections.items() if getattr(self, name) == usual]
        if not same or self.points == DEMO_POINTS:
            return ""
        return f"; {' and '.join(same)} are the demo's: write your own, such as {same[0]}: []"

    @property
    def labels(self) -> tuple[str, ...]:
        """Of all points, and of the corners of all plates."""
        return (*(point.label for point in self.points), *self.plates.labels)

    @property
    def lost_exposure(self) -> int | None:
        """Index of the exposure of which no photo was stored, if there is one."""
        return self.errors.lost_exposure if self.flight.pattern == "strips" else None
