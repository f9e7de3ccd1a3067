"""DataFlash logs in text form (.log), as Mission Planner writes them: the same columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavgram.errors import InputError
from uavgram.io.logs.dataflash.formats import FMT, TEXT_CHARACTERS, Columns, Format, fields_of
from uavgram.io.logs.dataflash.tables import Piece, Tables

_LONGEST_TEXT = 64  # bytes of format Z; a damaged line may be longer


@dataclass(frozen=True, eq=False)
class TextTables(Tables):
    """A DataFlash text file, whose values are scaled already; `data` are its bytes."""

    data: bytes

    def decoded(self, fmt: Format, starts: list[int]) -> Columns:
        """Every field of the lines that begin there, as columns."""
        fields = zip(*(self._fields(at, len(fmt.fields)) for at in starts), strict=True)
        return {
            field: _numbers(texts) if c not in TEXT_CHARACTERS else _texts(texts)
            for field, c, texts in zip(fmt.fields, fmt.characters, fields, strict=True)
        }

    def _fields(self, start: int, count: int) -> tuple[bytes, ...]:
        """The fields of one line; commas beyond the last field belong to its text."""
        end = self.data.find(b"\n", start)
        line = self.data[start : end if end >= 0 else len(self.data)]
        _, *fields = line.split(b",", count)
        # fewer where the format was defined anew
        return (*fields, *(b"" for _ in range(count - len(fields))))


def _numbers(texts: Sequence[bytes]) -> NDArray[np.float64]:
    """Texts as float64, NaN where one is no number."""
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
    pieces: dict[str, list[Piece]] = {}
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
                parts.append(Piece(formats[key], []))
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
    formats: dict[str, Format], pieces: dict[str, list[Piece]], line: bytes, at: int
) -> list[str]:
    """Note what a FMT line states, where it makes sense; what was odd about it."""
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
    """Whether a text is a number of a few digits."""
    return text.isascii() and text.isdecimal() and len(text) < 6
