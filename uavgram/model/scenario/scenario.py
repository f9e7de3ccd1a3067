"""The scenario of a simulated survey: every number that defines it, with the demo's as defaults.

These classes are the schema of configs/demo.yaml, and keep its units (degrees). Sigmas are of
normal distributions; what is drawn from them is in `SurveyTruth` (model/scenario/simulated.py).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field

from uavgram.model.scenario.road import (
    DEMO_LINES,
    DEMO_POINTS,
    DEMO_ROAD,
    RoadLayout,
    SceneLine,
    ScenePoint,
)
from uavgram.model.survey.observations import MeasurementRequest


def _require(condition: bool, message: str) -> None:  # noqa: FBT001
    if not condition:
        raise ValueError(message)


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


@dataclass(frozen=True, kw_only=True)
class CameraSpec:
    """The camera's calibration (Brown model), from which the true camera is drawn.

    Attributes
    ----------
    parameters, sigma
        fx fy cx cy [px] k1 k2 p1 p2 k3.
    focal_correlation
        Between the errors of fx and fy.
    """

    name: str = "uavgram demo camera"
    width_px: int = 2000
    height_px: int = 1500
    parameters: tuple[float, ...] = (2100.0, 2101.0, 1006.5, 744.0, -0.1, 0.03, 3e-4, -2e-4, 0.0)
    sigma: tuple[float, ...] = (4.0, 4.0, 2.5, 2.5, 0.002, 0.004, 1e-4, 1e-4, 0.001)
    focal_correlation: float = 0.97

    def __post_init__(self) -> None:
        for name in ("parameters", "sigma"):
            _require(len(getattr(self, name)) == 9, f"{name} must hold fx fy cx cy k1 k2 p1 p2 k3")
        _require(min(self.sigma) > 0, "sigma must be greater than 0")
        _require(abs(self.focal_correlation) < 1, "focal_correlation must lie between -1 and 1")
        _require(min(self.width_px, self.height_px) > 0, "width_px and height_px must be positive")


@dataclass(frozen=True, kw_only=True)
class FlightPlan:
    """Two strips along the road, there and back, nose first.

    Attributes
    ----------
    start_utc
        ISO 8601 with its zone: when the recording starts, 8 s before take-off.
    boot_s
        Autopilot's time since boot at that moment.
    height_m
        Above home.
    strip_offset_m, strip_half_length_m
        The strips lie that far beside the scene's axis; photos are spread over twice that length.
    photos_per_strip
        Exposures on each strip.
    trigger_jitter_m
        Half range of each exposure's place along the strip (uniform).
    wobble_m, tilt_wobble_deg, gimbal_wobble_deg
        Sigmas of the true motion about the plan: position, body roll and pitch, gimbal.
    gimbal_pitch_deg
        Of the optical axis, -90 straight down.
    """

    start_utc: str = "2026-05-09T13:05:00Z"
    boot_s: float = 84.5
    height_m: float = 31.6
    speed_m_s: float = 4.5
    strip_offset_m: float = 4.0
    strip_half_length_m: float = 20.0
    photos_per_strip: int = 7
    trigger_jitter_m: float = 0.5
    wobble_m: float = 0.15
    tilt_wobble_deg: float = 0.6
    gimbal_pitch_deg: float = -80.0
    gimbal_wobble_deg: float = 0.4

    def __post_init__(self) -> None:
        for name in ("height_m", "speed_m_s", "strip_half_length_m"):
            _require(getattr(self, name) > 0, f"{name} must be greater than 0")
        _require(self.photos_per_strip >= 2, "photos_per_strip must be at least 2")
        _require(-90 <= self.gimbal_pitch_deg < -30, "gimbal_pitch_deg must lie in [-90, -30)")


@dataclass(frozen=True, kw_only=True)
class ErrorSpec:
    """How wrong everything is that the survey records: one sigma of each source.

    Attributes
    ----------
    position_bias_m
        Common to the flight: [horizontal, vertical], each axis.
    position_drift_m, position_drift_tau_s
        Slow wander of the estimator [horizontal, vertical], first-order Gauss-Markov.
    attitude_deg, heading_deg, attitude_tau_s
        Of logged roll and pitch, and of logged yaw, Gauss-Markov.
    heading_bias_deg
        Of yaw, common to the flight.
    gimbal_deg
        Of logged gimbal angles, Gauss-Markov.
    boresight_deg
        Of the camera in its mount, about each axis.
    lever_arm_m, lever_arm_sigma_m
        Autopilot to camera as the project states it (body FRD), and the error of that statement.
    camera_clock_offset_s
        Camera clock minus UTC (exact, not a sigma); the project does not know it.
    camera_zone_h
        The zone the camera is set to, hours east of Greenwich.
    exif_jitter_s, event_jitter_s
        Of each photo's file time and of each logged exposure.
    lost_exposure
        Index of the exposure of which no photo was stored.
    pick_px, tape_m, check_m
        Of each picked coordinate, each taped length, each axis of a check point.
    """

    position_bias_m: tuple[float, float] = (1.2, 1.5)
    position_drift_m: tuple[float, float] = (0.35, 0.4)
    position_drift_tau_s: float = 40.0
    attitude_deg: float = 0.6
    heading_deg: float = 1.5
    attitude_tau_s: float = 3.0
    heading_bias_deg: float = 1.5
    gimbal_deg: float = 0.6
    boresight_deg: float = 1.0
    lever_arm_m: tuple[float, float, float] = (0.12, 0.0, 0.08)
    lever_arm_sigma_m: float = 0.02
    camera_clock_offset_s: float = 2.6
    camera_zone_h: float = -6.0
    exif_jitter_s: float = 0.01
    event_jitter_s: float = 0.005
    lost_exposure: int = 9
    pick_px: float = 0.7
    tape_m: float = 0.01
    check_m: float = 0.02

    def __post_init__(self) -> None:
        positive = ("attitude_tau_s", "position_drift_tau_s", "pick_px", "tape_m", "check_m")
        for name in positive:
            _require(getattr(self, name) > 0, f"{name} must be greater than 0")


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
    """A simulated survey, completely: the same scenario gives the same survey, bit for bit."""

    name: str = "demo"
    seed: int = 20140321
    site: Site = field(default_factory=Site)
    camera: CameraSpec = field(default_factory=CameraSpec)
    flight: FlightPlan = field(default_factory=FlightPlan)
    errors: ErrorSpec = field(default_factory=ErrorSpec)
    road: RoadLayout = DEMO_ROAD
    points: tuple[ScenePoint, ...] = DEMO_POINTS
    lines: tuple[SceneLine, ...] = DEMO_LINES
    measurements: tuple[MeasurementRequest, ...] = DEMO_MEASUREMENTS

    def __post_init__(self) -> None:
        _require(self.seed >= 0, "seed must not be negative")
        labels = [point.label for point in self.points]
        twice = sorted({label for label in labels if labels.count(label) > 1})
        _require(not twice, f"points: labels given twice: {', '.join(twice)}")
        used = {end for line in self.lines for end in (line.start, line.end)}
        used |= {label for request in self.measurements for label in request.points}
        unknown = sorted(used - set(labels))
        _require(not unknown, f"lines and measurements name unknown points: {', '.join(unknown)}")
        count = 2 * self.flight.photos_per_strip
        lost = self.errors.lost_exposure
        _require(0 <= lost < count, f"lost_exposure must lie between 0 and {count - 1}")

    def with_seed(self, seed: int) -> Scenario:
        """Give the same scenario with another draw of every error."""
        return dataclasses.replace(self, seed=seed)
