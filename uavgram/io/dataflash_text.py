"""DataFlash logs in text form (.log), as Mission Planner writes them: the same columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uavgram.errors import InputError
from uavgram.io.dataflash_tables import TEXT_CHARACTERS, Columns, Format


@dataclass(frozen=True, eq=False)
class TextTables:
    """A DataFlash text file; the same interface as `DataflashTables`.

    Attributes
    ----------
    formats
        By message name.
    rows
        By message name: the fields of each line, as text.
    notes
        What was odd about the file.
    """

    formats: dict[str, Format]
    rows: dict[str, list[tuple[str, ...]]]
    notes: tuple[str, ...]

    def count(self, name: str) -> int:
        """How many messages of this type the file holds."""
        return len(self.rows.get(name, ()))

    def columns(self, name: str, rows: slice = slice(None)) -> Columns:
        """Every field of one message type as a column; text forms carry scaled values."""
        if self.count(name) == 0:
            return {}
        fmt = self.formats[name]
        fields = zip(*self.rows[name][rows], strict=True)
        return {
            field: _numbers(texts) if c not in TEXT_CHARACTERS else np.array(texts, dtype=np.bytes_)
            for field, c, texts in zip(fmt.fields, fmt.characters, fields, strict=True)
        }


def _numbers(texts: Sequence[str]) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Texts as float64, NaN where one is no number."""
    try:
        return np.array(texts, dtype=np.float64)
    except ValueError:
        return np.array([_number(text) for text in texts])


def _number(text: str) -> float:
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
    rows: dict[str, list[tuple[str, ...]]] = {}
    skipped = 0
    for line in data.decode("latin-1").splitlines():
        name, *fields = (part.strip() for part in line.split(","))
        if name == "FMT" and len(fields) >= 4:
            _add_format(formats, fields)
        elif name in formats and len(fields) >= len(formats[name].fields):
            rows.setdefault(name, []).append(_joined(fields, len(formats[name].fields)))
        elif line.strip():
            skipped += 1
    if not formats:
        raise InputError(path, "is no DataFlash log in text form: it has no FMT line")
    notes = (f"{skipped} lines belong to no defined message",) if skipped else ()
    return TextTables(formats, rows, notes)


def _add_format(formats: dict[str, Format], fields: list[str]) -> None:
    number, length, name, characters, *names = fields
    if number.isdigit() and length.isdigit() and len(names) == len(characters):
        formats[name] = Format(int(number), int(length), name, characters, tuple(names))


def _joined(fields: list[str], count: int) -> tuple[str, ...]:
    """Commas beyond the last field belong to its text."""
    return (*fields[: count - 1], ", ".join(fields[count - 1 :]))
