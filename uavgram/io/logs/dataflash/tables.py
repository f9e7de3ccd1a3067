"""Messages of ArduPilot's DataFlash log as columns, decoded on demand.

The layout is ArduPilot's (libraries/AP_Logger/LogStructure.h): every message starts with 0xA3 0x95
and its type; type 0x80 (FMT) defines the others: length, name, one format character per field,
field names. A message may have no field at all (STRT until 2014: the vehicle was started). Logs in
text form (.log), as written by Mission Planner, have the same messages line by line.

The format has no checksum: users of these columns must check the values.
"""

from __future__ import annotations

import os
import re
from abc import ABC, abstractmethod
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from uavgram.errors import InputError

Columns = dict[str, NDArray[Any]]

HEADER = b"\xa3\x95"
FMT_TYPE, FMT_LENGTH = 0x80, 89

# Format character: numpy type, and divisor of the stored integer. Division, not multiplication by
# 0.01 or 1e-7: 12345 / 100 is the double nearest to 123.45.
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
_PLACE, _ANGLES = ("TimeUS", "Lat", "Lng", "Alt"), ("TimeUS", "Roll", "Pitch", "Yaw")
# order of the fields read here, in every firmware since 3.3
_ORDERS: dict[str, tuple[tuple[str, ...], ...]] = {
    "POS": ((*_PLACE, "RelHomeAlt"),),
    "GPS": (_PLACE,),
    "ORGN": (("TimeUS", "Type", "Lat", "Lng", "Alt"),),
    "ATT": (_ANGLES, ("DesRoll", "Roll", "DesPitch", "Pitch", "DesYaw", "Yaw")),
    "MNT": (("TimeUS", "DRoll", "Roll", "DPitch", "Pitch", "DYawB", "YawB", "DYawE", "YawE"),),
}
TEXT_CHARACTERS = "nNZa"  # neither numbers nor scaled


@lru_cache(maxsize=1024)
def _record_type(fields: tuple[str, ...], characters: str) -> np.dtype[Any] | None:
    if len(fields) != len(characters) or len(set(fields)) != len(fields) or not all(fields):
        return None
    if any(c not in _NUMPY_TYPES for c in characters):
        return None
    return np.dtype([(f, _NUMPY_TYPES[c][0]) for f, c in zip(fields, characters, strict=True)])


@dataclass(frozen=True)
class Format:
    """One message type as defined in a file.

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
        """Return the structured type of the bytes after the header; None for an invalid format."""
        dtype = _record_type(self.fields, self.characters)
        return dtype if dtype is not None and dtype.itemsize + 3 == self.length else None

    def decode(self, data: NDArray[np.uint8], starts: NDArray[np.int64]) -> Columns:
        """Return every field as a column, scaled according to its format character.

        Parameters
        ----------
        data
            Bytes of the file.
        starts
            (N,) offsets of complete messages of this format.
        """
        dtype = self.dtype()
        if not dtype:  # no format, or one without fields
            return {}
        # view of records starting at every byte, to gather those behind the headers
        room = len(data) - self.length + 1
        records = np.ndarray((room,), dtype, data, offset=3, strides=(1,))[starts]
        return {
            field: _divide(records[field], _NUMPY_TYPES[c][1])
            for field, c in zip(self.fields, self.characters, strict=True)
        }


def _divide(raw: NDArray[Any], divisor: float | None) -> NDArray[Any]:
    return np.ascontiguousarray(raw) if divisor is None else raw / divisor


FMT = Format(FMT_TYPE, FMT_LENGTH, "FMT", "BBnNZ", ("Type", "Length", "Name", "Format", "Columns"))
"""Layout of all format messages.

Logs of 2012 to 2014 state it with one name too few, so the definition in a log is not used.
"""


def split_field_names(names: str) -> tuple[str, ...]:
    """Return the field names of a format message, which joins them by commas."""
    return tuple(names.split(",")) if names else ()


def check_field_names(fmt: Format) -> tuple[str, ...]:
    """Return a remark if no firmware writes a message of this name with its fields in this order.

    The names are then damaged or exchanged: every value of the message has another field's name, or
    the gimbal's messages have an unknown name.
    """
    if fmt.name != "MNT" and {"Roll", "Pitch", "YawB", "YawE"} <= set(fmt.fields):
        return (f"{fmt.name} messages look like the gimbal's (MNT): not used, their name is odd",)
    for order in _ORDERS.get(fmt.name, ()):
        stated = [fmt.fields.index(field) for field in order if field in fmt.fields]
        if stated != sorted(stated):
            text = f"the format of {fmt.name} names {', '.join(order)} in an order of no firmware"
            return (f"{text}: its values may have wrong names",)
    return ()


def format_at(data: bytes, start: int) -> Format | None:
    """Return the format message at this offset; None if it is incomplete or invalid."""
    return _format_of(data[start + 3 : start + FMT_LENGTH])


@lru_cache(maxsize=1024)  # a log states some 200 formats, each read twice
def _format_of(body: bytes) -> Format | None:
    """Parse a format message without its header; None as in `format_at`."""
    if len(body) < FMT_LENGTH - 3:
        return None
    name, characters, fields = (
        part.split(b"\0")[0].decode("latin-1") for part in (body[2:6], body[6:22], body[22:86])
    )
    if (body[0], body[1], name) == (FMT.number, FMT.length, FMT.name):
        return FMT
    fmt = Format(body[0], body[1], name, characters, split_field_names(fields))
    named = re.fullmatch(r"[A-Za-z0-9_]{1,4}", name) is not None
    return fmt if named and fmt.dtype() is not None else None


_LONGEST_TEXT = 64  # bytes of format Z; a damaged line may be longer


@dataclass(frozen=True, eq=False)
class FormatPiece:
    """Messages of one type under one format, which may change within a file.

    Attributes
    ----------
    format
        Of all of them.
    starts
        Their offsets, increasing; all are complete.
    """

    format: Format
    starts: list[int]


@dataclass(frozen=True, eq=False)
class Tables(ABC):
    """The messages of a log by type.

    Attributes
    ----------
    pieces
        By message name, in the order of the file: one for each format of that name in the file.
    notes
        Irregularities of the file.
    """

    pieces: dict[str, tuple[FormatPiece, ...]]
    notes: tuple[str, ...]

    @abstractmethod
    def decode(self, fmt: Format, starts: list[int]) -> Columns:
        """Return every field of the messages at these offsets, as columns."""

    @property
    def names(self) -> tuple[str, ...]:
        """Message types in the file, sorted."""
        return tuple(sorted(self.pieces))

    def count(self, name: str) -> int:
        """Return the number of messages of this type."""
        return sum(len(piece.starts) for piece in self.pieces.get(name, ()))

    def places(self, name: str) -> NDArray[np.int64]:
        """Return the (N,) offsets of the messages of one type, in the order of `columns`."""
        starts = (piece.starts for piece in self.pieces.get(name, ()))
        return np.array([at for piece in starts for at in piece], dtype=np.int64)

    def columns(self, name: str) -> Columns:
        """Return every field of one message type as a column, scaled by its format character.

        Returns
        -------
        dict
            Field name: array over the messages in the order of the file; empty where the file has
            no such message. A field that a part of the file does not define is NaN (empty, for a
            text) there.
        """
        return self._join_parts([(p.format, p.starts) for p in self.pieces.get(name, ())])

    def ends(self, name: str) -> Columns:
        """Return the columns of the first and the last message of one type only."""
        pieces = self.pieces.get(name, ())
        if not pieces:
            return {}
        first, last = pieces[0], pieces[-1]
        if first is last:
            return self._join_parts([(first.format, [first.starts[0], first.starts[-1]])])
        return self._join_parts([(first.format, first.starts[:1]), (last.format, last.starts[-1:])])

    def between(self, start: int, end: int) -> Self:
        """Return the messages that begin in this range of bytes."""
        found: dict[str, tuple[FormatPiece, ...]] = {}
        for name, whole in self.pieces.items():
            cut = [replace(p, starts=select_inside(p.starts, start, end)) for p in whole]
            if kept := tuple(piece for piece in cut if piece.starts):
                found[name] = kept
        return replace(self, pieces=found)

    def _join_parts(self, parts: list[tuple[Format, list[int]]]) -> Columns:
        decoded = [(fmt, self.decode(fmt, starts)) for fmt, starts in parts]
        if len(decoded) < 2:
            return decoded[0][1] if decoded else {}
        fields = dict.fromkeys(field for fmt, _ in decoded for field in fmt.fields)
        return {field: np.concatenate(_alike(decoded, field)) for field in fields}


def select_inside(starts: list[int], start: int, end: int) -> list[int]:
    """Return the offsets in a range of the file.

    Parameters
    ----------
    starts
        Offsets in bytes, increasing.
    start, end
        First byte of the range, and the one after it.
    """
    return starts[bisect_left(starts, start) : bisect_left(starts, end)]


def _alike(decoded: list[tuple[Format, Columns]], field: str) -> list[NDArray[np.generic]]:
    """Return the same field of every part, filled where one lacks it or has another kind."""
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


@dataclass(frozen=True, eq=False)
class TextTables(Tables):
    """A DataFlash text file, whose values are already scaled; `data` are its bytes."""

    data: bytes

    def decode(self, fmt: Format, starts: list[int]) -> Columns:
        """Return every field of the lines at these offsets, as columns."""
        fields = zip(*(self._fields(at, len(fmt.fields)) for at in starts), strict=True)
        return {
            field: _numbers(texts) if c not in TEXT_CHARACTERS else _texts(texts)
            for field, c, texts in zip(fmt.fields, fmt.characters, fields, strict=True)
        }

    def _fields(self, start: int, count: int) -> tuple[bytes, ...]:
        """Return the fields of one line; commas beyond the last field belong to its text."""
        end = self.data.find(b"\n", start)
        line = self.data[start : end if end >= 0 else len(self.data)]
        _, *fields = line.split(b",", count)
        # fewer where the format was redefined
        return (*fields, *(b"" for _ in range(count - len(fields))))


def _numbers(texts: Sequence[bytes]) -> NDArray[np.float64]:
    """Convert texts to float64, NaN for invalid ones."""
    try:
        return np.array([float(text) for text in texts])
    except ValueError:
        return np.array([_number(text) for text in texts])


def _texts(texts: Sequence[bytes]) -> NDArray[np.bytes_]:
    return np.array([text.strip()[:_LONGEST_TEXT] for text in texts], dtype=np.bytes_)


def _number(text: bytes) -> float:
    try:
        return float(text)
    except ValueError:
        return np.nan


def index_text(path: str, data: bytes) -> TextTables:
    """Split a text log into its messages.

    Raises
    ------
    InputError
        There is no FMT line in the file.
    """
    formats: dict[str, Format] = {}
    pieces: dict[str, list[FormatPiece]] = {}
    notes: list[str] = []
    skipped = at = 0
    while at < len(data):
        end = data.find(b"\n", at)
        end = end if end >= 0 else len(data)
        comma = data.find(b",", at, end)
        key = data[at : comma if comma >= 0 else end].strip().decode("latin-1")
        if key == "FMT":
            notes += _add_format(formats, pieces, data[at:end], at)
        elif key in formats and data.count(b",", at, end) >= len(formats[key].fields):
            parts = pieces.setdefault(key, [])
            if not parts or parts[-1].format is not formats[key]:
                parts.append(FormatPiece(formats[key], []))
            parts[-1].starts.append(at)
        elif data[at:end].strip():
            skipped += 1
        at = end + 1
    if not formats:
        raise InputError(path, "is no DataFlash log in text form: it has no FMT line")
    if skipped:
        notes.append(f"{skipped} lines belong to no defined message")
    return TextTables({name: tuple(parts) for name, parts in pieces.items()}, tuple(notes), data)


def _add_format(
    formats: dict[str, Format], pieces: dict[str, list[FormatPiece]], line: bytes, at: int
) -> list[str]:
    """Record a FMT line, if it is valid; return remarks on irregularities."""
    _, *fields = (part.strip() for part in line.decode("latin-1").split(","))
    if len(fields) < 5:
        return []
    number, length, name, characters, *names = fields
    if name == FMT.name:
        formats[name] = FMT
        return []
    names = list(split_field_names(",".join(names)))
    distinct = len(set(names)) == len(names) == len(characters)
    if not (_is_small(number) and _is_small(length) and distinct):
        return [f"a format message at byte {at} makes no sense and was skipped"]
    stated = Format(int(number), int(length), name, characters, tuple(names))
    known = formats.get(name)
    if known == stated:
        return []
    formats[name] = stated
    return [f"the format of {name} changes at byte {at}"] if name in pieces else []


def _is_small(text: str) -> bool:
    """Return whether a text is a number of a few digits."""
    return text.isascii() and text.isdecimal() and len(text) < 6


#: Offsets of the messages of each of the 256 types, in the order of the file.
Starts = list[list[int]]

_SUSPICIOUS = 0.01  # share of unread bytes above which the index is made again


@dataclass(frozen=True, eq=False)
class BinaryTables(Tables):
    """A binary DataFlash file, indexed; `data` are its bytes."""

    data: NDArray[np.uint8]

    def decode(self, fmt: Format, starts: list[int]) -> Columns:
        """Return every field of the messages at these offsets, as columns."""
        return fmt.decode(self.data, np.array(starts, dtype=np.int64))


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
