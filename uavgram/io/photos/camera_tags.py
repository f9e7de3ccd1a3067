"""Camera tags of photos: EXIF, and the maker's calibration in XMP."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from uavgram.errors import InputError
from uavgram.io.photos.metadata import (
    DJI,
    XmpTags,
    exif_numbers,
    exif_text,
    read_exif_tags,
    read_image_size,
    read_xmp,
)
from uavgram.model.camera.tags import CameraTags

_BROWN, _RATIONAL = 9, 12
# Largest denominator of a rational number that still shows how a focal length was rounded.
_TELLING_DENOMINATOR = 1000
_INFINITE = 2**32 - 1  # as a numerator
_UNITS_MM = {2.0: 25.4, 3.0: 10.0, 4.0: 1.0, 5.0: 0.001}  # CIPA DC-008 has the first two


def read_camera_tags(path: str | Path) -> CameraTags:
    """Read the camera tags of a photo.

    Raises
    ------
    InputError
        The photo cannot be read, or the maker's calibration in it is invalid.
    """
    exif, xmp = read_exif_tags(path), read_xmp(path)
    width, height = read_image_size(path)
    focal, step = _focal(exif)
    return CameraTags(
        path=str(path),
        width_px=width,
        height_px=height,
        make=exif_text(exif, "Image Make"),
        model=exif_text(exif, "Image Model"),
        serial=exif_text(exif, "EXIF BodySerialNumber") or xmp.get((DJI, "CameraSerialNumber"), ""),
        focal_mm=focal,
        focal_step_mm=step,
        focal_35mm_mm=_positive(exif, "EXIF FocalLengthIn35mmFilm"),
        focal_plane_per_mm=_focal_plane(exif),
        original_px=(
            _positive(exif, "EXIF ExifImageWidth"),
            _positive(exif, "EXIF ExifImageLength"),
        ),
        focus_m=_positive(exif, "EXIF SubjectDistance"),
        digital_zoom=max(1.0, _positive(exif, "EXIF DigitalZoomRatio", otherwise=1.0)),
        dewarp=_dewarp(path, xmp),
        dewarped=xmp.get((DJI, "DewarpFlag"), "0").strip() == "1",
    )


def read_all_camera_tags(paths: Iterable[str]) -> tuple[CameraTags, ...]:
    """Read the tags of many photos in parallel, as most of the time is spent on disk access."""
    with ThreadPoolExecutor() as pool:
        return tuple(pool.map(read_camera_tags, paths))


def _positive(exif: Mapping[str, Any], key: str, otherwise: float = math.nan) -> float:
    """Read a number in EXIF; 0, 0/0 and infinity mean "unknown" (CIPA DC-008)."""
    tag = exif.get(key)
    numbers = exif_numbers(tag)
    if tag is None or len(numbers) != 1 or numbers[0] <= 0:
        return otherwise
    return numbers[0] if getattr(tag.values[0], "num", numbers[0]) < _INFINITE else otherwise


def _focal(exif: Mapping[str, Any]) -> tuple[float, float]:
    """Read the focal length and its rounding step [mm]."""
    focal = _positive(exif, "EXIF FocalLength")
    if math.isnan(focal):
        return focal, 0.0
    value = exif["EXIF FocalLength"].values[0]
    denominator = getattr(value, "den", None)
    if denominator is None:  # a float: use its number of digits
        denominator = 10 ** len(f"{focal:.6f}".rstrip("0").partition(".")[2])
    return focal, 0.0 if denominator > _TELLING_DENOMINATOR else 1.0 / denominator


def _focal_plane(exif: Mapping[str, Any]) -> tuple[float, float]:
    """Read pixels per mm on the sensor, across and down; inches where no unit is stated."""
    unit = exif_numbers(exif.get("EXIF FocalPlaneResolutionUnit")) or [2.0]
    unit_mm = _UNITS_MM.get(unit[0], math.nan)
    across, down = (_positive(exif, f"EXIF FocalPlane{axis}Resolution") for axis in "XY")
    return across / unit_mm, (across if math.isnan(down) else down) / unit_mm


def _dewarp(path: str | Path, xmp: XmpTags) -> tuple[float, ...]:
    """Read DJI's own calibration of the lens, without its date.

    The tag is ``date;fx,fy,cx,cy,k1,k2,p1,p2,k3``, after the user manuals of Mavic 3M and Matrice 4
    (pages 90, 91), which name the order.
    """
    for name, count in (("DewarpDataK6", _RATIONAL), ("DewarpData", _BROWN)):
        text = xmp.get((DJI, name), "").strip()
        if not text:
            continue
        fields = re.split(r"[,\s]+", text.rpartition(";")[2].strip())
        try:
            numbers = tuple(float(field) for field in fields if field)
        except ValueError:
            numbers = ()
        if len(numbers) != count or not all(map(math.isfinite, numbers)):
            raise InputError(
                path, f"its tag {name} is no calibration (expected {count} numbers): {text!r}"
            )
        if not any(numbers):
            continue  # written by cameras that were never calibrated
        if min(numbers[:2]) <= 0:
            raise InputError(path, f"its tag {name} has no positive focal lengths: {text!r}")
        return numbers
    return ()
