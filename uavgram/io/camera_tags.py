"""What photos say of their camera: EXIF, and the maker's calibration in XMP."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from uavgram.errors import InputError
from uavgram.io.exif_tags import read_exif_tags
from uavgram.io.image_size import image_size
from uavgram.io.xmp import DJI, XmpTags, read_xmp
from uavgram.model.camera_tags import CameraTags

_BROWN, _RATIONAL = 9, 12
# Largest denominators of rational numbers that still tell how a focal length was rounded.
_TELLING_DENOMINATOR = 1000


def read_camera_tags(path: str | Path) -> CameraTags:
    """Read what a photo says of its camera.

    Raises
    ------
    InputError
        The photo cannot be read, or the maker's calibration in it is none.
    """
    exif, xmp = read_exif_tags(path), read_xmp(path)
    width, height = image_size(path)
    focal, step = _focal(exif)
    return CameraTags(
        path=str(path),
        width_px=width,
        height_px=height,
        make=_text(exif, "Image Make"),
        model=_text(exif, "Image Model"),
        serial=_text(exif, "EXIF BodySerialNumber") or xmp.get((DJI, "CameraSerialNumber"), ""),
        focal_mm=focal,
        focal_step_mm=step,
        focal_35mm_mm=_positive(exif, "EXIF FocalLengthIn35mmFilm"),
        focus_m=_positive(exif, "EXIF SubjectDistance"),
        digital_zoom=max(1.0, _positive(exif, "EXIF DigitalZoomRatio", otherwise=1.0)),
        dewarp=_dewarp(path, xmp),
        dewarped=xmp.get((DJI, "DewarpFlag"), "0").strip() == "1",
    )


def read_all_camera_tags(paths: Iterable[str]) -> tuple[CameraTags, ...]:
    """Read the tags of many photos side by side: most of it is waiting for the disk."""
    with ThreadPoolExecutor() as pool:
        return tuple(pool.map(read_camera_tags, paths))


def _text(exif: Mapping[str, Any], key: str) -> str:
    return str(exif.get(key, "")).strip("\0 ")


def _ratio(exif: Mapping[str, Any], key: str) -> tuple[float, float] | None:
    """Numerator and denominator of a number in EXIF; None where there is none."""
    tag = exif.get(key)
    if tag is None or not tag.values:
        return None
    value = tag.values[0]  # a ratio, a whole number, or a letter where the tag is broken
    try:
        return float(getattr(value, "num", value)), float(getattr(value, "den", 1))
    except ValueError:
        return None


def _positive(exif: Mapping[str, Any], key: str, otherwise: float = math.nan) -> float:
    """A number in EXIF; 0, 0/0 and infinity stand for "unknown" (CIPA DC-008)."""
    ratio = _ratio(exif, key)
    if ratio is None or not min(ratio) > 0:
        return otherwise
    value = ratio[0] / ratio[1]
    return value if ratio[0] < 2**32 - 1 else otherwise


def _focal(exif: Mapping[str, Any]) -> tuple[float, float]:
    """Focal length and the step that it is rounded to [mm]."""
    ratio = _ratio(exif, "EXIF FocalLength")
    focal = _positive(exif, "EXIF FocalLength")
    if ratio is None or math.isnan(focal) or ratio[1] > _TELLING_DENOMINATOR:
        return focal, 0.0
    return focal, 1.0 / ratio[1]


def _dewarp(path: str | Path, xmp: XmpTags) -> tuple[float, ...]:
    """DJI's own calibration of this lens: ``date;fx,fy,cx,cy,k1,k2,p1,p2,k3``, without the date.

    After the user manuals of Mavic 3M and Matrice 4 (pages 90, 91), which name the order.
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
