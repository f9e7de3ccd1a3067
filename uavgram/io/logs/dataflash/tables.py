"""Messages of a DataFlash log by type, in binary or text form; columns are decoded on demand.

Logs in text form (.log), as written by Mission Planner, are indexed here.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from uavgram.errors import InputError
from uavgram.io.logs.dataflash.formats import FMT, TEXT_CHARACTERS, Columns, Format, fields_of

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
    def decoded(self, fmt: Format, starts: list[int]) -> Columns:
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
        return self._joined([(p.format, p.starts) for p in self.pieces.get(name, ())])

    def ends(self, name: str) -> Columns:
        """Return the columns of the first and the last message of one type only."""
        pieces = self.pieces.get(name, ())
        if not pieces:
            return {}
        first, last = pieces[0], pieces[-1]
        if first is last:
            return self._joined([(first.format, [first.starts[0], first.starts[-1]])])
        return self._joined([(first.format, first.starts[:1]), (last.format, last.starts[-1:])])

    def between(self, start: int, end: int) -> Self:
        """Return the messages that begin in this range of bytes."""
        found: dict[str, tuple[FormatPiece, ...]] = {}
        for name, whole in self.pieces.items():
            cut = [replace(p, starts=select_inside(p.starts, start, end)) for p in whole]
            if kept := tuple(piece for piece in cut if piece.starts):
                found[name] = kept
        return replace(self, pieces=found)

    def _joined(self, parts: list[tuple[Format, list[int]]]) -> Columns:
        decoded = [(fmt, self.decoded(fmt, starts)) for fmt, starts in parts]
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

    def decoded(self, fmt: Format, starts: list[int]) -> Columns:
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
    names = list(fields_of(",".join(names)))
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
