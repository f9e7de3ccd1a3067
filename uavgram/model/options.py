"""What a person may decide, with every default, in the units of project.yaml.

These classes are the schema of the file, the arguments of the stages, and the only place where a
default stands. They keep the file's units (degrees); stages convert at their entry.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Literal

from uavgram.model.telemetry import HeightDatum

Auto = Literal["auto"]


class OptionsError(ValueError):
    """Options out of their range: all of one class at once.

    Attributes
    ----------
    faults
        Pairs of field name and what is wrong with its value.
    """

    def __init__(self, owner: object, faults: tuple[tuple[str, str], ...]) -> None:
        self.faults = faults
        texts = (f"{name} {text}, got {getattr(owner, name)!r}" for name, text in faults)
        super().__init__(f"{type(owner).__name__}: " + "; ".join(texts))


def _require(owner: object, **rules: tuple[bool, str]) -> None:
    """Check rules of fields (name=(holds, "must ...")), and that every number is finite."""
    faults = {
        field_.name: "must be a finite number"
        for field_ in fields(owner)  # type: ignore[arg-type]  # every caller is a dataclass
        if not _is_finite(getattr(owner, field_.name))
    }
    for name, (holds, text) in rules.items():
        if not holds:
            faults.setdefault(name, text)
    if faults:
        raise OptionsError(owner, tuple(faults.items()))


def _is_finite(value: object) -> bool:
    if isinstance(value, tuple):
        return all(_is_finite(part) for part in value)
    return not isinstance(value, float) or math.isfinite(value)


_POSITIVE = "must be greater than 0"


def _all_positive(value: tuple[float, ...] | Auto) -> bool:
    return isinstance(value, str) or all(part > 0 for part in value)


@dataclass(frozen=True, kw_only=True)
class GeodeticOrigin:
    """A stated origin of the world: WGS 84, height above the datum that `heights` names."""

    latitude_deg: float
    longitude_deg: float
    height_m: float

    def __post_init__(self) -> None:
        _require(
            self,
            latitude_deg=(abs(self.latitude_deg) <= 90, "must lie between -90 and 90"),
            longitude_deg=(abs(self.longitude_deg) <= 360, "must lie between -360 and 360"),
        )


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
        _require(
            self,
            height_sigma_m=(self.height_sigma_m > 0, _POSITIVE),
            slope_sigma_deg=(0 < self.slope_sigma_deg < 45, "must lie between 0 and 45"),
            roughness_sigma_m=(self.roughness_sigma_m >= 0, "must not be negative"),
        )


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
        _require(
            self,
            boresight_sigma_deg=(self.boresight_sigma_deg > 0, _POSITIVE),
            lever_arm_sigma_m=(self.lever_arm_sigma_m > 0, _POSITIVE),
        )


@dataclass(frozen=True, kw_only=True)
class TimeOptions:
    """Where the instants of the exposures come from."""

    source: Literal["auto", "exif", "filename", "events"] = "auto"
    filename_format: str = "%Y%m%d_%H%M%S"
    offset_s: float | Auto = "auto"
    offset_sigma_s: float = 1.0

    def __post_init__(self) -> None:
        _require(
            self,
            offset_sigma_s=(self.offset_sigma_s > 0, _POSITIVE),
            filename_format=(
                "%" in self.filename_format,
                'must be a strptime pattern, such as "%Y%m%d_%H%M%S"',
            ),
        )


@dataclass(frozen=True, kw_only=True)
class TelemetryOptions:
    """How far the log is to be trusted."""

    position_sigma_m: tuple[float, float] | Auto = "auto"
    attitude_sigma_deg: tuple[float, float] | Auto = "auto"
    position_bias_sigma_m: tuple[float, float] = (2.0, 3.0)
    heading_bias_sigma_deg: float = 2.0

    def __post_init__(self) -> None:
        _require(
            self,
            position_sigma_m=(_all_positive(self.position_sigma_m), _POSITIVE),
            attitude_sigma_deg=(_all_positive(self.attitude_sigma_deg), _POSITIVE),
            position_bias_sigma_m=(_all_positive(self.position_bias_sigma_m), _POSITIVE),
            heading_bias_sigma_deg=(self.heading_bias_sigma_deg > 0, _POSITIVE),
        )


@dataclass(frozen=True, kw_only=True)
class SolveOptions:
    """What to do about blunders."""

    outliers: Literal["report", "remove"] = "report"
    significance: float = 0.001

    def __post_init__(self) -> None:
        _require(
            self,
            significance=(0 < self.significance < 0.5, "must lie between 0 and 0.5"),
        )


@dataclass(frozen=True, kw_only=True)
class Project:
    """A project file: which inputs, and every option.

    Paths are those of the file, made absolute; `images` are patterns. `poses` is ``exif`` or a
    path, and stands in place of `log`.
    """

    name: str
    images: tuple[str, ...]
    camera: str
    picks: str
    log: str | None = None
    poses: str | None = None
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
        given = {"log": self.log, "poses": self.poses, "lines": self.lines, "measure": self.measure}
        given |= {"control": self.control, "check": self.check}
        given |= {"name": self.name, "camera": self.camera, "picks": self.picks}
        given |= {"output": self.output}
        _require(
            self,
            **{key: (text != "", "must not be empty") for key, text in given.items()}
            | self._one_source(),
            images=(
                bool(self.images) and all(self.images),
                "must name at least one file or pattern",
            ),
            picks_sigma_px=(self.picks_sigma_px > 0, _POSITIVE),
        )

    def _one_source(self) -> dict[str, tuple[bool, str]]:
        if self.poses is None or self.log is None:
            return {}
        return {"poses": (False, "cannot stand beside `log`: leave one of the two out")}


def option_pairs(options: object, prefix: str = "") -> tuple[tuple[str, object], ...]:
    """List every option as a pair of dotted key and value, as `Provenance.options` wants them.

    Parameters
    ----------
    options
        A `Project`, or any options class.
    prefix
        Key of `options` within its owner.

    Returns
    -------
    tuple of (str, object)
        Such as ``("mount.pitch_deg", -90.0)``, in the order of the classes; values are text,
        numbers, None, or tuples of these.
    """
    pairs: list[tuple[str, object]] = []
    for field_ in fields(options):  # type: ignore[arg-type]  # options are dataclasses
        value, key = getattr(options, field_.name), prefix + field_.name
        pairs += option_pairs(value, f"{key}.") if is_dataclass(value) else [(key, value)]
    return tuple(pairs)
