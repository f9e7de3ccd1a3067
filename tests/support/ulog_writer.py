"""A small writer of PX4's ULog, after https://docs.px4.io/main/en/dev_log/ulog_file_format.html."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

Row = Sequence[Any]
Topic = tuple[Sequence[str], Sequence[Row]]
"""Fields, and rows of their values."""

_CODES = {
    "uint64_t": "Q", "int64_t": "q", "uint32_t": "I", "int32_t": "i", "uint16_t": "H",
    "int16_t": "h", "uint8_t": "B", "int8_t": "b", "bool": "?", "float": "f", "double": "d",
}  # fmt: skip
SYNC = b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"


def message(kind: str, body: bytes) -> bytes:
    return struct.pack("<HB", len(body), ord(kind)) + body


def ulog(
    topics: Mapping[str, Topic],
    info: Mapping[str, str | int] | None = None,
    parameters: Mapping[str, int] | None = None,
    start_us: int = 1_000_000,
) -> bytes:
    """Bytes of a ULog.

    topics
        Name: (fields, rows); fields such as ``"uint64_t timestamp"`` or ``"float[4] q"``, rows of
        values in their order, an array's elements as one sequence. The rows of all topics are
        written in the order of their first field, the time.
    """
    data = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", start_us), message("B", bytes(40))]
    for key, value in (info or {"sys_name": "PX4"}).items():
        if isinstance(value, str):
            raw, kind = value.encode(), f"char[{len(value)}]"
        else:
            raw, kind = struct.pack("<I", value), "uint32_t"
        text = f"{kind} {key}".encode()
        data.append(message("I", bytes([len(text)]) + text + raw))
    for name, (fields, _) in topics.items():
        data.append(message("F", f"{name}:{';'.join(fields)};".encode()))
    for key, value in (parameters or {}).items():
        text = f"int32_t {key}".encode()
        data.append(message("P", bytes([len(text)]) + text + struct.pack("<i", value)))
    timed = []
    for number, (name, (fields, rows)) in enumerate(topics.items()):
        data.append(message("A", struct.pack("<BH", 0, number) + name.encode()))
        for row in rows:
            body = b"".join(_packed(f, v) for f, v in zip(fields, row, strict=True))
            timed.append((row[0], message("D", struct.pack("<H", number) + body)))
    timed.sort(key=lambda item: item[0])
    for k, (_, body) in enumerate(timed):
        if k % 50 == 0:
            data.append(message("S", SYNC))
        data.append(body)
    return b"".join(data)


def _packed(field: str, value: Any) -> bytes:  # noqa: ANN401 - what struct packs
    kind = field.split(" ", maxsplit=1)[0]
    if "[" in kind:
        code = _CODES[kind.split("[")[0]]
        return struct.pack(f"<{len(value)}{code}", *value)
    return struct.pack("<" + _CODES[kind], value)


POSITION = (
    "uint64_t timestamp", "double lat", "double lon", "float alt", "float eph", "float epv",
)  # fmt: skip
ATTITUDE = ("uint64_t timestamp", "float[4] q")
GPS_OLD = (
    "uint64_t timestamp", "uint64_t time_utc_usec", "int32_t lat", "int32_t lon", "int32_t alt",
    "int32_t alt_ellipsoid", "float eph", "float epv", "int32_t timestamp_time_relative",
    "uint8_t fix_type",
)  # fmt: skip
GPS_NEW = (
    "uint64_t timestamp", "uint64_t time_utc_usec", "double latitude_deg", "double longitude_deg",
    "double altitude_msl_m", "double altitude_ellipsoid_m", "float eph", "float epv",
    "int32_t timestamp_time_relative", "uint8_t fix_type",
)  # fmt: skip
CAPTURE = (
    "uint64_t timestamp", "uint64_t timestamp_utc", "uint32_t seq", "double lat", "double lon",
    "float alt", "float[4] q", "int8_t result",
)  # fmt: skip
TRIGGER = ("uint64_t timestamp", "uint64_t timestamp_utc", "uint32_t seq", "bool feedback")
HOME = (
    "uint64_t timestamp", "double lat", "double lon", "float alt", "bool valid_alt",
    "bool valid_hpos",
)  # fmt: skip
GIMBAL = ("uint64_t timestamp", "float[4] q", "uint16_t device_flags")
MOUNT = ("uint64_t timestamp", "float[3] attitude_euler_angle")

UTC_S = 1_700_000_000.0
LATITUDE, LONGITUDE, HEIGHT_M, UNDULATION_M = 47.3977, 8.5456, 500.0, 47.5
QUARTER = np.sqrt(0.5)


def us(time_s: float) -> int:
    return round(time_s * 1e6)


def flight(seconds: float = 20.0, start_s: float = 10.0, gps: str = "old") -> dict[str, Topic]:
    """Topics of a straight flight north at 5 m/s, 90 degrees of yaw."""
    times = [start_s + k / 10 for k in range(int(seconds * 10))]
    north_deg = [5.0 * (t - start_s) / 111e3 for t in times]
    fixes: list[Row] = []
    for t, north in list(zip(times, north_deg, strict=True))[::2]:
        utc = us(UTC_S + t)
        if gps == "old":
            fixes.append(
                (
                    us(t), utc, round((LATITUDE + north) * 1e7), round(LONGITUDE * 1e7),
                    round(HEIGHT_M * 1e3), round((HEIGHT_M + UNDULATION_M) * 1e3), 0.8, 1.2, 0, 3,
                )
            )  # fmt: skip
        else:
            fixes.append(
                (
                    us(t), utc, LATITUDE + north, LONGITUDE, HEIGHT_M, HEIGHT_M + UNDULATION_M,
                    0.8, 1.2, 0, 3,
                )
            )  # fmt: skip
    place = list(zip(times, north_deg, strict=True))
    return {
        "vehicle_global_position": (
            POSITION,
            [(us(t), LATITUDE + n, LONGITUDE, HEIGHT_M, 0.5, 0.7) for t, n in place],
        ),
        "vehicle_attitude": (ATTITUDE, [(us(t), (QUARTER, 0.0, 0.0, QUARTER)) for t in times]),
        "vehicle_gps_position": (GPS_OLD if gps == "old" else GPS_NEW, fixes),
        "home_position": (
            HOME,
            [(us(start_s), LATITUDE, LONGITUDE, HEIGHT_M - 60, True, True)],
        ),
    }


def capture(time_s: float, number: int, result: int = 1) -> Row:
    q = (1.0, 0.0, 0.0, 0.0)
    return us(time_s), us(UTC_S + time_s), number, LATITUDE, LONGITUDE, HEIGHT_M, q, result
