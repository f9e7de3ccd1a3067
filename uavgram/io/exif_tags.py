"""EXIF tags of a photo, without decoding it."""

from __future__ import annotations

import math
import struct
from pathlib import Path
from typing import Any

import exifread

from uavgram.errors import InputError

# exifread trusts counts and offsets, and ends in these where a block is corrupt.
_WHAT_EXIFREAD_RAISES = (
    *(AttributeError, IndexError, KeyError, OverflowError, TypeError, ValueError),
    *(struct.error, ZeroDivisionError),
)


def read_exif_tags(path: str | Path) -> dict[str, Any]:
    """Read a photo's EXIF tags by exifread's names; none where the photo has no EXIF.

    Raises
    ------
    InputError
        The file cannot be read, or its EXIF is broken.
    """
    try:
        with Path(path).open("rb") as file:
            return dict(exifread.process_file(file, details=False, extract_thumbnail=False))
    except OSError as fault:
        raise InputError(path, f"cannot be read: {fault.strerror}") from fault
    except _WHAT_EXIFREAD_RAISES as fault:
        raise InputError(
            path, f"its EXIF is broken ({fault}): leave this photo out, or copy it anew"
        ) from fault


def exif_numbers(tag: Any) -> list[float]:  # noqa: ANN401 - exifread has no types
    """Numbers of a tag of any of EXIF's types; none where one of them is no finite number.

    exifread hands on whole numbers, ratios (also 0/0, which stands for "unknown"), each float and
    double as a tuple of one, and text as it stands.
    """
    values = getattr(tag, "values", [])
    if isinstance(values, str):
        values = values.strip("\0 ").split()
    try:
        numbers = [float(value[0] if isinstance(value, tuple) else value) for value in values]
    except (IndexError, OverflowError, TypeError, ValueError, ZeroDivisionError):
        return []
    return numbers if all(map(math.isfinite, numbers)) else []
