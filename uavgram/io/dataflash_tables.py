"""ArduPilot DataFlash files as columns: the formats that a file states, applied by numpy.

The layout is ArduPilot's (libraries/AP_Logger/LogStructure.h): every message starts with
0xA3 0x95 and its type; type 0x80 (FMT) defines the others: length, name, one format character per
field, field names. There is no checksum: what reads these columns must judge the values.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavgram.errors import InputError

Columns = dict[str, NDArray[Any]]

HEADER = b"\xa3\x95"
FMT_TYPE, FMT_LENGTH = 0x80, 89
_SUSPICIOUS = 0.01  # of the file unread: its index deserves a second look

# Format character: numpy type, and what the stored integer is divided by.
# Division, not multiplication by 0.01 or 1e-7: 12345 / 100 is the double nearest to 123.45.
_NUMPY_TYPES: dict[str, tuple[str, float | None]] = {
    "a": ("(32,)<i2", None),
    "b": ("<i1", None),
    "B": ("<u1", None),
    "M": ("<i1", None),
    "h": ("<i2", None),
    "H": ("<u2", None),
    "i": ("<i4", None),
    "I": ("<u4", None),
    "q": ("<i8", None),
    "Q": ("<u8", None),
    "g": ("<f2", None),
    "f": ("<f4", None),
    "d": ("<f8", None),
    "n": ("S4", None),
    "N": ("S16", None),
    "Z": ("S64", None),
    "c": ("<i2", 100.0),
    "C": ("<u2", 100.0),
    "e": ("<i4", 100.0),
    "E": ("<u4", 100.0),
    "L": ("<i4", 1e7),
}
TEXT_CHARACTERS = "nNZa"  # neither numbers nor scaled


@dataclass(frozen=True)
class Format:
    """One message type as a file defines it.

    Attributes
    ----------
    number, length
        Type byte; bytes of the whole message, its three header bytes included.
    name, characters, fields
        As in the FMT message.
    """

    number: int
    length: int
    name: str
    characters: str
    fields: tuple[str, ...]

    def dtype(self) -> np.dtype[Any] | None:
        """Structured type of the bytes after the header; None where the format makes no sense."""
        if len(self.fields) != len(self.characters) or len(set(self.fields)) != len(self.fields):
            return None
        if not self.fields or any(c not in _NUMPY_TYPES for c in self.characters):
            return None
        dtype = np.dtype(
            [(f, _NUMPY_TYPES[c][0]) for f, c in zip(self.fields, self.characters, strict=True)]
        )
        return dtype if dtype.itemsize + 3 == self.length else None


@dataclass(frozen=True, eq=False)
class DataflashTables:
    """A DataFlash file, indexed; columns are gathered when asked for.

    Attributes
    ----------
    data
        The bytes of the file.
    formats
        By message name.
    offsets
        By message name: where its messages start.
    notes
        What was odd about the file.
    """

    data: NDArray[np.uint8]
    formats: dict[str, Format]
    offsets: dict[str, NDArray[np.int64]]
    notes: tuple[str, ...]

    def count(self, name: str) -> int:
        """How many messages of this type the file holds."""
        return len(self.offsets.get(name, ()))

    def columns(self, name: str, rows: slice = slice(None)) -> Columns:
        """Every field of one message type as a column, scaled as its format character says.

        Returns
        -------
        dict
            Field name: array over the messages in the order of the file; empty where the file
            has no such message.
        """
        if self.count(name) == 0:
            return {}
        fmt = self.formats[name]
        dtype = fmt.dtype()
        if dtype is None:
            return {}
        windows = np.lib.stride_tricks.sliding_window_view(self.data, fmt.length)
        bodies = np.ascontiguousarray(windows[self.offsets[name][rows]][:, 3:])
        records = bodies.view(dtype)[:, 0]
        return {
            field: _scaled(records[field], _NUMPY_TYPES[c][1])
            for field, c in zip(fmt.fields, fmt.characters, strict=True)
        }


def _scaled(raw: NDArray[Any], divisor: float | None) -> NDArray[Any]:
    return np.ascontiguousarray(raw) if divisor is None else raw / divisor


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
    starts = _indexed_by_pymavlink(data)
    tables = None if starts is None else _tables(data, starts)
    if tables is None or _unread(tables) > _SUSPICIOUS * len(data):
        # A damaged format message changes the length of a type: the loop tests what it believes.
        checked = _tables(data, _indexed_by_loop(data))
        tables = checked if tables is None or _unread(checked) < _unread(tables) else tables
    unread = _unread(tables)
    if not unread:
        return tables
    note = f"{unread} of {len(data)} bytes belong to no complete message"
    return replace(tables, notes=(*tables.notes, note))


def _tables(data: bytes, starts: list[list[int]]) -> DataflashTables:
    """Formats and complete messages, from the offsets of each of the 256 types."""
    formats, notes = _read_formats(data, starts[FMT_TYPE])
    offsets: dict[str, NDArray[np.int64]] = {}
    for fmt in formats.values():
        complete = np.array(starts[fmt.number], dtype=np.int64)
        complete = complete[complete + fmt.length <= len(data)]
        if len(complete):
            offsets[fmt.name] = complete
    return DataflashTables(np.frombuffer(data, dtype=np.uint8), formats, offsets, tuple(notes))


def _unread(tables: DataflashTables) -> int:
    """How many bytes belong to no complete message."""
    read = sum(len(at) * tables.formats[name].length for name, at in tables.offsets.items())
    return max(len(tables.data) - read, 0)


def _read_formats(data: bytes, starts: list[int]) -> tuple[dict[str, Format], list[str]]:
    """Formats by name; of one that is redefined the last holds, and a note says so."""
    by_number: dict[int, Format] = {}
    notes: list[str] = []
    for start in starts:
        fmt = _format_at(data, start)
        if fmt is None:
            notes.append(f"a format message at byte {start} makes no sense and was skipped")
            continue
        if by_number.get(fmt.number, fmt) != fmt:
            notes.append(f"the format of {fmt.name} changes at byte {start}; the last was used")
        by_number[fmt.number] = fmt
    return {fmt.name: fmt for fmt in by_number.values()}, notes


def _format_at(data: bytes, start: int) -> Format | None:
    """The format message that begins here; None where it is cut or makes no sense."""
    body = data[start + 3 : start + FMT_LENGTH]
    if len(body) < FMT_LENGTH - 3:
        return None
    name, characters, fields = (
        part.split(b"\0")[0].decode("latin-1") for part in (body[2:6], body[6:22], body[22:86])
    )
    fmt = Format(body[0], body[1], name, characters, tuple(fields.split(",")))
    named = re.fullmatch(r"[A-Za-z0-9_]{1,4}", name) is not None
    return fmt if named and fmt.dtype() is not None else None


def _indexed_by_pymavlink(data: bytes) -> list[list[int]] | None:
    """Pymavlink's compiled indexer (since 2.4.50); None where this pymavlink has none."""
    try:
        from pymavlink import dfindexer  # noqa: PLC0415 - absent in older releases
    except ImportError:
        return None
    if not dfindexer.available:
        return None
    with _silent_standard_error():  # it prints one line for every byte that it skips
        starts: list[list[int]] = dfindexer.build_offsets(
            memoryview(data), FMT_TYPE, FMT_LENGTH, 3, 4, HEADER[0], HEADER[1]
        )
    return starts


def _indexed_by_loop(data: bytes) -> list[list[int]]:
    """The same without the compiled indexer; believes format messages that make sense only."""
    starts: list[list[int]] = [[] for _ in range(256)]
    lengths = [0] * 256
    lengths[FMT_TYPE] = FMT_LENGTH
    at = data.find(HEADER)
    while 0 <= at < len(data) - 2:
        number = data[at + 2]
        fmt = _format_at(data, at) if number == FMT_TYPE else None
        if fmt is not None and lengths[fmt.number] == 0:
            lengths[fmt.number] = fmt.length
        if not lengths[number] or (number == FMT_TYPE and fmt is None):
            at = data.find(HEADER, at + 1)
            continue
        starts[number].append(at)
        end = at + lengths[number]
        # where no message follows, bytes are missing or damaged: look from inside this one
        at = end if data[end : end + 2] == HEADER else data.find(HEADER, at + 3)
    return starts


@contextmanager
def _silent_standard_error() -> Iterator[None]:
    """Send file descriptor 2 to nowhere: C code does not write through sys.stderr."""
    kept = os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)
