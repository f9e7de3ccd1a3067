"""Frames of MAVLink telemetry logs, found by their checksums, and decoded to columns.

https://mavlink.io/en/guide/serialization.html#checksum: over the frame without its first byte,
followed by one byte that links it to the message's definition.

A frame is a polynomial over GF(2), its first bit the highest; its checksum is the remainder modulo
P(x) = x^16 + x^12 + x^5 + 1. As P(x)^n = P(x^n) for every power of two n, modulo P x^16n is x^12n +
x^5n + 1: a few shifts reduce 64 bits of each of thousands of frames, instead of a table look-up for
every byte. Checksums are reflected: in a little-endian word the lowest bit is that of the highest
power, and a multiplication by x^k is a shift to the right.

A .tlog is a sequence of records: 8 bytes of time (big-endian microseconds since 1970 on the
receiver's clock; some programs keep a link number in the lowest two bits) and one MAVLink frame,
version 1 (0xFE) or 2 (0xFD). Frame layout and checksum:
https://mavlink.io/en/guide/serialization.html.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavgram.io.logs.messages import Messages, Topic, checksum_extra, message_dtype, message_number
from uavgram.io.logs.samples import LONGEST_BOOT_S, find_restarts
from uavgram.model.arrays import Bools, Floats, Ints

Words = NDArray[np.integer[Any]]  # unsigned

_ROWS_OF_SUMS = 8192  # at a time: fits into a processor's cache
_PAIR = 16  # bytes of two words, to which shifts of whole words reduce each frame
_INITIAL = 0xFFFF  # of the register


def _byte_table() -> NDArray[np.uint16]:
    """Return the checksum register after each byte, from zero (reflected polynomial 0x8408)."""
    table = np.arange(256, dtype=np.uint16)
    for _ in range(8):
        table = np.where(table & 1, (table >> 1) ^ np.uint16(0x8408), table >> 1)
    return table.astype(np.uint16)


def _word_table(by_byte: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """Return the same after each pair of bytes (little-endian), as wide as the register."""
    word = np.arange(65536, dtype=np.uint16)
    first = (word >> 8) ^ by_byte[word & 0xFF]
    return np.asarray((first >> 8) ^ by_byte[first & 0xFF], dtype=np.uint16)


_BY_BYTE = _byte_table()
_BY_WORD = _word_table(_BY_BYTE)


def compute_checksums(
    data: NDArray[np.uint8], start: Ints, length: NDArray[np.integer], extra: NDArray[np.integer]
) -> NDArray[np.uint16]:
    """Compute the MAVLink checksum of N byte ranges.

    Parameters
    ----------
    data
        Bytes.
    start, length
        (N,) the ranges, inside of `data`.
    extra
        (N,) the message's own byte, appended to its range.

    Returns
    -------
    (N,)
    """
    crc = np.empty(len(start), dtype=np.uint16)
    if not len(start):
        return crc
    end, short = start + length, length.astype(np.uint16)
    pairs = np.maximum((short + np.uint16(_PAIR - 1)) >> 4, np.uint16(1))
    before = _PAIR * int(pairs.max()) - int(end.min())
    if before > 0:  # the words of a range at the start of the file reach before it
        data, end = np.concatenate([np.zeros(before, np.uint8), data]), end + before
    order = np.argsort(pairs, kind="stable")  # 16 bits: a radix sort
    edges = np.append(0, np.cumsum(np.bincount(pairs))).tolist()
    initial = _compute_zero_registers(int(short.max()))
    for count, (begin, stop) in enumerate(itertools.pairwise(edges)):
        # long lists of rows in parts that fit into the cache
        for low in range(begin, stop, _ROWS_OF_SUMS):
            rows = order[low : min(low + _ROWS_OF_SUMS, stop)]
            own = short[rows]
            rest = _remainders(_words(data, end[rows], own, count))
            # times x^16, plus the initial register after as many zero bytes
            register = _BY_WORD.take(rest, mode="clip") ^ initial.take(own, mode="clip")
            crc[rows] = _step(register, extra[rows].astype(np.uint8))
    return crc


def copy_items(data: NDArray[np.uint8], where: Ints, dtype: str) -> NDArray[Any]:
    """Return (N,) items that begin at any bytes, each copied at once.

    Parameters
    ----------
    data
        Bytes.
    where
        (N,) first bytes, so that items end inside of `data`.
    dtype
        Of the items.
    """
    count = max(len(data) - np.dtype(dtype).itemsize + 1, 0)
    return np.ndarray((count,), dtype, data, strides=(1,))[where]


def _words(
    data: NDArray[np.uint8], end: Ints, length: NDArray[np.uint16], count: int
) -> NDArray[np.uint64]:
    """Return (2 count, N) words up to the ends of ranges, zero before their starts."""
    size = _PAIR * count
    items = copy_items(data, end - size, f"V{size}")
    words = np.ascontiguousarray(items.view("<u8").reshape(-1, 2 * count).T)
    outside = 8 * (size - length.astype(np.uint64))  # bits; a shift by 64 or more clears the word
    beyond = np.maximum(outside, np.uint64(64)) - np.uint64(64)
    words[0] = words[0] >> outside << outside
    words[1] = words[1] >> beyond << beyond
    return words


def _remainders(words: NDArray[np.uint64]) -> NDArray[np.uint16]:
    """Compute (N,) remainders of polynomials in (2 count, N) words, which are overwritten."""
    for k in range(len(words) - 2):
        first = words[k]
        first ^= first << 32  # x^128 is x^96 + x^40 + 1: x^96 of its upper half is x^128 again
        words[k + 1] ^= (first >> 32) ^ (first << 24)
        words[k + 2] ^= first ^ (first >> 40)
    both = _low_half(words[-2], words[-1], 4).view(np.uint32)
    both = _low_half(both[::2].copy(), both[1::2].copy(), 2).view(np.uint16)
    return _low_half(both[::2].copy(), both[1::2].copy(), 1).view(np.uint16)


def _low_half(high: Words, low: Words, n: int) -> Words:
    """Reduce (N,) polynomials to remainders modulo P(x^n), of 16n bits, half as many.

    The quotient is that of the upper half by 1 + x^-4n + x^-11n + x^-16n, whose inverse is 1 +
    x^-4n + x^-8n + x^-11n + x^-12n to the available number of bits.
    """
    quotient = high ^ (high << 4 * n) ^ (high << 8 * n) ^ (high << 11 * n) ^ (high << 12 * n)
    rest: Words = low ^ quotient ^ (quotient >> 5 * n) ^ (quotient >> 12 * n)
    return rest


def _compute_zero_registers(most: int) -> NDArray[np.uint16]:
    """Return the (most + 1,) registers after so many zero bytes."""
    by_byte, register = _BY_BYTE.tolist(), [_INITIAL]
    for _ in range(most):
        register.append(register[-1] >> 8 ^ by_byte[register[-1] & 0xFF])
    return np.array(register, dtype=np.uint16)


def _step(crc: NDArray[np.uint16], byte: NDArray[np.uint8]) -> NDArray[np.uint16]:
    stepped: NDArray[np.uint16] = (crc >> 8) ^ _BY_BYTE[(crc ^ byte) & 0xFF]
    return stepped


Columns = dict[str, NDArray[Any]]

_V1, _V2 = 0xFE, 0xFD
_CHUNK = 1 << 23  # bytes searched at a time: the results fit into the cache
_NO_TIME = 0xF0FF  # of its first two bytes: 2^52 microseconds are the year 2112
_BARE_FRAMES = 4  # in a row
_ROWS = 1 << 16  # messages decoded at a time
# sent by every running autopilot, each with time_boot_ms
_CLOCKED = (
    "SYSTEM_TIME",
    "GLOBAL_POSITION_INT",
    "LOCAL_POSITION_NED",
    "ATTITUDE",
    "ATTITUDE_QUATERNION",
)
_AUTOPILOT_COMPONENT = 1
_NO_AUTOPILOT = 8  # MAV_AUTOPILOT_INVALID: a ground station, a camera, a gimbal


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
        (N,) position of the payload.
    rows_by_id
        Message number: its rows, increasing.
    skipped_bytes, bad_checksum
        Bytes outside of frames; number of frames with a wrong checksum.
    unknown
        Frames of messages that no dialect here defines (their checksum cannot be tested).
    """

    data: NDArray[np.uint8]
    start: Ints
    message_id: NDArray[np.int32]
    system: NDArray[np.uint8]
    component: NDArray[np.uint8]
    payload_start: Ints
    payload_length: NDArray[np.uint8]
    rows_by_id: dict[int, Ints]
    skipped_bytes: int
    bad_checksum: int
    unknown: int

    def rows(self, name: str, mask: Bools | None = None) -> Ints:
        """Return (K,) rows of one message type inside the mask."""
        found = self.rows_by_id.get(message_number(name), np.zeros(0, dtype=np.int64))
        return found if mask is None else found[mask[found]]

    def receive_s(self, rows: Ints) -> Floats:
        """Return (K,) the receiver's clock at these rows, seconds since 1970."""
        stamps = np.lib.stride_tricks.sliding_window_view(self.data, 8)[self.start[rows] - 8]
        return np.asarray(stamps.view(">u8")[:, 0].astype(np.float64) * 1e-6)

    def columns(self, name: str, rows: Ints) -> Columns:
        """Return every field of one message type as a column; trimmed or absent fields are zero."""
        dtype = message_dtype(name)
        records = np.empty(len(rows), dtype=dtype)
        bodies = records.view(np.uint8).reshape(len(rows), dtype.itemsize)
        for low in range(0, len(rows), _ROWS):
            part = rows[low : low + _ROWS]
            bodies[low : low + _ROWS] = self._payloads(part, dtype.itemsize)
        return {field: records[field] for field in dtype.names or ()}

    def _payloads(self, rows: Ints, size: int) -> NDArray[np.uint8]:
        """Return (K, size) payloads, padded with zeros or cut."""
        start, length = self.payload_start[rows], self.payload_length[rows]
        last = len(self.data) - size
        if last < 0 or (len(start) and start[-1] > last):
            # the last frames of the file may be shorter than their complete message
            where = start[:, None] + np.arange(size)
            bodies = self.data[np.minimum(where, len(self.data) - 1)]
        else:
            bodies = np.lib.stride_tricks.sliding_window_view(self.data, size)[start]
        if len(length) and length.min() < size:
            bodies[np.arange(size) >= length[:, None]] = 0
        return np.asarray(bodies)


@dataclass(frozen=True, eq=False)
class _Candidates:
    """Candidates for records: a possible time, then a frame that ends inside the file."""

    start: Ints
    end: Ints
    second: Bools
    length: NDArray[np.uint8]
    number: NDArray[np.int32]

    def only(self, keep: Bools) -> _Candidates:
        if keep.all():
            return self
        return _Candidates(*(getattr(self, field.name)[keep] for field in fields(self)))


def scan_frames(data: bytes) -> FrameTable:
    """Find every frame of a telemetry log and test its checksum.

    A frame has a record's time before it and a correct checksum, at any position; so damaged bytes
    affect only the frames that contain them. Frames with a wrong checksum or of an undefined
    message are counted where another record follows them.
    """
    array = np.frombuffer(data, dtype=np.uint8)
    sound, others = _find_sound_records(array)
    # keep records that do not overlap: sound ones first, then others next to them
    sound = sound.only(_apart(sound))
    others = others.only(~_overlaps(others, sound))
    others = others.only(_apart(others))
    failed = int((checksum_extra(others.number) >= 0).sum())
    read = _bytes_of(sound) + _bytes_of(others)
    sender = sound.start + np.where(sound.second, 5, 3)
    # system and component follow three (version 1) or five bytes after the mark
    return FrameTable(
        data=array,
        start=sound.start,
        message_id=sound.number,
        system=array[sender],
        component=array[sender + 1],
        payload_start=sound.start + np.where(sound.second, 10, 6),
        payload_length=sound.length,
        rows_by_id=_group_by_message(sound.number),
        skipped_bytes=len(array) - read,
        bad_checksum=failed,
        unknown=len(others.start) - failed,
    )


def is_bare_stream(head: bytes) -> bool:
    """Return whether frames with correct checksums follow each other without times between them.

    Without the checksums, bytes of a log that recur at regular intervals look like such frames.
    """
    data = np.frombuffer(head, dtype=np.uint8)
    frames = _read_headers(data, np.flatnonzero((data == _V1) | (data == _V2)))
    frames = frames.only(_has_right_checksum(data, frames, checksum_extra(frames.number)))
    adjoining = np.isin(frames.start, frames.end).sum()
    return bool(adjoining + 1 >= _BARE_FRAMES)


def _find_sound_records(data: NDArray[np.uint8]) -> tuple[_Candidates, _Candidates]:
    """Return records with a correct checksum, and the others that another record follows."""
    sound, others = [], []
    for low in range(8, max(len(data), 9), _CHUNK):
        found = _candidates(data, low)
        good = _has_right_checksum(data, found, checksum_extra(found.number))
        sound.append(found.only(good))
        others.append(found.only(~good & _is_followed(data, found.end)))
    return _join_candidates(sound), _join_candidates(others)


def _join_candidates(parts: list[_Candidates]) -> _Candidates:
    names = [field.name for field in fields(_Candidates)]
    return _Candidates(*(np.concatenate([getattr(part, n) for part in parts]) for n in names))


def _candidates(data: NDArray[np.uint8], low: int) -> _Candidates:
    """Return every position in a chunk of the file that could be a frame."""
    chunk = data[low : low + _CHUNK]
    start = np.flatnonzero((chunk - np.uint8(_V2)) <= 1) + low  # 0xFD or 0xFE
    return _read_headers(data, start[copy_items(data, start - 8, "<u2") & _NO_TIME == 0])


def _read_headers(data: NDArray[np.uint8], start: Ints) -> _Candidates:
    """Read the headers of possible frames (N,); those that end inside the file are returned."""
    start = start[start + 8 <= len(data)]
    start = start[(data[start] == _V1) | (start + 12 <= len(data))]
    head = copy_items(data, start, "<u4")  # mark, length of the payload, flags
    second = (head & 0xFF) == _V2
    length = (head >> 8).astype(np.uint8)
    signed = second & (head & 0x10000 > 0)
    end = start + length + np.where(second, 12, 8) + np.where(signed, 13, 0)
    number = np.zeros(len(start), dtype=np.int32)
    number[second] = copy_items(data, start[second] + 7, "<u4") & 0xFFFFFF
    number[~second] = data[start[~second] + 5]
    return _Candidates(start, end, second, length, number).only(end <= len(data))


def _has_right_checksum(
    data: NDArray[np.uint8], found: _Candidates, extra: NDArray[np.int16]
) -> Bools:
    """Return (N,) whether the checksum is correct; false where the message is unknown."""
    covered = found.length + np.where(found.second, 9, 5)
    stated = copy_items(data, found.start + 1 + covered, "<u2")
    right = compute_checksums(data, found.start + 1, covered, extra) == stated
    return np.asarray(right & (extra >= 0))


def _apart(found: _Candidates) -> Bools:
    """Return a (N,) mask of records to keep: those that do not begin inside of a kept one."""
    begin, end = found.start - 8, found.end
    keep = np.ones(len(begin), dtype=bool)
    # behind all earlier ones: always kept
    clear = begin[1:] >= np.maximum.accumulate(end[:-1])
    if clear.all():
        return keep
    clear = np.append(True, clear)
    rows = np.flatnonzero(~clear | np.append(~clear[1:], False))
    free_from = 0
    for k, first, last in zip(rows.tolist(), begin[rows].tolist(), end[rows].tolist(), strict=True):
        if first < free_from:
            keep[k] = False
        else:
            free_from = last
    return keep


def _overlaps(found: _Candidates, sound: _Candidates) -> Bools:
    """Return (N,) whether a record overlaps one of the sound ones, which do not overlap."""
    if not len(sound.start):
        return np.zeros(len(found.start), dtype=bool)
    following = np.searchsorted(sound.start - 8, found.start - 8, side="right")
    before = sound.end[np.maximum(following - 1, 0)]
    inside = (following > 0) & (before > found.start - 8)
    after = sound.start[np.minimum(following, len(sound.start) - 1)] - 8
    return inside | ((following < len(sound.start)) & (after < found.end))


def _is_followed(data: NDArray[np.uint8], end: Ints) -> Bools:
    """Return (N,) whether another record, or the end of the file, follows."""
    mark = data[np.minimum(end + 8, len(data) - 1)]
    return np.asarray((end + 8 >= len(data)) | (mark == _V1) | (mark == _V2))


def _bytes_of(found: _Candidates) -> int:
    return int((found.end - found.start + 8).sum())


def _group_by_message(number: NDArray[np.int32]) -> dict[int, Ints]:
    """Group rows by message number, increasing; the numbers are defined in a dialect."""
    # 16 bits, where they suffice: a radix sort
    narrow = number.astype(np.uint16) if not len(number) or number.max() < 1 << 16 else number
    order = np.argsort(narrow, kind="stable")
    count = np.bincount(number) if len(number) else np.zeros(0, dtype=np.int64)
    edges = np.append(0, np.cumsum(count))
    return {int(n): order[edges[n] : edges[n + 1]] for n in np.flatnonzero(count)}


@dataclass(frozen=True, eq=False)
class Stream(Messages):
    """Frames of one boot of one vehicle.

    Attributes
    ----------
    frames
        The whole file.
    system
        Number of the vehicle.
    first_row, end_row
        Range of the frames of this boot.
    clock_row, clock_boot_s
        (C,) frames that state the boot time, and the stated times.
    """

    frames: FrameTable
    system: int
    first_row: int
    end_row: int
    clock_row: Ints
    clock_boot_s: Floats

    def rows(self, name: str) -> Ints:
        """Return (K,) frames of one message type from the autopilot, else from other components."""
        rows = self.frames.rows(name)
        rows = rows[np.searchsorted(rows, self.first_row) : np.searchsorted(rows, self.end_row)]
        rows = rows[self.frames.system[rows] == self.system]
        component = self.frames.component[rows]
        own = component == _AUTOPILOT_COMPONENT
        if own.any() or not len(rows):
            return np.asarray(rows[own])
        return np.asarray(rows[component == np.bincount(component).argmax()], dtype=np.int64)

    def read(self, name: str) -> Topic | None:
        """Return the messages of one kind, by their own time since boot where they state one."""
        rows = self.rows(name)
        if not len(rows):
            return None
        columns = self.frames.columns(name, rows)
        stated = "time_boot_ms" in columns
        time_s = columns["time_boot_ms"] * 1e-3 if stated else self.boot_s(rows)
        for field, values in tuple(columns.items()):
            if values.ndim > 1:
                columns |= {f"{field}[{k}]": values[:, k] for k in range(values.shape[1])}
        return Topic(name, time_s, columns)

    def boot_s(self, rows: Ints) -> Floats:
        """Return (K,) boot times of frames that state none, interpolated between neighbours."""
        return np.interp(rows, self.clock_row, self.clock_boot_s)


def find_vehicles(frames: FrameTable) -> list[int]:
    """Return the numbers of the autopilots in the log, the one with the most positions first."""
    beats = frames.rows("HEARTBEAT", frames.component == _AUTOPILOT_COMPONENT)
    kinds = frames.columns("HEARTBEAT", beats).get("autopilot", np.zeros(0))
    systems = set(frames.system[beats[kinds != _NO_AUTOPILOT]].tolist())
    placed = frames.system[frames.rows("GLOBAL_POSITION_INT")]
    systems = systems or set(placed.tolist())
    return sorted(systems, key=lambda system: (-int((placed == system).sum()), system))


def split_boots(frames: FrameTable, system: int) -> list[Stream]:
    """Return one stream for each start of the vehicle's boot clock."""
    # boot times of all periodic messages of this autopilot, in the order of the file
    mine = (frames.system == system) & (frames.component == _AUTOPILOT_COMPONENT)
    rows_of = [frames.rows(name, mine) for name in _CLOCKED]
    if not any(len(rows) for rows in rows_of):
        return []
    times_of = [
        frames.columns(name, rows)["time_boot_ms"].astype(np.float64) * 1e-3
        for name, rows in zip(_CLOCKED, rows_of, strict=True)
    ]
    row, time = np.concatenate(rows_of), np.concatenate(times_of)
    sane = (time > 0) & (time < LONGEST_BOOT_S)
    row, time = row[sane], time[sane]
    order = np.argsort(row, kind="stable")
    row, time = row[order], time[order]
    if not len(row):
        return []
    # split where the clock restarts
    edges = [0, *find_restarts(time).tolist(), len(row)]
    streams = []
    for k in range(len(edges) - 1):
        part = slice(edges[k], edges[k + 1])
        first = 0 if k == 0 else int(row[edges[k]])
        end = len(frames.start) if k == len(edges) - 2 else int(row[edges[k + 1]])
        streams.append(Stream(frames, system, first, end, row[part], time[part]))
    return streams
