"""Binary DataFlash files of ArduPilot as columns, decoded by numpy with the file's own formats.

The format has no checksum: users of these columns must check the values.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavgram.errors import InputError
from uavgram.io.logs.dataflash.formats import (
    FMT,
    FMT_LENGTH,
    FMT_TYPE,
    HEADER,
    Columns,
    Format,
    format_at,
)
from uavgram.io.logs.dataflash.tables import FormatPiece, Tables, select_inside

#: Offsets of the messages of each of the 256 types, in the order of the file.
Starts = list[list[int]]

_SUSPICIOUS = 0.01  # share of unread bytes above which the index is made again


@dataclass(frozen=True, eq=False)
class BinaryTables(Tables):
    """A binary DataFlash file, indexed; `data` are its bytes."""

    data: NDArray[np.uint8]

    def decoded(self, fmt: Format, starts: list[int]) -> Columns:
        """Return every field of the messages at these offsets, as columns."""
        return fmt.decoded(self.data, np.array(starts, dtype=np.int64))


def index_binary(path: str, data: bytes) -> BinaryTables:
    """Find every message of a binary DataFlash file.

    Raises
    ------
    InputError
        The bytes are not a DataFlash file.
    """
    if HEADER + bytes([FMT_TYPE]) not in data[:65536]:
        raise InputError(
            path,
            "is no DataFlash log (no format message in its first 64 kB); "
            "give the .bin from the autopilot's memory card, or a .tlog under that suffix",
        )
    starts = index_by_pymavlink(data)
    tables = None if starts is None else _tables(data, starts)
    if tables is not None and starts is not None and (end := _end(tables)) < len(data):
        # the compiled indexer ends at the first unknown type: continue behind it
        lengths = {p.format.number: p.format.length for ps in tables.pieces.values() for p in ps}
        rest = index_by_loop(data, end, lengths)
        if any(rest):
            tables = _tables(data, [a + b for a, b in zip(starts, rest, strict=True)])
    if tables is None or _unread(tables) > _SUSPICIOUS * len(data):
        # A damaged format message changes the length of a type: the loop checks format messages.
        checked = _tables(data, index_by_loop(data))
        tables = checked if tables is None or _unread(checked) < _unread(tables) else tables
    unread = _unread(tables)
    if not unread:
        return tables
    note = f"{unread} of {len(data)} bytes belong to no complete message"
    return replace(tables, notes=(*tables.notes, note))


def _tables(data: bytes, starts: Starts) -> BinaryTables:
    """Return formats and complete messages, from the offsets of each of the 256 types."""
    formats, notes = _read_formats(data, starts[FMT_TYPE])
    pieces: dict[str, list[FormatPiece]] = {}
    for number, stated in formats.items():
        edges = [0, *(start for start, _ in stated[1:]), len(data)]
        for k, (_, fmt) in enumerate(stated):
            found = select_inside(starts[number], edges[k], edges[k + 1])
            while found and found[-1] + fmt.length > len(data):
                found.pop()  # incomplete message at the end of a truncated file
            if found:
                pieces.setdefault(fmt.name, []).append(FormatPiece(fmt, found))
    ordered = {n: tuple(sorted(p, key=lambda piece: piece.starts[0])) for n, p in pieces.items()}
    return BinaryTables(ordered, tuple(notes), np.frombuffer(data, dtype=np.uint8))


def _end(tables: BinaryTables) -> int:
    """Return the end of the last complete message."""
    ends = (p.starts[-1] + p.format.length for parts in tables.pieces.values() for p in parts)
    return max(ends, default=0)


def _unread(tables: BinaryTables) -> int:
    """Return the number of bytes outside of complete messages."""
    parts = (piece for pieces in tables.pieces.values() for piece in pieces)
    return max(len(tables.data) - sum(len(p.starts) * p.format.length for p in parts), 0)


def _read_formats(
    data: bytes, starts: list[int]
) -> tuple[dict[int, list[tuple[int, Format]]], list[str]]:
    """Return the formats of each type number with their first bytes, and remarks."""
    stated: dict[int, list[tuple[int, Format]]] = {FMT_TYPE: [(0, FMT)]}
    notes: list[str] = []
    for start in starts:
        fmt = format_at(data, start)
        if fmt is None:
            notes.append(f"a format message at byte {start} makes no sense and was skipped")
            continue
        known = stated.setdefault(fmt.number, [])
        if known and known[-1][1] == fmt:
            continue
        if known:
            notes.append(f"the format of {known[-1][1].name} changes at byte {start}")
        known.append((start, fmt))
    return stated, notes


def index_by_pymavlink(data: bytes) -> Starts | None:
    """Index with pymavlink's compiled indexer (since 2.4.50); None if this pymavlink has none."""
    try:
        from pymavlink import dfindexer  # noqa: PLC0415 - absent in older releases
    except ImportError:
        return None
    if not dfindexer.available:
        return None
    with _silent_standard_error():  # it prints a line for every byte that it skips
        starts: Starts = dfindexer.build_offsets(
            memoryview(data), FMT_TYPE, FMT_LENGTH, 3, 4, HEADER[0], HEADER[1]
        )
    return starts


def index_by_loop(
    data: bytes, first: int = 0, known_lengths: dict[int, int] | None = None
) -> Starts:
    """Index without the compiled indexer; only plausible format messages are used.

    Parameters
    ----------
    data
        Bytes of the file.
    first
        First byte.
    known_lengths
        Bytes of a message by its type, as stated before `first`.
    """
    starts: Starts = [[] for _ in range(256)]
    lengths = [0] * 256
    for number, length in (known_lengths or {}).items():
        lengths[number] = length
    lengths[FMT_TYPE] = FMT_LENGTH
    at = data.find(HEADER, first)
    while 0 <= at < len(data) - 2:
        number = data[at + 2]
        fmt = format_at(data, at) if number == FMT_TYPE else None
        if fmt is not None:
            lengths[fmt.number] = fmt.length
        if not lengths[number] or (number == FMT_TYPE and fmt is None):
            at = data.find(HEADER, at + 1)
            continue
        starts[number].append(at)
        end = at + lengths[number]
        # if no message follows, bytes are missing or damaged: search again from inside this one
        at = end if data[end : end + 2] == HEADER else data.find(HEADER, at + 3)
    return starts


@contextmanager
def _silent_standard_error() -> Iterator[None]:
    """Redirect file descriptor 2 to the null device: C code does not write through sys.stderr."""
    kept = os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)
