"""MAVLink telemetry logs as columns: a checked scan of frames, decoded by numpy.

A .tlog is a row of records: 8 bytes of time (big-endian microseconds since 1970 on the receiver's
clock; some programs keep a link number in the lowest two bits) and one MAVLink frame, version 1
(0xFE) or 2 (0xFD). Frame layout and checksum: https://mavlink.io/en/guide/serialization.html.
Message definitions are pymavlink's (dialect "all").
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import all as dialect

from uavgram.model.arrays import Bools, Ints

Columns = dict[str, NDArray[Any]]

_V1, _V2 = 0xFE, 0xFD
# A record can begin here: a time before the year 2106 and a start-of-frame byte.
_RECORD = re.compile(rb"\x00[\x00-\x0f].{6}[\xfe\xfd]", re.DOTALL)


@dataclass(frozen=True, eq=False)
class FrameTable:
    """N frames with a correct checksum, in the order of the file.

    Attributes
    ----------
    data
        The bytes of the file.
    start
        (N,) offset of the frame's first byte.
    message_id, system, component
        (N,).
    payload_start, payload_length
        (N,) where the payload lies.
    receive_s
        (N,) the receiver's clock, seconds since 1970.
    skipped_bytes, bad_checksum
        What of the file is no frame; how many frames failed their checksum.
    unknown
        Frames of messages that no dialect here defines (their checksum cannot be tested).
    """

    data: NDArray[np.uint8]
    start: Ints
    message_id: Ints
    system: Ints
    component: Ints
    payload_start: Ints
    payload_length: Ints
    receive_s: NDArray[np.float64]
    skipped_bytes: int
    bad_checksum: int
    unknown: int

    def rows(self, name: str, mask: Bools | None = None) -> Ints:
        """(K,) rows of one message type, of those that the mask admits."""
        found = self.message_id == message_number(name)
        return np.flatnonzero(found if mask is None else found & mask).astype(np.int64)

    def columns(self, name: str, rows: Ints) -> Columns:
        """Every field of one message type as a column; what was trimmed or absent is zero."""
        dtype = _message_dtype(name)
        size = dtype.itemsize
        at = np.arange(size)
        where = self.payload_start[rows, None] + at
        inside = at < self.payload_length[rows, None]
        body = np.where(inside, self.data[np.minimum(where, len(self.data) - 1)], 0)
        records = np.ascontiguousarray(body.astype(np.uint8)).view(dtype)
        return {field: records[field][:, 0] for field in dtype.names or ()}


def message_number(name: str) -> int:
    """Number of a message, -1 where the dialect has none of this name."""
    return _numbers_by_name().get(name, -1)


def message_name(number: int) -> str:
    """Name of a message."""
    known = dialect.mavlink_map.get(number)
    return str(known.msgname) if known is not None else f"UNKNOWN_{number}"


@cache
def _numbers_by_name() -> dict[str, int]:
    return {str(known.msgname): int(number) for number, known in dialect.mavlink_map.items()}


def _message_dtype(name: str) -> np.dtype[Any]:
    message = dialect.mavlink_map[message_number(name)]
    kinds = {"c": "S1", "b": "<i1", "B": "<u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4"}
    kinds |= {"q": "<i8", "Q": "<u8", "f": "<f4", "d": "<f8"}
    codes = re.findall(r"(\d*)([a-zA-Z])", message.unpacker.format)
    fields = []
    for field, (length, code) in zip(message.ordered_fieldnames, codes, strict=True):
        if code == "s":
            fields.append((field, f"S{length}"))
        else:
            fields.append((field, f"({length},){kinds[code]}" if length else kinds[code]))
    return np.dtype(fields)


def scan_frames(data: bytes) -> FrameTable:
    """Find every frame of a telemetry log and test its checksum.

    Frames of unknown messages are skipped by their length. After damaged bytes the scan goes on
    at the next place that looks like a record.
    """
    starts, skipped = _walk(data)
    array = np.frombuffer(data, dtype=np.uint8)
    start = np.array(starts, dtype=np.int64)
    second = array[start] == _V2
    length = array[start + 1].astype(np.int64)
    head = np.where(second, 10, 6)
    number = np.where(second, _number_at(array, start + 7), _byte_at(array, start + 5))
    extra = np.array([_checksum_extra(n) for n in number.tolist()], dtype=np.int64)
    expected = checksums(array, start + 1, head - 1 + length, extra)
    written = array[start + head + length].astype(np.int64) | (
        array[start + head + length + 1].astype(np.int64) << 8
    )
    known = extra >= 0
    good = known & (expected == written)
    receive = [int.from_bytes(data[s - 8 : s], "big") * 1e-6 for s in starts]
    return FrameTable(
        data=array,
        start=start[good],
        message_id=number[good],
        system=np.where(second, _byte_at(array, start + 5), _byte_at(array, start + 3))[good],
        component=np.where(second, _byte_at(array, start + 6), _byte_at(array, start + 4))[good],
        payload_start=(start + head)[good],
        payload_length=length[good],
        receive_s=np.array(receive, dtype=np.float64)[good],
        skipped_bytes=skipped,
        bad_checksum=int((known & ~good).sum()),
        unknown=int((~known).sum()),
    )


def _byte_at(data: NDArray[np.uint8], at: Ints) -> Ints:
    """Bytes at these places; the last one of the file where a short frame ends before."""
    return data[np.minimum(at, len(data) - 1)].astype(np.int64)


def _number_at(data: NDArray[np.uint8], at: Ints) -> Ints:
    """Message numbers of version 2: three bytes, little-endian."""
    return _byte_at(data, at) | _byte_at(data, at + 1) << 8 | _byte_at(data, at + 2) << 16


def _walk(data: bytes) -> tuple[list[int], int]:
    """Offsets of frames that end inside the file, and how many bytes belong to none."""
    starts: list[int] = []
    size, at, skipped = len(data), 0, 0
    while at + 16 < size + 1:
        total = _frame_length(data, at + 8)
        end = at + 8 + total
        fits = total > 0 and end <= size
        # the next record's frame must begin where this one says; else trust only its checksum
        if fits and (end + 8 >= size or data[end + 8] in (_V1, _V2) or _is_intact(data, at + 8)):
            starts.append(at + 8)
            at = end
            continue
        found = _RECORD.search(data, at + 1)
        after = found.start() if found else size
        skipped += after - at
        at = after
    return starts, skipped + max(0, size - at)


def _frame_length(data: bytes, start: int) -> int:
    """Bytes of the frame that begins here; 0 where none does."""
    if data[start] == _V1:
        return data[start + 1] + 8
    if data[start] == _V2 and start + 2 < len(data):
        return data[start + 1] + 12 + (13 if data[start + 2] & 1 else 0)
    return 0


def _is_intact(data: bytes, start: int) -> bool:
    """Whether the checksum of one frame is right."""
    second = data[start] == _V2
    length, head = data[start + 1], 10 if second else 6
    number = int.from_bytes(data[start + 7 : start + 10], "little") if second else data[start + 5]
    extra = _checksum_extra(number)
    if extra < 0:
        return False
    array = np.frombuffer(data[start + 1 : start + head + length], dtype=np.uint8)
    found = checksums(array, np.zeros(1, np.int64), np.array([len(array)]), np.array([extra]))
    (written,) = struct.unpack_from("<H", data, start + head + length)
    return bool(found[0] == written)


def _checksum_extra(number: int) -> int:
    """The byte that ties a checksum to the message's definition; -1 for an unknown message."""
    known = dialect.mavlink_map.get(number)
    return int(known.crc_extra) if known is not None else -1


def _checksum_table() -> NDArray[np.uint16]:
    """CRC-16/MCRF4XX (reflected polynomial 0x8408) of each byte."""
    table = np.arange(256, dtype=np.uint16)
    for _ in range(8):
        table = np.where(table & 1, (table >> 1) ^ np.uint16(0x8408), table >> 1)
    return table.astype(np.uint16)


_TABLE = _checksum_table()


def checksums(data: NDArray[np.uint8], start: Ints, length: Ints, extra: Ints) -> Ints:
    """MAVLink checksum (CRC-16/MCRF4XX) of N byte ranges.

    Parameters
    ----------
    data
        Bytes.
    start, length
        (N,) the ranges.
    extra
        (N,) the message's own byte, appended to its range.

    Returns
    -------
    (N,)
    """
    order = np.argsort(-length, kind="stable")
    first, long = start[order], length[order]
    crc = np.full(len(start), 0xFFFF, dtype=np.uint16)
    for k in range(int(long[0]) if len(long) else 0):
        active = int(np.searchsorted(-long, -k, side="left"))  # ranges longer than k come first
        crc[:active] = _step(crc[:active], data[first[:active] + k])
    result = np.empty(len(start), dtype=np.int64)
    result[order] = crc
    return _step(result.astype(np.uint16), (extra & 0xFF).astype(np.uint8)).astype(np.int64)


def _step(crc: NDArray[np.uint16], byte: NDArray[np.uint8]) -> NDArray[np.uint16]:
    table_step: NDArray[np.uint16] = (crc >> 8) ^ _TABLE[(crc ^ byte) & 0xFF]
    return table_step
