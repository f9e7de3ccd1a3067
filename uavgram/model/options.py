"""Options of a project with all defaults, in the units of project.yaml.

These classes are the schema of the file, the arguments of the stages, and the only place of the
defaults. They keep the file's units (degrees); stages convert them first.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from types import MappingProxyType
from typing import Literal

from uavgram.errors import suggest_spelling
from uavgram.model.flight_log import HeightDatum
from uavgram.model.limits import find_value_fault
from uavgram.model.naming import BOARD_PLATE, FAMILIES, LARGEST_PLATE_M, Units
from uavgram.model.provenance import Case
from uavgram.model.survey import DEFAULT_AREA

Auto = Literal["auto"]


class OptionsError(ValueError):
    """Error for options out of range: all faults of one class together.

    Attributes
    ----------
    faults
        Pairs of field name and fault of its value.
    """

    def __init__(self, owner: object, faults: tuple[tuple[str, str], ...]) -> None:
        self.faults = faults
        texts = (f"{name} {text}, got {getattr(owner, name)!r}" for name, text in faults)
        super().__init__(f"{type(owner).__name__}: " + "; ".join(texts))


@dataclass(frozen=True, kw_only=True)
class _Options:
    """Options checked on construction: finite numbers, fields named sigma, and own rules."""

    def __post_init__(self) -> None:
        own, faults = self._rules(), dict[str, str]()
        for name in (field_.name for field_ in fields(self)):
            fault = _fault("" if name in own else name, getattr(self, name))
            holds, text = own.get(name, (True, ""))
            if fault or not holds:
                faults[name] = fault or text
        if faults:
            raise OptionsError(self, tuple(faults.items()))

    def _rules(self) -> dict[str, tuple[bool, str]]:
        """Return, for each field with a rule, whether it holds, and the message if it does not."""
        return {}


def _fault(field_name: str, value: object) -> str:
    """Return why a number, or one of several, is not valid for a field; empty for other values."""
    if isinstance(value, tuple):
        return next(filter(None, (_fault(field_name, one) for one in value)), "")
    if not isinstance(value, int | float):
        return ""
    return (
        find_value_fault(field_name, value) if math.isfinite(value) else "must be a finite number"
    )


def _size(value: float | None) -> tuple[bool, str]:
    """Check a standard deviation that may be 0, for an error that does not exist."""
    if value is not None and value < 0:
        return False, "must not be negative"
    fault = find_value_fault("sigma", value) if value else ""
    return not fault, fault


@dataclass(frozen=True, kw_only=True)
class GeodeticOrigin(_Options):
    """Given origin of the world: WGS 84, height above the datum in `heights`."""

    latitude_deg: float
    longitude_deg: float
    height_m: float


@dataclass(frozen=True, kw_only=True)
class WorldOptions:
    """Origin of the world, and the datum of every height_m in the input files."""

    origin: Literal["home"] | GeodeticOrigin = "home"
    heights: HeightDatum = "msl"


@dataclass(frozen=True, kw_only=True)
class AreaOptions(_Options):
    """Options of one named area of the ground; None: as in `GroundOptions`."""

    height_m: float | None = None
    height_sigma_m: float | None = None
    slope_sigma_deg: float | None = None
    roughness_sigma_m: float | None = None

    def _rules(self) -> dict[str, tuple[bool, str]]:
        return _ground_rules(self)


_AREA_KEYS = tuple(field_.name for field_ in fields(AreaOptions))


def _ground_rules(options: AreaOptions | GroundOptions) -> dict[str, tuple[bool, str]]:
    slope, roughness = options.slope_sigma_deg, options.roughness_sigma_m
    rules = {"roughness_sigma_m": _size(roughness)}
    if slope is not None and not 0 < slope < 45:
        rules["slope_sigma_deg"] = False, "must lie between 0 and 45"
    return rules


@dataclass(frozen=True, kw_only=True)
class GroundOptions(_Options):
    """Prior of the ground plane.

    `areas` are further planes, by the names in the column `area` of picks.csv; every area that is
    picked has a plane of its own, whether it is listed here or not.
    """

    height_m: float = 0.0
    height_sigma_m: float = 0.3
    slope_sigma_deg: float = 3.0
    roughness_sigma_m: float = 0.02
    areas: Mapping[str, AreaOptions] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "areas", MappingProxyType(dict(self.areas)))
        super().__post_init__()

    def __getstate__(self) -> dict[str, object]:
        """Return the state for other processes; a MappingProxyType cannot be pickled."""
        return {**vars(self), "areas": dict(self.areas)}

    def __setstate__(self, state: dict[str, object]) -> None:
        """Restore the state returned by `__getstate__`."""
        vars(self).update(state)
        object.__setattr__(self, "areas", MappingProxyType(self.areas))

    def _rules(self) -> dict[str, tuple[bool, str]]:
        fault = f"must not name the area {DEFAULT_AREA!r}: its values stand beside `areas`"
        named = {"", DEFAULT_AREA} & set(self.areas)
        return _ground_rules(self) | {"areas": (not named, fault)}

    def of(self, area: str) -> GroundOptions:
        """Return the options of one area: its own where given, else the general ones."""
        own = self.areas.get(area, AreaOptions())
        stated = {name: getattr(own, name) for name in _AREA_KEYS}
        return replace(self, **{k: v for k, v in stated.items() if v is not None}, areas={})


@dataclass(frozen=True, kw_only=True)
class MountOptions(_Options):
    """Orientation of the camera on the vehicle.

    A given angle replaces that of the gimbal in the log or in the photos' tags. ``auto`` is the
    gimbal's own angle, or straight down with image up at the nose where there is none.
    """

    gimbal: Literal["auto", "none"] = "auto"
    yaw_deg: float | Auto = "auto"
    pitch_deg: float | Auto = "auto"
    roll_deg: float | Auto = "auto"
    boresight_sigma_deg: float = 2.0
    lever_arm_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    lever_arm_sigma_m: float = 0.1

    def angles_deg(self, otherwise: Sequence[float] = (0.0, -90.0, 0.0)) -> tuple[float, ...]:
        """Return yaw, pitch and roll of the optical axis where given, else those of `otherwise`."""
        stated = (self.yaw_deg, self.pitch_deg, self.roll_deg)
        pairs = zip(stated, otherwise, strict=True)
        return tuple(other if angle == "auto" else angle for angle, other in pairs)


@dataclass(frozen=True, kw_only=True)
class TimeOptions(_Options):
    """Source of the times of exposure.

    `drift_sigma_ppm` is the standard deviation of the camera clock's drift against the flight's
    clock, where photos carry the camera's own times. A quartz without temperature compensation is
    rated +-20 ppm between 0 and 50 degrees, more when it ages or leaves that range ("Time
    synchronisation for millisecond-precision on bio-loggers", Movement Ecology 12 (2024), table 1),
    and two of them are compared.
    """

    source: Literal["auto", "exif", "filename", "events"] = "auto"
    filename_format: str = "%Y%m%d_%H%M%S"
    offset_s: float | Auto = "auto"
    offset_sigma_s: float = 1.0
    drift_sigma_ppm: float = 50.0

    def _rules(self) -> dict[str, tuple[bool, str]]:
        fault = 'must be a strptime pattern, such as "%Y%m%d_%H%M%S"'
        return {"filename_format": ("%" in self.filename_format, fault)}


@dataclass(frozen=True, kw_only=True)
class TelemetryOptions(_Options):
    """Assumed accuracy of the flight log.

    Errors of neighbouring frames are correlated over a time between the two of `correlation_s`, but
    the adjustment treats them as independent. The per-frame variances of a survey are therefore
    multiplied by the smallest factor with which the variance of its slowest change is not too small
    (see estimation/survey/observations/telemetry.py): 1 for a few frames, about their number / 2 pi
    for more. Errors common to the whole flight are in the biases.
    """

    position_sigma_m: tuple[float, float] | Auto = "auto"
    attitude_sigma_deg: tuple[float, float] | Auto = "auto"
    position_bias_sigma_m: tuple[float, float] = (2.0, 3.0)
    heading_bias_sigma_deg: float = 2.0
    correlation_s: tuple[float, float] = (5.0, 60.0)

    def _rules(self) -> dict[str, tuple[bool, str]]:
        shorter, longer = self.correlation_s
        fault = "must be two times greater than 0, the shorter one first"
        return {"correlation_s": (0 < shorter <= longer, fault)}


@dataclass(frozen=True, kw_only=True)
class TapeOptions(_Options):
    """Accuracy of the tapes.

    `scale_sigma` is the standard deviation of the scale error common to all lengths of one tape,
    relative to the length; `reading_sigma_m` is the default of the picking page for a new length.
    """

    scale_sigma: float = 0.001
    reading_sigma_m: float = 0.01

    def _rules(self) -> dict[str, tuple[bool, str]]:
        fault = (
            "must lie between 0 (the tapes are exact) and 0.1: it is a share of a length, 0.001 is "
            "1 mm in a metre"
        )
        return {"scale_sigma": (0 <= self.scale_sigma <= 0.1, fault)}


@dataclass(frozen=True, kw_only=True)
class TargetOptions(_Options):
    """Coded plates in the scene.

    Attributes
    ----------
    family
        Printed code: a name of `FAMILIES`, or a ChArUco board in the notation of `uavgram
        calibrate` (``charuco:8x6:300mm:220mm:DICT_5X5_100``), of which there is one.
    side_m
        Side of the black square; a ChArUco board states its own.
    sigma_m
        Standard deviation of that side. It is common to all plates, as they come from one printer
        or one drawing; the variation from side to side is taken as half as large.
    """

    family: str
    side_m: float | None = None
    sigma_m: float = 0.001

    def _rules(self) -> dict[str, tuple[bool, str]]:
        hint = suggest_spelling(self.family, (*FAMILIES, BOARD_PLATE))
        known = (
            f"must be such as aruco-4x4-50, apriltag-36h11 or charuco:...{hint and f' ({hint})'}"
        )
        sides = {
            "side_m": (self.is_board, "is missing: the side of the black square in metres")
            if self.side_m is None
            else (
                not self.is_board and 0 < self.side_m <= LARGEST_PLATE_M,
                f"must be greater than 0 and at most {LARGEST_PLATE_M:g} m; a ChArUco board states "
                "its own",
            ),
        }
        side = self.side_m if self.side_m and self.side_m > 0 else LARGEST_PLATE_M
        return {
            "family": (self.family in FAMILIES or self.is_board, known),
            **sides,
            "sigma_m": (
                0 < self.sigma_m <= 0.1 * side,
                "must be above 0, a tenth of the side at most",
            ),
        }

    @property
    def is_board(self) -> bool:
        """Return whether it is a ChArUco board."""
        return self.family.split(":")[0] == BOARD_PLATE


LEAST_SIGNIFICANCE = 1e-12  # seven sigmas; far smaller values overflow the normal quantile


@dataclass(frozen=True, kw_only=True)
class SolveOptions(_Options):
    """Handling of gross errors, and of sigmas that the residuals contradict.

    `noise`: whether the sigmas of picks and the roughness of the ground are estimated from the
    survey.
    """

    outliers: Literal["report", "remove"] = "report"
    significance: float = 0.001
    noise: Literal["estimate", "stated"] = "estimate"

    def _rules(self) -> dict[str, tuple[bool, str]]:
        least = LEAST_SIGNIFICANCE
        is_tiny = 0 < self.significance < least
        rule = f"must be at least {least:g}" if is_tiny else "must lie between 0 and 0.5"
        return {"significance": (least <= self.significance < 0.5, rule)}


CAMERA_OF_PHOTOS = "auto"
"""Value of `camera` without a file: the camera is assumed from the tags of the photos."""

CAMERA_UNKNOWN = "unknown"
"""Value of `camera` for photos whose tags are insufficient.

An ordinary drone camera is assumed, with standard deviations that cover the range of such cameras.
"""

TIES_FOUND = "auto"
"""Value of `ties` without a file: tie points are found, and kept in `TIES_FILE`."""

TIES_FILE = "ties.csv"
"""Default name of the tie point file, next to the project file."""


@dataclass(frozen=True, kw_only=True)
class Project(_Options):
    """Project file: input files and all options.

    Paths are those of the file, made absolute; `images` are patterns, and `leave_out` names photos
    among them that take no part, nor do their picks. `camera` is ``auto``,
    ``unknown`` or a path; `poses` is ``exif``, a path or several, and replaces `log`. `crs` is the
    projected coordinate system of maps and drawings; ``auto``: the UTM zone. `operator` is the
    person responsible for the survey. `ties` is ``auto`` or a path. `plan` is the plan made before
    the flight. `units` are those of displayed values; files keep metres. `case` is the head of the
    report. `picks_identification_sigma_m` is the standard deviation between picked and intended
    point, the same in all photos.
    """

    name: str
    images: tuple[str, ...]
    camera: str
    picks: str
    log: str | None = None
    poses: str | tuple[str, ...] | None = None
    leave_out: tuple[str, ...] = ()
    lines: str | None = None
    known: str | None = None
    measure: str | None = None
    control: str | None = None
    control_lines: str | None = None
    check: str | None = None
    ties: str | None = None
    plan: str | None = None
    output: str = "out"
    crs: str = "auto"
    operator: str | None = None
    world: WorldOptions = field(default_factory=WorldOptions)
    ground: GroundOptions = field(default_factory=GroundOptions)
    mount: MountOptions = field(default_factory=MountOptions)
    time: TimeOptions = field(default_factory=TimeOptions)
    telemetry: TelemetryOptions = field(default_factory=TelemetryOptions)
    picks_sigma_px: float = 1.0
    picks_identification_sigma_m: float = 0.01
    solve: SolveOptions = field(default_factory=SolveOptions)
    tape: TapeOptions = field(default_factory=TapeOptions)
    targets: TargetOptions | None = None
    units: Units = field(default_factory=Units)
    case: Case = field(default_factory=Case)

    def _rules(self) -> dict[str, tuple[bool, str]]:
        texts = [
            "log",
            "lines",
            "known",
            "measure",
            "control",
            "control_lines",
            "check",
            "ties",
            "plan",
            "name",
            "camera",
            "picks",
            "output",
            "crs",
            "operator",
        ]
        named = bool(self.images) and all(self.images)
        return {
            **{key: (getattr(self, key) != "", "must not be empty") for key in texts},
            **self._pose_rules(),
            "images": (named, "must name at least one file or pattern"),
            "leave_out": (all(self.leave_out), "must not be empty"),
            "picks_identification_sigma_m": _size(self.picks_identification_sigma_m),
        }

    @property
    def camera_file(self) -> str | None:
        """Path of the camera file; None where the camera is assumed."""
        return None if self.camera in (CAMERA_OF_PHOTOS, CAMERA_UNKNOWN) else self.camera

    @property
    def pose_sources(self) -> tuple[str, ...]:
        """Every source of poses, in the order of the file: ``exif``, or paths."""
        if self.poses is None:
            return ()
        return (self.poses,) if isinstance(self.poses, str) else self.poses

    def _pose_rules(self) -> dict[str, tuple[bool, str]]:
        if self.poses is None:
            return {}
        if self.log is not None:
            return {
                "poses": (False, "cannot be used together with `log`: leave one of the two out")
            }
        sources = self.pose_sources
        if not sources or "" in sources:
            return {"poses": (False, "must not be empty")}
        return {"poses": (len(set(sources)) == len(sources), "must name each source once")}


def option_pairs(options: object, prefix: str = "") -> tuple[tuple[str, object], ...]:
    """List every option as a pair of dotted key and value, for `Provenance.options`.

    Parameters
    ----------
    options
        A `Project`, any options class, or a mapping of names to them.
    prefix
        Key of `options` within its owner.

    Returns
    -------
    tuple of (str, object)
        Such as ``("mount.pitch_deg", -90.0)``, in the order of the classes; values are text,
        numbers, None, or tuples of these.
    """
    pairs: list[tuple[str, object]] = []
    named = (
        options.items()
        if isinstance(options, Mapping)
        else [(field_.name, getattr(options, field_.name)) for field_ in fields(options)]  # type: ignore[arg-type]  # options are dataclasses
    )
    for name, value in named:
        key = f"{prefix}{name}"
        nested = is_dataclass(value) or isinstance(value, Mapping)
        pairs += option_pairs(value, f"{key}.") if nested else [(key, value)]
    return tuple(pairs)
