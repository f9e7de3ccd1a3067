"""Writing of a place into the EXIF of a JPEG; all other tags keep their offsets.

TIFF 6.0 directories may be anywhere in the block: the new first directory and the new GPS directory
are appended to the existing block, so no offset of another tag changes.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

BYTE, ASCII, LONG, RATIONAL = 1, 2, 4, 5
GPS_IFD = 0x8825
# CIPA DC-008, table of GPS attributes
VERSION, LATITUDE_REF, LATITUDE, LONGITUDE_REF, LONGITUDE = 0, 1, 2, 3, 4
ALTITUDE_REF, ALTITUDE, MAP_DATUM, POSITIONING_ERROR = 5, 6, 0x12, 0x1F
_EMPTY = b"II\x2a\x00\x08\x00\x00\x00\x00\x00\x00\x00\x00\x00"  # a directory without entries
_SECOND_STEPS = 10_000_000  # 1e-7 arc seconds: 3 micrometres

Entries = dict[int, bytes]  # tag -> its 12 bytes


class TiffError(ValueError):
    """EXIF block that does not conform to TIFF 6.0."""


@dataclass(frozen=True, kw_only=True)
class ExifGps:
    """Place to write: WGS 84 degrees, height and horizontal standard deviation in metres."""

    latitude_deg: float
    longitude_deg: float
    height_m: float
    sigma_horizontal_m: float


def with_gps(tiff: bytes | None, gps: ExifGps) -> bytes:
    """Set the GPS tags of an EXIF block (without its ``Exif`` head); None starts a new one.

    Time and other GPS tags that exist already stay.

    Raises
    ------
    TiffError
        The block cannot be read.
    """
    block = bytearray(_EMPTY if tiff is None else tiff)
    order = {b"II": "<", b"MM": ">"}.get(bytes(block[:2]))
    if order is None or len(block) < 8:
        raise TiffError("its EXIF has no TIFF header")
    try:
        (first,) = struct.unpack_from(f"{order}I", block, 4)
        main, following = _read_directory(block, order, first)
        old = main.get(GPS_IFD)
        gps_entries: Entries = {}
        if old is not None:
            gps_entries, _ = _read_directory(block, order, struct.unpack(f"{order}I", old[8:])[0])
    except struct.error as fault:
        raise TiffError("its EXIF is cut short") from fault
    for tag, kind, count, value in _gps_values(order, gps):
        gps_entries[tag] = _entry(block, order, tag, kind, (count, value))
    gps_at = _append(block, _directory(order, gps_entries, 0))
    main[GPS_IFD] = struct.pack(f"{order}HHII", GPS_IFD, LONG, 1, gps_at)
    struct.pack_into(f"{order}I", block, 4, _append(block, _directory(order, main, following)))
    return bytes(block)


def _read_directory(block: bytearray, order: str, at: int) -> tuple[Entries, int]:
    (count,) = struct.unpack_from(f"{order}H", block, at)
    (following,) = struct.unpack_from(f"{order}I", block, at + 2 + 12 * count)
    raw = (bytes(block[at + 2 + 12 * k : at + 14 + 12 * k]) for k in range(count))
    return {struct.unpack_from(f"{order}H", entry)[0]: entry for entry in raw}, following


def _directory(order: str, entries: Entries, following: int) -> bytes:
    table = b"".join(entries[tag] for tag in sorted(entries))  # ascending, as TIFF 6.0 demands
    return struct.pack(f"{order}H", len(entries)) + table + struct.pack(f"{order}I", following)


def _entry(block: bytearray, order: str, tag: int, kind: int, content: tuple[int, bytes]) -> bytes:
    count, value = content
    if len(value) > 4:
        value = struct.pack(f"{order}I", _append(block, value))
    return struct.pack(f"{order}HHI", tag, kind, count) + value.ljust(4, b"\x00")


def _append(block: bytearray, data: bytes) -> int:
    """Append data to the block at an even offset; return the offset."""
    block.extend(b"\x00" * (len(block) % 2))
    at = len(block)
    block.extend(data)
    return at


def _gps_values(order: str, gps: ExifGps) -> list[tuple[int, int, int, bytes]]:
    """List tag, type, count and value of each GPS tag."""
    millimetres = round(abs(gps.height_m) * 1000)
    error = max(round(gps.sigma_horizontal_m * 1000), 1)
    south, west = gps.latitude_deg < 0, gps.longitude_deg < 0
    return [
        (VERSION, BYTE, 4, b"\x02\x03\x00\x00"),
        (LATITUDE_REF, ASCII, 2, b"S\x00" if south else b"N\x00"),
        (LATITUDE, RATIONAL, 3, _sexagesimal(order, gps.latitude_deg)),
        (LONGITUDE_REF, ASCII, 2, b"W\x00" if west else b"E\x00"),
        (LONGITUDE, RATIONAL, 3, _sexagesimal(order, gps.longitude_deg)),
        (ALTITUDE_REF, BYTE, 1, b"\x01" if gps.height_m < 0 else b"\x00"),
        (ALTITUDE, RATIONAL, 1, struct.pack(f"{order}2I", millimetres, 1000)),
        (MAP_DATUM, ASCII, 7, b"WGS-84\x00"),
        (POSITIONING_ERROR, RATIONAL, 1, struct.pack(f"{order}2I", error, 1000)),
    ]


def _sexagesimal(order: str, degrees: float) -> bytes:
    """Encode whole degrees, whole minutes and seconds, rounded once, so that none overflows."""
    steps = round(abs(degrees) * 3600 * _SECOND_STEPS)
    minutes, seconds = divmod(steps, 60 * _SECOND_STEPS)
    return struct.pack(f"{order}6I", minutes // 60, 1, minutes % 60, 1, seconds, _SECOND_STEPS)
