"""CSV tables that people write: strict, with the line of every cell and all mistakes at once."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from uavgram.errors import InputError, near_miss
from uavgram.model.arrays import Floats, Ints
from uavgram.model.limits import LARGEST_NUMBER, length_fault, name_fault, sigma_fault

_NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")
UNSHOWABLE = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff\ufffe\uffff]")
"""Characters that no name can hold: they break lines, drive terminals, or are no XML."""
_BYTE_ORDER_MARKS_16 = (b"\xff\xfe", b"\xfe\xff")


@dataclass(frozen=True)
class Columns:
    """What a table may hold.

    Attributes
    ----------
    text, numbers
        Columns that every file must have, with no empty cell.
    optional_text, optional_numbers
        Columns that may be absent, or have empty cells.
    others
        Whether a person may keep columns of their own in the table, which are not read. A name
        close to that of a column which is not there is a mistake all the same.
    """

    text: tuple[str, ...]
    numbers: tuple[str, ...] = ()
    optional_text: tuple[str, ...] = ()
    optional_numbers: tuple[str, ...] = ()
    others: bool = False

    @property
    def required(self) -> tuple[str, ...]:
        """Names of the columns that every file must have."""
        return (*self.text, *self.numbers)

    @property
    def known(self) -> tuple[str, ...]:
        """Names of all columns."""
        return (*self.required, *self.optional_text, *self.optional_numbers)


@dataclass
class Table:
    """A table as columns, while a reader still looks for mistakes in it.

    Attributes
    ----------
    path
        The file.
    line
        (N,) line number of each row.
    header
        Names of the columns that the file has.
    text, numbers
        Columns by name, each (N,); an empty cell is "" or NaN. Optional columns are there even
        where the file has none.
    faults
        Mistakes found so far: pairs of line and message.
    """

    path: Path
    line: Ints
    header: tuple[str, ...]
    text: dict[str, tuple[str, ...]]
    numbers: dict[str, Floats]
    faults: list[tuple[int | None, str]] = field(default_factory=list)

    def blame(self, row: int, message: str) -> None:
        """Note a mistake in a row."""
        self.faults.append((int(self.line[row]), message))

    def raise_faults(self) -> None:
        """Raise one error that names every mistake noted so far, if there is any."""
        if self.faults:
            raise InputError.of_all(self.path, self.faults)

    def require_length(self, name: str) -> None:
        """Note every number of a column that can be no length (empty cells pass)."""
        for row in np.flatnonzero(np.isfinite(self.numbers[name])):
            value = self.numbers[name][row]
            if fault := length_fault(float(value)):
                self.blame(int(row), f"{name} {fault} (got {value:g})")

    def require_short(self, *names: str) -> None:
        """Note every name that is too long."""
        for name in names:
            for row, text in enumerate(self.text[name]):
                if fault := name_fault(text):
                    self.blame(row, f"{name} {fault} (it begins with {text[:32]!r})")

    def require_sigma(self, name: str) -> None:
        """Note every number of a column that can be no standard deviation (empty cells pass)."""
        for row in np.flatnonzero(np.isfinite(self.numbers[name])):
            value = self.numbers[name][row]
            if fault := sigma_fault(float(value)):
                self.blame(int(row), f"{name} {fault} (got {value:g})")

    def require_unique(self, name: str, what: str) -> None:
        """Note every text of a column that stands in an earlier row too."""
        first: dict[str, int] = {}
        for row, word in enumerate(self.text[name]):
            if word and word in first:
                earlier = self.line[first[word]]
                self.blame(
                    row, f"{what} {word!r} stands in line {earlier} already: rename or remove one"
                )
            first.setdefault(word, row)


def read_table(path: str | Path, columns: Columns) -> Table:
    """Read a CSV file with a header: UTF-8 with or without byte order mark, comma, blank lines.

    Returns
    -------
    Table
        Its `faults` name wrong cells; the caller adds its own and calls `raise_faults`.

    Raises
    ------
    InputError
        The file cannot be read, or its header or the number of cells of a row is wrong: then
        nothing can be said about the cells.
    """
    path = Path(path)
    records = _records(path)
    if not records:
        wanted = ",".join(columns.required)
        raise InputError(path, f"the file is empty: its first line must be {wanted}", 1)
    (header_line, header), rows = records[0], records[1:]
    if len(header) == 1 and (separator := re.search("[;\t]", header[0])):
        used = "semicolons" if separator[0] == ";" else "tabs"
        raise InputError(
            path,
            f"the cells are separated by {used}: save the table as CSV with commas, and with "
            "decimal points",
            header_line,
        )
    faults: list[tuple[int | None, str]] = [
        (header_line, text) for text in _header_faults(header, columns)
    ]
    faults += [
        (line, f"{len(cells)} cells, but the header has {len(header)}")
        for line, cells in rows
        if len(cells) != len(header)
    ]
    if faults:
        raise InputError.of_all(path, faults)
    table = Table(path, np.array([line for line, _ in rows], np.int64), tuple(header), {}, {})
    for name in columns.known:
        at = header.index(name) if name in header else None
        cells = ["" if at is None else row[at] for _, row in rows]
        if name in columns.required:
            for row in (i for i, cell in enumerate(cells) if not cell):
                table.blame(row, f"{name} is empty")
        if name in columns.text or name in columns.optional_text:
            table.text[name] = tuple(cells)
            for row in (i for i, cell in enumerate(cells) if UNSHOWABLE.search(cell)):
                table.blame(row, f"{name} holds {_unshowable(cells[row])}: type it again")
        else:
            table.numbers[name] = _numbers(table, name, cells)
    return table


def _records(path: Path) -> list[tuple[int, list[str]]]:
    """Split a file into (line, stripped cells), blank lines left out."""
    reader = csv.reader(io.StringIO(_read_text(path), newline=""), strict=True)
    records = []
    line = 1
    try:
        for cells in reader:
            stripped = [cell.strip() for cell in cells]
            if any(stripped):  # spreadsheets write blank lines as ,,,
                records.append((line, stripped))
            line = reader.line_num + 1  # a quoted cell may hold line breaks
    except csv.Error as fault:
        raise InputError(
            path, f'is not valid CSV: {fault}; is a quote (") missing?', line
        ) from fault
    return records


def _read_text(path: Path) -> str:
    try:
        data = path.read_bytes()
    except OSError as fault:
        raise InputError(path, f"cannot be read: {fault.strerror}") from fault
    if data.startswith(_BYTE_ORDER_MARKS_16) or _looks_like_utf_16(data):
        raise InputError(path, "is UTF-16 text: save it as CSV UTF-8", 1)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as fault:
        line = data.count(b"\n", 0, fault.start) + 1
        raise InputError(path, "is not UTF-8 text: save it as CSV UTF-8", line) from fault


def _looks_like_utf_16(data: bytes) -> bool:
    """Whether every other byte is 0, as in Latin text of two bytes a character."""
    start = data[:64]
    return b"\0" in start and not (any(start[::2]) and any(start[1::2]))


def _unshowable(cell: str) -> str:
    """Say which character of a cell cannot be shown."""
    found = UNSHOWABLE.search(cell)
    character = found[0] if found else ""
    return "a line break" if character in "\r\n" else f"the control character {character!r}"


def _header_faults(header: Sequence[str], columns: Columns) -> list[str]:
    faults = [
        f"column {name!r} is there twice: remove one"
        for name in dict.fromkeys(header)
        if header.count(name) > 1
    ]
    missing = [name for name in columns.required if name not in header]
    faults += [f"column {name!r} is missing: the header must have it" for name in missing]
    absent = [name for name in columns.known if name not in header]
    for name in dict.fromkeys(header):
        if name in columns.known:
            continue
        hint = near_miss(name, absent if columns.others else columns.known)
        if hint or not (columns.others and name):
            known = f"known are {', '.join(columns.known)}"
            faults.append(f"unknown column {name!r}: {hint or known}")
    return faults


def own_columns(path: str | Path, columns: Columns) -> tuple[str, ...]:
    """Names of the columns that a person keeps in a table and that are not read."""
    header = _records(Path(path))[0][1]
    return tuple(name for name in header if name not in columns.known)


def _numbers(table: Table, name: str, cells: Sequence[str]) -> Floats:
    """(N,) numbers of a column; NaN, and a fault, for what is none."""
    values = np.full(len(cells), np.nan)
    for row, cell in enumerate(cells):
        if not cell:
            continue
        number = parse_number(cell)
        if number is None:
            table.blame(row, f"{name} must be a number (got {cell!r}){number_hint(cell)}")
        else:
            values[row] = number
    return values


def parse_number(text: str) -> float | None:
    """Read a decimal number of at most LARGEST_NUMBER; None for anything else (nan, inf, 1_000)."""
    value = float(text) if _NUMBER.fullmatch(text) else np.inf
    return value if abs(value) <= LARGEST_NUMBER else None


def number_hint(text: str) -> str:
    """Say why some text that looks like a number is none."""
    if _NUMBER.fullmatch(text):
        return ": it is far too large"
    if re.fullmatch(r"[-+]?[0-9.]*,[0-9]+", text):
        return ": write a decimal point, not a comma"
    if re.fullmatch(r"[-+]?[0-9.]+\s*[a-zA-Z°]+", text):
        return ": write the number alone, the column's name says the unit"
    return ""
