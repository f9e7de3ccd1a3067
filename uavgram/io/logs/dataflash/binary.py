"""ArduPilot DataFlash files as columns: the formats that a file states, applied by numpy.

There is no checksum: what reads these columns must judge the values.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavgram.errors import InputError
from uavgram.io.logs.dataflash.formats import (
    FMT_TYPE,
    HEADER,
    TEXT_CHARACTERS,
    Columns,
    Format,
    format_at,
)
from uavgram.io.logs.dataflash.index import Starts, indexed_by_loop, indexed_by_pymavlink

_SUSPICIOUS = 0.01  # of the file unread: its index deserves a second look


@dataclass(frozen=True, eq=False)
class Piece:
    """Messages of one type under one format, which a file may change midway.

    Attributes
    ----------
    format
        Of all of them.
    starts
        Where they begin, increasing; all are complete.
    """

    format: Format
    starts: list[int]


@dataclass(frozen=True, eq=False)
class DataflashTables:
    """A DataFlash file, indexed; columns are gathered when asked for.

    Attributes
    ----------
    data
        The bytes of the file.
    pieces
        By message name, in the order of the file.
    notes
        What was odd about the file.
    """

    data: NDArray[np.uint8]
    pieces: dict[str, tuple[Piece, ...]]
    notes: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Message types that the file holds, sorted."""
        return tuple(sorted(self.pieces))

    def count(self, name: str) -> int:
        """How many messages of this type the file holds."""
        return sum(len(piece.starts) for piece in self.pieces.get(name, ()))

    def places(self, name: str) -> NDArray[np.int64]:
        """(N,) where the messages of one type begin, in the order of `columns`."""
        starts = [np.array(piece.starts, dtype=np.int64) for piece in self.pieces.get(name, ())]
        return np.concatenate(starts) if starts else np.zeros(0, dtype=np.int64)

    def columns(self, name: str) -> Columns:
        """Every field of one message type as a column, scaled as its format character says.

        Returns
        -------
        dict
            Field name: array over the messages in the order of the file; empty where the file
            has no such message. A field that a part of the file does not define is NaN (empty,
            for a text) there.
        """
        return self._decoded([(p.format, p.starts) for p in self.pieces.get(name, ())])

    def ends(self, name: str) -> Columns:
        """The columns of the first and the last message of one type only."""
        pieces = self.pieces.get(name, ())
        if not pieces:
            return {}
        first, last = pieces[0], pieces[-1]
        if first is last:
            return self._decoded([(first.format, [first.starts[0], first.starts[-1]])])
        return self._decoded([(first.format, first.starts[:1]), (last.format, last.starts[-1:])])

    def _decoded(self, parts: list[tuple[Format, list[int]]]) -> Columns:
        decoded = [
            (fmt, fmt.decoded(self.data, np.array(starts, dtype=np.int64))) for fmt, starts in parts
        ]
        return decoded[0][1] if len(decoded) == 1 else joined(decoded)

    def between(self, start: int, end: int) -> DataflashTables:
        """The messages that begin in this range of bytes."""
        return replace(self, pieces=pieces_between(self.pieces, start, end))


def pieces_between(
    pieces: dict[str, tuple[Piece, ...]], start: int, end: int
) -> dict[str, tuple[Piece, ...]]:
    """The messages that begin in this range of the file."""
    found: dict[str, tuple[Piece, ...]] = {}
    for name, whole in pieces.items():
        cut = [replace(p, starts=inside(p.starts, start, end)) for p in whole]
        kept = tuple(piece for piece in cut if piece.starts)
        if kept:
            found[name] = kept
    return found


def inside(starts: list[int], start: int, end: int) -> list[int]:
    """Those of the places that lie in this range of the file."""
    return starts[bisect_left(starts, start) : bisect_left(starts, end)]


def joined(decoded: list[tuple[Format, Columns]]) -> Columns:
    """One table of several formats of the same message type."""
    fields = dict.fromkeys(field for fmt, _ in decoded for field in fmt.fields)
    return {field: np.concatenate(_alike(decoded, field)) for field in fields}


def _alike(decoded: list[tuple[Format, Columns]], field: str) -> list[NDArray[np.generic]]:
    """The same field of every part, with a filling where one lacks it or has another kind."""
    is_text = {
        fmt.characters[fmt.fields.index(field)] in TEXT_CHARACTERS
        for fmt, _ in decoded
        if field in fmt.fields
    }
    of_text = is_text == {True}
    parts: list[NDArray[np.generic]] = []
    for fmt, columns in decoded:
        rows = len(next(iter(columns.values()), ()))
        character = fmt.characters[fmt.fields.index(field)] if field in fmt.fields else ""
        if character and character != "a" and (character in TEXT_CHARACTERS) == of_text:
            parts.append(columns[field])
        else:
            parts.append(np.full(rows, b"" if of_text else np.nan))
    return parts


def index_binary(path: str, data: bytes) -> DataflashTables:
    """Find every message of a binary DataFlash file.

    Raises
    ------
    InputError
        The bytes are no DataFlash file.
    """
    if HEADER + bytes([FMT_TYPE]) not in data[:65536]:
        raise InputError(
            path,
            "is no DataFlash log (no format message in its first 64 kB); "
            "give the .bin from the autopilot's memory card, or a .tlog under that suffix",
        )
    starts = indexed_by_pymavlink(data)
    tables = None if starts is None else _tables(data, starts)
    if tables is not None and starts is not None and (end := _end(tables)) < len(data):
        # the compiled indexer ends at the first unknown type: go on behind it
        lengths = {p.format.number: p.format.length for ps in tables.pieces.values() for p in ps}
        rest = indexed_by_loop(data, end, lengths)
        if any(rest):
            tables = _tables(data, [a + b for a, b in zip(starts, rest, strict=True)])
    if tables is None or _unread(tables) > _SUSPICIOUS * len(data):
        # A damaged format message changes the length of a type: the loop tests what it believes.
        checked = _tables(data, indexed_by_loop(data))
        tables = checked if tables is None or _unread(checked) < _unread(tables) else tables
    unread = _unread(tables)
    if not unread:
        return tables
    note = f"{unread} of {len(data)} bytes belong to no complete message"
    return replace(tables, notes=(*tables.notes, note))


def _tables(data: bytes, starts: Starts) -> DataflashTables:
    """Formats and complete messages, from the offsets of each of the 256 types."""
    formats, notes = _read_formats(data, starts[FMT_TYPE])
    pieces: dict[str, list[Piece]] = {}
    for number, stated in formats.items():
        edges = [0, *(start for start, _ in stated[1:]), len(data)]
        for k, (_, fmt) in enumerate(stated):
            found = inside(starts[number], edges[k], edges[k + 1])
            while found and found[-1] + fmt.length > len(data):
                found.pop()  # the tail of a truncated file
            if found:
                pieces.setdefault(fmt.name, []).append(Piece(fmt, found))
    ordered = {n: tuple(sorted(p, key=lambda piece: piece.starts[0])) for n, p in pieces.items()}
    return DataflashTables(np.frombuffer(data, dtype=np.uint8), ordered, tuple(notes))


def _end(tables: DataflashTables) -> int:
    """Where the last complete message ends."""
    ends = (p.starts[-1] + p.format.length for parts in tables.pieces.values() for p in parts)
    return max(ends, default=0)


def _unread(tables: DataflashTables) -> int:
    """How many bytes belong to no complete message."""
    parts = (piece for pieces in tables.pieces.values() for piece in pieces)
    return max(len(tables.data) - sum(len(p.starts) * p.format.length for p in parts), 0)


def _read_formats(
    data: bytes, starts: list[int]
) -> tuple[dict[int, list[tuple[int, Format]]], list[str]]:
    """What each type number means and from which byte on, and what was odd."""
    stated: dict[int, list[tuple[int, Format]]] = {}
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
