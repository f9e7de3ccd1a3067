"""Put capture time and camera into a JPEG: the EXIF segment of CIPA DC-008 (Exif 2.32)."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, timezone

ASCII, LONG, UNDEFINED = 2, 4, 7
# Tags, CIPA DC-008 section 4.6
MAKE, MODEL, DATE_TIME, EXIF_IFD = 0x010F, 0x0110, 0x0132, 0x8769
EXIF_VERSION, DATE_TIME_ORIGINAL, OFFSET_TIME_ORIGINAL = 0x9000, 0x9003, 0x9011
SUB_SEC_TIME_ORIGINAL = 0x9291

SOI, APP1 = b"\xff\xd8", b"\xff\xe1"
TIFF_HEADER = b"MM\x00\x2a\x00\x00\x00\x08"  # big-endian, first directory at byte 8

Entry = tuple[int, int, bytes]  # tag, type, value


@dataclass(frozen=True, kw_only=True)
class CaptureTags:
    """What a camera says of an exposure.

    Attributes
    ----------
    time_utc_s
        The camera clock's reading with its zone taken off, seconds since the Unix epoch; written
        to the millisecond.
    zone_h
        The zone it is set to, hours east of Greenwich.
    make, model
        ASCII names of the camera.
    """

    time_utc_s: float
    zone_h: float
    make: str
    model: str


def with_exif(jpeg: bytes, tags: CaptureTags) -> bytes:
    """Insert an EXIF segment behind the JPEG's start marker.

    Parameters
    ----------
    jpeg
        A JPEG file without EXIF.
    tags
        What to say in it.

    Raises
    ------
    ValueError
        `jpeg` is none.
    """
    if not jpeg.startswith(SOI):
        raise ValueError("not a JPEG: it does not start with FF D8")
    payload = b"Exif\x00\x00" + _tiff(tags)
    return SOI + APP1 + struct.pack(">H", len(payload) + 2) + payload + jpeg[len(SOI) :]


def _tiff(tags: CaptureTags) -> bytes:
    time = datetime.fromtimestamp(0, UTC) + timedelta(milliseconds=round(tags.time_utc_s * 1e3))
    time = time.astimezone(timezone(timedelta(hours=tags.zone_h)))
    stamp = _ascii(f"{time:%Y:%m:%d %H:%M:%S}")
    zone = f"{time:%z}"
    exif: list[Entry] = [
        (EXIF_VERSION, UNDEFINED, b"0232"),
        (DATE_TIME_ORIGINAL, ASCII, stamp),
        (OFFSET_TIME_ORIGINAL, ASCII, _ascii(f"{zone[:3]}:{zone[3:5]}")),
        (SUB_SEC_TIME_ORIGINAL, ASCII, _ascii(f"{time.microsecond // 1000:03d}")),
    ]
    main: list[Entry] = [
        (MAKE, ASCII, _ascii(tags.make)),
        (MODEL, ASCII, _ascii(tags.model)),
        (DATE_TIME, ASCII, stamp),
        (EXIF_IFD, LONG, struct.pack(">I", 0)),
    ]
    # The size of a directory does not depend on the pointer's value: measure, then point.
    exif_at = len(TIFF_HEADER) + len(_directory(main, len(TIFF_HEADER)))
    main[-1] = (EXIF_IFD, LONG, struct.pack(">I", exif_at))
    return TIFF_HEADER + _directory(main, len(TIFF_HEADER)) + _directory(exif, exif_at)


def _directory(entries: list[Entry], start: int) -> bytes:
    """One image file directory at byte `start`, with the values that do not fit behind it."""
    values_at = start + 2 + 12 * len(entries) + 4
    table, values = struct.pack(">H", len(entries)), b""
    for tag, kind, value in entries:  # ascending tags, as TIFF 6.0 demands
        count = len(value) // (4 if kind == LONG else 1)
        if len(value) <= 4:
            field = value.ljust(4, b"\x00")
        else:
            field = struct.pack(">I", values_at + len(values))
            values += value + b"\x00" * (len(value) % 2)  # offsets are even
        table += struct.pack(">HHI", tag, kind, count) + field
    return table + struct.pack(">I", 0) + values


def _ascii(text: str) -> bytes:
    return text.encode("ascii") + b"\x00"
