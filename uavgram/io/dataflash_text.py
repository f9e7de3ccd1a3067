"""DataFlash logs in text form (.log), as Mission Planner writes them: the same columns."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavgram.errors import InputError
from uavgram.io.dataflash_formats import TEXT_CHARACTERS, Columns, Format

_LONGEST_TEXT = 64  # bytes of format Z; a damaged line may be longer


@dataclass(frozen=True, eq=False)
class TextTables:
    """A DataFlash text file; the same interface as `DataflashTables`.

    Attributes
    ----------
    data
        The bytes of the file.
    formats
        By message name; of one that is redefined the last holds.
    starts
        By message name: where its lines begin, increasing.
    notes
        What was odd about the file.
    """

    data: bytes
    formats: dict[str, Format]
    starts: dict[str, list[int]]
    notes: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Message types that the file holds, sorted."""
        return tuple(sorted(self.starts))

    def count(self, name: str) -> int:
        """How many messages of this type the file holds."""
        return len(self.starts.get(name, ()))

    def places(self, name: str) -> NDArray[np.int64]:
        """(N,) where the lines of one type begin."""
        return np.array(self.starts.get(name, ()), dtype=np.int64)

    def columns(self, name: str) -> Columns:
        """Every field of one message type as a column; text forms carry scaled values."""
        return self._decoded(name, self.starts.get(name, []))

    def ends(self, name: str) -> Columns:
        """The columns of the first and the last message of one type only."""
        starts = self.starts.get(name, [])
        return self._decoded(name, [*starts[:1], *starts[-1:]])

    def _decoded(self, name: str, starts: list[int]) -> Columns:
        if not starts:
            return {}
        fmt = self.formats[name]
        fields = zip(*(self._fields(at, len(fmt.fields)) for at in starts), strict=True)
        return {
            field: _numbers(texts) if c not in TEXT_CHARACTERS else _texts(texts)
            for field, c, texts in zip(fmt.fields, fmt.characters, fields, strict=True)
        }

    def _fields(self, start: int, count: int) -> tuple[bytes, ...]:
        """The fields of one line; commas beyond the last field belong to its text."""
        end = self.data.find(b"\n", start)
        line = self.data[start : end if end >= 0 else len(self.data)]
        _, *fields = (part.strip() for part in line.split(b",", count))
        # fewer where the format was defined anew
        return (*fields, *(b"" for _ in range(count - len(fields))))

    def between(self, start: int, end: int) -> TextTables:
        """The messages that begin in this range of bytes."""
        inside = {
            name: at[bisect_left(at, start) : bisect_left(at, end)]
            for name, at in self.starts.items()
        }
        return replace(self, starts={name: at for name, at in inside.items() if at})


def _numbers(texts: Sequence[bytes]) -> NDArray[np.float64]:
    """Texts as float64, NaN where one is no number."""
    try:
        return np.array([float(text) for text in texts])
    except ValueError:
        return np.array([_number(text) for text in texts])


def _texts(texts: Sequence[bytes]) -> NDArray[np.bytes_]:
    return np.array([text[:_LONGEST_TEXT] for text in texts], dtype=np.bytes_)


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
    starts: dict[str, list[int]] = {}
    skipped = at = 0
    while at < len(data):
        end = data.find(b"\n", at)
        end = end if end >= 0 else len(data)
        comma = data.find(b",", at, end)
        key = data[at : comma if comma >= 0 else end].strip().decode("latin-1")
        if key == "FMT":
            _add_format(formats, data[at:end])
        elif key in formats and data.count(b",", at, end) >= len(formats[key].fields):
            starts.setdefault(key, []).append(at)
        elif data[at:end].strip():
            skipped += 1
        at = end + 1
    if not formats:
        raise InputError(path, "is no DataFlash log in text form: it has no FMT line")
    notes = (f"{skipped} lines belong to no defined message",) if skipped else ()
    return TextTables(data, formats, starts, notes)


def _add_format(formats: dict[str, Format], line: bytes) -> None:
    """Note what a FMT line states, where it makes sense."""
    _, *fields = (part.strip() for part in line.decode("latin-1").split(","))
    if len(fields) < 5:
        return
    number, length, name, characters, *names = fields
    distinct = len(set(names)) == len(names) == len(characters) > 0
    if number.isdecimal() and length.isdecimal() and distinct:
        formats[name] = Format(int(number), int(length), name, characters, tuple(names))
