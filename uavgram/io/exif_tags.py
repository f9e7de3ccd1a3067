"""EXIF tags of a photo, without decoding it."""

from __future__ import annotations

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
