"""Errors of a synthetic survey: true sizes, stated sigmas of its project, and fixed errors."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from types import MappingProxyType
from typing import Literal

from uavgram.model.limits import require, require_sizes

TelemetryClass = Literal["consumer", "rtk", "ppk", "none"]

LOST_EXPOSURE_INDEX = 9
"""Index of the exposure in the demo's flight without a stored photo."""


@dataclass(frozen=True, kw_only=True)
class ErrorSpec:
    """True errors of all that the survey records: one sigma of each source.

    Attributes
    ----------
    position_bias_m
        Common to the flight: [horizontal, vertical], each axis.
    position_drift_m, position_drift_tau_s
        Slow drift of the estimator [horizontal, vertical], first-order Gauss-Markov.
    gps_noise_m
        Of each fix of the receiver [horizontal, vertical], in addition to the errors shared with
        the estimator.
    attitude_deg, heading_deg, attitude_tau_s
        Of logged roll and pitch, and of logged yaw, Gauss-Markov.
    heading_bias_deg
        Of yaw, common to the flight.
    gimbal_deg
        Of logged gimbal angles, Gauss-Markov.
    boresight_deg
        Of the camera in its mount, about each axis.
    lever_arm_m, lever_arm_sigma_m
        Autopilot to camera as stated in the project (body FRD), and the error of that statement.
    camera_clock_offset_s
        Camera clock minus UTC (exact, not a sigma); unknown to the project.
    camera_zone_h
        Time zone of the camera, hours east of Greenwich.
    exif_jitter_s, event_jitter_s
        Of each photo's file time and of each logged exposure.
    lost_exposure
        Index of the exposure without a stored photo, None if there is none; for two strips only.
    readout_ms
        Time in which a photo is read, row after row (exact); unknown to the project.
    pick_px, tape_m, check_m, control_m
        Of each picked coordinate, each taped length, each axis of a check or control point.
    identification_m
        Deviation of the picked point from the label's true one: drawn again for each pick, east and
        north.
    tape_scale
        Of the tape, common to all lengths and relative to them.
    """

    position_bias_m: tuple[float, float] = (1.2, 1.5)
    position_drift_m: tuple[float, float] = (0.35, 0.4)
    position_drift_tau_s: float = 40.0
    gps_noise_m: tuple[float, float] = (0.25, 0.4)
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
    lost_exposure: int | None = LOST_EXPOSURE_INDEX
    readout_ms: float = 0.0
    pick_px: float = 0.7
    tape_m: float = 0.01
    check_m: float = 0.02
    control_m: float = 0.02
    identification_m: float = 0.0
    tape_scale: float = 0.0

    def __post_init__(self) -> None:
        positive = ("attitude_tau_s", "position_drift_tau_s", "pick_px", "tape_m", "check_m")
        for name in (*positive, "control_m"):
            require(getattr(self, name) > 0, f"{name} must be greater than 0")
        require(self.tape_scale < 0.1, "tape_scale must be below 0.1: it is a share of a length")
        require(abs(self.readout_ms) <= 500, "readout_ms must lie between -500 and 500")
        require_sizes(
            *(self, "position_bias_m", "position_drift_m", "gps_noise_m", "attitude_deg"),
            *("heading_deg", "heading_bias_deg", "gimbal_deg", "boresight_deg"),
            *("lever_arm_sigma_m", "exif_jitter_s", "event_jitter_s", "identification_m"),
            "tape_scale",
        )


@dataclass(frozen=True, kw_only=True)
class StatedSpec:
    """Stated sigmas in the project of the simulated survey; the demo's by default.

    Attributes
    ----------
    ground_height_sigma_m, ground_slope_sigma_deg, roughness_sigma_m
        Of the ground, level and at the height of home.
    picks_identification_sigma_m
        Deviation of the picked from the intended point, the same in all photos.
    boresight_sigma_deg, lever_arm_sigma_m, clock_sigma_s
        Of mount and clock. The clock's offset itself is found from the log's camera events; where
        these are too few or too regular to determine it, it is stated with that error.
    position_sigma_m, attitude_sigma_deg
        Of each frame: [horizontal, vertical], [tilt, yaw]; empty: as in the log.
    position_bias_sigma_m, heading_bias_sigma_deg
        Common to the flight: [horizontal, vertical].
    tape_scale_sigma
        Relative to all lengths.
    outliers, noise
        As in the project's `solve`.
    """

    ground_height_sigma_m: float = 0.5
    ground_slope_sigma_deg: float = 3.0
    roughness_sigma_m: float = 0.0
    picks_identification_sigma_m: float = 0.0
    boresight_sigma_deg: float = 1.5
    lever_arm_sigma_m: float = 0.05
    clock_sigma_s: float = 0.05
    position_sigma_m: tuple[float, ...] = ()
    attitude_sigma_deg: tuple[float, ...] = ()
    position_bias_sigma_m: tuple[float, float] = (2.0, 3.0)
    heading_bias_sigma_deg: float = 2.0
    tape_scale_sigma: float = 0.001
    outliers: Literal["report", "remove"] = "report"
    noise: Literal["estimate", "stated"] = "estimate"

    def __post_init__(self) -> None:
        for name in ("position_sigma_m", "attitude_sigma_deg"):
            pair = getattr(self, name)
            require(len(pair) in {0, 2} and min(pair, default=1) > 0, f"{name} must be two sigmas")
        require_sizes(self, "roughness_sigma_m", "picks_identification_sigma_m", "tape_scale_sigma")


Section = MappingProxyType[str, list[float]]


def _make_section(**values: list[float]) -> Section:
    return MappingProxyType(values)


_CENTIMETRE_SECTION = _make_section(
    position_sigma_m=[0.02, 0.03], position_bias_sigma_m=[0.03, 0.05]
)
USUAL_SECTIONS: MappingProxyType[str, MappingProxyType[str, Section]] = MappingProxyType(
    {
        "consumer": MappingProxyType({}),
        # A receiver with corrections states 1 cm + 1 ppm and 1.5 cm + 1 ppm (u-blox ZED-F9P data
        # sheet); errors of the antenna's lever arm and of the time of exposure add to that.
        "rtk": MappingProxyType(
            {
                "errors": _make_section(
                    position_bias_m=[0.02, 0.03],
                    position_drift_m=[0.015, 0.02],
                    gps_noise_m=[0.01, 0.02],
                ),
                "stated": _CENTIMETRE_SECTION,
            }
        ),
        "ppk": MappingProxyType(
            {
                "errors": _make_section(
                    position_bias_m=[0.015, 0.02],
                    position_drift_m=[0.01, 0.015],
                    gps_noise_m=[0.005, 0.01],
                ),
                "stated": _CENTIMETRE_SECTION,
            }
        ),
        "none": MappingProxyType({}),
    }
)
"""Defaults of a scenario's sections for each class of telemetry."""


@dataclass(frozen=True, kw_only=True)
class RaisedPoint:
    """Point off the ground without a statement in the project."""

    label: str
    height_m: float


@dataclass(frozen=True, kw_only=True)
class WrongLength:
    """Length with a gross error of its reading."""

    name: str
    by_m: float


@dataclass(frozen=True, kw_only=True)
class FixedErrors:
    """Fixed errors of people, logs and cameras, the same in each repetition.

    Attributes
    ----------
    tape_long
        Relative excess of all length readings.
    level_tape
        Lengths are taped horizontally, and written as if along the ground.
    focal_wrong
        Relative excess of the true focal length over that of the calibration.
    lag_s
        Delay of the log's exposures.
    yaw_deg, mount_deg
        Fixed errors of the log's heading, and of the camera's tilt in its mount, in addition to the
        random ones.
    gps_jump_m
        Step of the logged position to the north, in the middle of the photos.
    heavy_tails
        Share of picks with five times larger errors.
    pick_factor
        True over stated sigma of the picks.
    raised
        Points off the ground.
    swapped
        Pairs of labels that are exchanged in the first photo that shows both.
    wrong_lengths
        Readings with a gross error.
    """

    tape_long: float = 0.0
    level_tape: bool = False
    focal_wrong: float = 0.0
    lag_s: float = 0.0
    yaw_deg: float = 0.0
    mount_deg: float = 0.0
    gps_jump_m: float = 0.0
    heavy_tails: float = 0.0
    pick_factor: float = 1.0
    raised: tuple[RaisedPoint, ...] = ()
    swapped: tuple[tuple[str, str], ...] = ()
    wrong_lengths: tuple[WrongLength, ...] = ()

    def __post_init__(self) -> None:
        for name in ("tape_long", "focal_wrong"):
            require(abs(getattr(self, name)) < 0.9, f"{name} is a share: it must be below 0.9")
        require(0 <= self.heavy_tails <= 1, "heavy_tails is a share: it must lie between 0 and 1")
        require(self.pick_factor > 0, "pick_factor must be greater than 0")

    def names(self) -> tuple[str, ...]:
        """Return the names of the fixed errors that are not at their defaults."""
        return tuple(f.name for f in fields(self) if getattr(self, f.name) != f.default)

    def only(self, name: str) -> FixedErrors:
        """Return the habits with one of these errors alone."""
        return replace(FixedErrors(), **{name: getattr(self, name)})

    @property
    def labels(self) -> frozenset[str]:
        """Points that the habits name."""
        raised = {one.label for one in self.raised}
        return frozenset(raised | {label for pair in self.swapped for label in pair})
