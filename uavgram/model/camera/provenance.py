"""Where a camera file comes from: what made it, from which photos, how."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from uavgram.model.provenance import InputDigest

OptionValue = bool | int | float | str


@dataclass(frozen=True, kw_only=True)
class CameraProvenance:
    """Chain of custody of a calibration.

    Attributes
    ----------
    program, version
        What wrote the file.
    created_utc
        ISO 8601.
    source
        In words: calibrated from photos, converted, scaled.
    inputs
        The files that it was made of: photos, or an earlier camera file.
    board
        The target, in words; empty where there was none.
    options
        By name; read-only.
    variance_factor
        Of the adjustment; None where there was none.
    make, camera_model, focal_mm, focus_m
        EXIF of the photos, where known.
    """

    program: str
    version: str
    created_utc: str
    source: str
    inputs: tuple[InputDigest, ...] = ()
    board: str = ""
    options: Mapping[str, OptionValue] = field(default_factory=dict)
    variance_factor: float | None = None
    make: str = ""
    camera_model: str = ""
    focal_mm: float | None = None
    focus_m: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "options", MappingProxyType(dict(self.options)))
