"""What a person may decide, with every default, in the units of project.yaml.

These classes are the schema of the file, the arguments of the stages, and the only place where a
default stands. They keep the file's units (degrees); stages convert at their entry.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from uavgram.model.telemetry import HeightDatum

Auto = Literal["auto"]


def _require(condition: bool, message: str) -> None:  # noqa: FBT001
    if not condition:
        raise ValueError(message)


@dataclass(frozen=True, kw_only=True)
class GeodeticOrigin:
    """A stated origin of the world: WGS 84, height above the datum that `heights` names."""

    latitude_deg: float
    longitude_deg: float
    height_m: float

    def __post_init__(self) -> None:
        _require(abs(self.latitude_deg) <= 90, "latitude_deg must lie between -90 and 90")
        _require(abs(self.longitude_deg) <= 360, "longitude_deg must lie between -360 and 360")


@dataclass(frozen=True, kw_only=True)
class WorldOptions:
    """Origin of the world, and the datum of every height_m in the input files."""

    origin: Literal["home"] | GeodeticOrigin = "home"
    heights: HeightDatum = "msl"


@dataclass(frozen=True, kw_only=True)
class GroundOptions:
    """The ground plane and how well it is known beforehand."""

    height_m: float = 0.0
    height_sigma_m: float = 0.3
    slope_sigma_deg: float = 0.5
    roughness_sigma_m: float = 0.0

    def __post_init__(self) -> None:
        _require(self.height_sigma_m > 0, "height_sigma_m must be greater than 0")
        _require(0 < self.slope_sigma_deg < 45, "slope_sigma_deg must lie between 0 and 45")
        _require(self.roughness_sigma_m >= 0, "roughness_sigma_m must not be negative")


@dataclass(frozen=True, kw_only=True)
class MountOptions:
    """How the camera sits on the vehicle."""

    gimbal: Literal["auto", "none"] = "auto"
    yaw_deg: float = 0.0
    pitch_deg: float = -90.0
    roll_deg: float = 0.0
    boresight_sigma_deg: float = 2.0
    lever_arm_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    lever_arm_sigma_m: float = 0.1

    def __post_init__(self) -> None:
        _require(self.boresight_sigma_deg > 0, "boresight_sigma_deg must be greater than 0")
        _require(self.lever_arm_sigma_m > 0, "lever_arm_sigma_m must be greater than 0")


@dataclass(frozen=True, kw_only=True)
class TimeOptions:
    """Where the instants of the exposures come from."""

    source: Literal["auto", "exif", "filename", "events"] = "auto"
    filename_format: str = "%Y%m%d_%H%M%S"
    offset_s: float | Auto = "auto"
    offset_sigma_s: float = 1.0

    def __post_init__(self) -> None:
        _require(self.offset_sigma_s > 0, "offset_sigma_s must be greater than 0")
        _require("%" in self.filename_format, "filename_format must be a strptime pattern")


@dataclass(frozen=True, kw_only=True)
class TelemetryOptions:
    """How far the log is to be trusted."""

    position_sigma_m: tuple[float, float] | Auto = "auto"
    attitude_sigma_deg: tuple[float, float] | Auto = "auto"
    position_bias_sigma_m: tuple[float, float] = (2.0, 3.0)
    heading_bias_sigma_deg: float = 2.0

    def __post_init__(self) -> None:
        for name in ("position_sigma_m", "attitude_sigma_deg", "position_bias_sigma_m"):
            value = getattr(self, name)
            _require(value == "auto" or min(value) > 0, f"{name} must be greater than 0")
        _require(self.heading_bias_sigma_deg > 0, "heading_bias_sigma_deg must be greater than 0")


@dataclass(frozen=True, kw_only=True)
class SolveOptions:
    """What to do about blunders."""

    outliers: Literal["report", "remove"] = "report"
    significance: float = 0.001

    def __post_init__(self) -> None:
        _require(0 < self.significance < 0.5, "significance must lie between 0 and 0.5")


@dataclass(frozen=True, kw_only=True)
class Project:
    """A project file: which inputs, and every option.

    Paths are those of the file, made absolute; `images` are patterns.
    """

    name: str
    images: tuple[str, ...]
    camera: str
    picks: str
    log: str | None = None
    lines: str | None = None
    measure: str | None = None
    control: str | None = None
    check: str | None = None
    output: str = "out"
    world: WorldOptions = field(default_factory=WorldOptions)
    ground: GroundOptions = field(default_factory=GroundOptions)
    mount: MountOptions = field(default_factory=MountOptions)
    time: TimeOptions = field(default_factory=TimeOptions)
    telemetry: TelemetryOptions = field(default_factory=TelemetryOptions)
    picks_sigma_px: float = 1.0
    solve: SolveOptions = field(default_factory=SolveOptions)

    def __post_init__(self) -> None:
        _require(bool(self.images), "images must name at least one pattern")
        _require(self.picks_sigma_px > 0, "picks_sigma_px must be greater than 0")
