"""EXIF tags of a photo, without decoding it."""

from __future__ import annotations

import logging
import math
import struct
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO, cast

import exifread

from uavgram.errors import InputError, no_file

# exifread trusts counts and offsets, and ends in these where a block is corrupt.
_WHAT_EXIFREAD_RAISES = (
    *(AttributeError, IndexError, KeyError, OverflowError, TypeError, ValueError),
    *(struct.error, ZeroDivisionError),
)
MOST_BYTES, MOST_READS = 64_000_000, 1_000_000
"""Of a photo's tags: a camera's are some 100 kB. What asks for more is damaged, or an attack."""

_here = threading.local()


def read_exif_tags(path: str | Path) -> dict[str, Any]:
    """Read a photo's EXIF tags by exifread's names; none where the photo has no EXIF.

    Raises
    ------
    InputError
        The file cannot be read, or its EXIF is broken.
    """
    if what := no_file(path):
        raise InputError(path, f"is {what}: take it out of `images`")
    _here.is_reading = True
    try:
        with Path(path).open("rb") as file:
            metered = cast("BinaryIO", _Metered(file))
            return dict(exifread.process_file(metered, details=False, extract_thumbnail=False))
    except OSError as fault:
        raise InputError(path, f"cannot be read: {fault.strerror}") from fault
    except _WHAT_EXIFREAD_RAISES as fault:
        raise InputError(
            path, f"its EXIF is broken ({fault}): leave this photo out, or copy it anew"
        ) from fault
    finally:
        _here.is_reading = False


class _Metered:
    """A file of which only so much can be asked: a tag may state any length up to 4 GB."""

    def __init__(self, file: BinaryIO) -> None:
        self.seek, self.tell = file.seek, file.tell
        self._read = file.read
        self._bytes, self._reads = MOST_BYTES, MOST_READS

    def read(self, size: int) -> bytes:
        self._bytes -= size
        self._reads -= 1
        if self._bytes < 0:
            raise ValueError(f"a tag asks for {size:,} bytes")
        if self._reads < 0:
            raise ValueError("its tags have no end")
        return self._read(size)


def _is_not_ours(_: logging.LogRecord) -> bool:
    return not getattr(_here, "is_reading", False)


# It reports what a photo lacks, once a photo; who uses the library beside us keeps its messages.
logging.getLogger("exifread").addFilter(_is_not_ours)


def exif_text(tags: Mapping[str, Any], *names: str) -> str:
    """Text of the first of these tags that is there; empty where none is."""
    return str(next((tags[name] for name in names if name in tags), "")).strip("\0 ")


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
