"""CSV tables written by users: strict reading, with the line of every cell.

A spreadsheet executes a cell that begins with ``=``, ``+``, ``-`` or ``@`` (also in their
full-width forms, and after a tab or a line break), so ``=cmd|...`` as the name of a measurement
would start a program (owasp.org, "CSV Injection"). An apostrophe before it makes it text. Where a
semicolon separates cells, as in half of Europe, the text after one begins a cell too. A number
stays a number.

``readable(guarded(text)) == text`` for every text. Text that was never guarded is read unchanged,
except text that begins with an apostrophe and a formula: this apostrophe is taken as a guard.
"""

from __future__ import annotations

import csv
import io
import itertools
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from uavgram import input_files
from uavgram.errors import InputError, suggest_spelling
from uavgram.model import limits
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.limits import (
    LARGEST_NUMBER,
    LONGEST_NAME,
    UNSHOWABLE,
    find_choice_fault,
    find_name_fault,
    find_unshowable,
    find_value_fault,
    has_decimal_comma,
    range_of,
    replace_decimal_comma,
)
from uavgram.model.naming import format_digits, join_names

_LINE = re.compile(r"[^\r\n]+")
_BLOCK = 10_000  # rows at a time
_MAX_LINE_CHARACTERS = 100_000  # a cell may be as long for the csv module
NAMES = {"name", "label", "tie", "from", "to", "tape"}
"""Columns whose cells are names."""


class Block(NamedTuple):
    """Rows of a file: the line of each, and the cells of each column (not stripped).

    Attributes
    ----------
    line
        (N,) numbers.
    columns
        As many as the header has, (N,) cells each; none where a row is torn.
    torn
        Line and number of cells of rows that have more or fewer cells than the header.
    """

    line: Sequence[int]
    columns: Sequence[Sequence[str]]
    torn: Sequence[tuple[int, int]]


def read_header(path: Path) -> tuple[int, list[str]] | None:
    """Read line and stripped cells of the first line that is not blank; None where all are."""
    return next(
        ((line, _strip_cells(cells)) for line, cells in _records(path, read_text(path))), None
    )


def read_blocks(path: Path) -> Iterator[Block]:
    """Read all rows after the header, without blank lines.

    Raises
    ------
    InputError
        The file cannot be read, or is not CSV.
    """
    text = read_text(path)
    if '"' in text:
        records = _records(path, text)
        width = len(next(records)[1])
        while rows := list(itertools.islice(records, _BLOCK)):
            yield _block(rows, width)
        return
    mark = find_separator(text)
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    at, header = next(_records(path, text))
    width = len(header)
    for first in range(at, len(lines), _BLOCK):
        block = lines[first : first + _BLOCK]
        yield _plain_block(block, first + 1, width, mark) or _block(
            [(first + line, cells) for line, cells in _records(path, "\n".join(block), mark)], width
        )


def _plain_block(lines: Sequence[str], first: int, width: int, mark: str) -> Block | None:
    """Split lines without quotes, none of them blank or torn; None where this does not hold."""
    if {line.count(mark) for line in lines} != {width - 1} or max(
        map(len, lines)
    ) > _MAX_LINE_CHARACTERS:
        return None
    cells = mark.join(lines).split(mark)
    columns = [cells[k::width] for k in range(width)]
    if not all(map(str.strip, columns[0])):
        return None  # it may be blank
    return Block(range(first, first + len(lines)), columns, ())


def _block(rows: Sequence[tuple[int, list[str]]], width: int) -> Block:
    torn = [(line, len(cells)) for line, cells in rows if len(cells) != width]
    if torn or not rows:
        return Block([], [[] for _ in range(width)], torn)
    lines, cells = zip(*rows, strict=True)
    return Block(lines, list(zip(*cells, strict=True)), ())


def csv_text(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Format a new table with commas, and quotes where cells need them."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue()


def find_separator(text: str) -> str:
    """Return the separator of a table: a semicolon where its header has one and no comma."""
    lines = (match[0] for match in _LINE.finditer(text))
    header = next((line for line in lines if line.strip(" ,;")), "")
    return ";" if ";" in header and "," not in header else ","


def may_hold_commas(path: Path) -> bool:
    """Return whether cells of a table can hold commas: in quotes, or between semicolons."""
    text = read_text(path)
    return '"' in text or find_separator(text) == ";"


def _records(path: Path, text: str, mark: str = "") -> Iterator[tuple[int, list[str]]]:
    """Yield line and cells of each row that is not blank; `mark` is the separator, if known."""
    mark = mark or find_separator(text)
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=mark, strict=True)
    line = 1
    try:
        for cells in reader:
            if any(map(str.strip, cells)):  # spreadsheets write blank lines as ,,,
                yield line, cells
            line = reader.line_num + 1  # a quoted cell may hold line breaks
    except csv.Error as fault:
        raise InputError(
            path, f'is not valid CSV: {fault}; is a quote (") missing?', line
        ) from fault


def _strip_cells(cells: Sequence[str]) -> list[str]:
    return list(map(str.strip, cells))


def read_text(path: Path) -> str:
    """Read a file in UTF-8, without byte order mark."""
    return input_files.read_text(path, "save it as CSV UTF-8")


_PLAIN_NUMBER = re.compile(r"[-+]?([0-9]+[.,]?[0-9]*|[.,][0-9]+)([eE][-+]?[0-9]+)?")
_FORMULA = re.compile(r"[\s'\0]*[=+\-@\uff1d\uff0b\uff0d\uff20]|[ ']*[\t\r\n]")
"""Pattern of the beginning of a formula, after any apostrophes, so that one more has no effect."""


def is_formula(text: str) -> bool:
    """Return whether a cell, or its text after a semicolon, begins like a formula."""
    parts = text.split(";")
    return any(_begins_a_formula(part) and not part.startswith("'") for part in parts)


def guard_formula(text: str) -> str:
    """Convert text to a cell that no spreadsheet executes."""
    if not _FORMULA.match(text) and ";" not in text:
        return text
    return ";".join("'" + part if _begins_a_formula(part) else part for part in text.split(";"))


def unguard_formula(cell: str) -> str:
    """Convert a guarded cell to its original text."""
    if "'" not in cell:
        return cell
    parts = cell.split(";")
    return ";".join(
        part[1:] if part.startswith("'") and _begins_a_formula(part) else part for part in parts
    )


def _begins_a_formula(part: str) -> bool:
    return _FORMULA.match(part) is not None and not _PLAIN_NUMBER.fullmatch(part.lstrip("'"))


_NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")
_NOT_DECIMAL = re.compile(r"[^0-9eE+.\-]")


@dataclass(frozen=True)
class Columns:
    """Columns that a table may have.

    Attributes
    ----------
    text, numbers
        Columns that every file must have, with no empty cell.
    optional_text, optional_numbers
        Columns that may be absent, or have empty cells.
    words
        For columns of numbers: a word that is allowed instead.
    choices
        For columns of text: the words that a cell may have; it may be empty, too.
    others
        Whether users may keep columns of their own in the table, which are not read. A name close
        to that of a missing column is still a mistake.
    """

    text: tuple[str, ...]
    numbers: tuple[str, ...] = ()
    optional_text: tuple[str, ...] = ()
    optional_numbers: tuple[str, ...] = ()
    words: Mapping[str, str] = field(default_factory=dict)
    choices: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    others: bool = False

    @property
    def required(self) -> tuple[str, ...]:
        """Names of the columns that every file must have."""
        return (*self.text, *self.numbers)

    @property
    def numeric(self) -> tuple[str, ...]:
        """Names of the columns that hold numbers."""
        return (*self.numbers, *self.optional_numbers)

    @property
    def known(self) -> tuple[str, ...]:
        """Names of all columns."""
        return (*self.required, *self.optional_text, *self.optional_numbers)


@dataclass
class Table:
    """Table as columns, while a reader still checks it for mistakes.

    Attributes
    ----------
    path
        The file.
    line
        (N,) line number of each row.
    header
        Names of the columns that the file has.
    text, numbers
        Columns by name, each (N,); an empty cell is "" or NaN. Optional columns exist even where
        the file has none.
    has_word
        (N,) by name of a column: whether the cell is its word instead of a number.
    faults
        Mistakes found so far: pairs of line and message.
    """

    path: Path
    line: Ints
    header: tuple[str, ...]
    text: dict[str, tuple[str, ...]]
    numbers: dict[str, Floats]
    has_word: dict[str, Bools]
    faults: list[tuple[int | None, str]] = field(default_factory=list)

    def add_fault(self, row: int, message: str) -> None:
        """Report a mistake in a row."""
        self.faults.append((int(self.line[row]), message))

    def raise_faults(self) -> None:
        """Raise one error that names every mistake found so far, if there is any."""
        if self.faults:
            raise InputError.of_all(self.path, self.faults)

    def find_repeated(self, keys: Iterable[tuple[str, ...]]) -> Iterator[tuple[int, int]]:
        """Yield rows whose key occurs in an earlier one, and its line; keys with gaps are left out.

        Parameters
        ----------
        keys
            (N,) of the rows.
        """
        first: dict[tuple[str, ...], int] = {}
        for row, key in enumerate(keys):
            if not all(key):
                continue
            earlier = first.setdefault(key, row)
            if earlier != row:
                yield row, int(self.line[earlier])

    def require_unique(self, name: str, what: str) -> None:
        """Report every text of a column that occurs in an earlier row too."""
        texts = self.text[name]
        for row, line in self.find_repeated(zip(texts)):
            text = f"{what} {texts[row]!r} is already in line {line}: rename or remove one"
            self.add_fault(row, text)


def _describe_torn(count: int, wanted: int) -> str:
    """Describe a row with another number of cells than the header."""
    words = f"{count} cells, but the header has {wanted}"
    if count < wanted:
        return words
    return f"{words}: write 6.98 for 6,98, and put text that holds a comma or semicolon in quotes"


def read_table(path: str | Path, columns: Columns) -> Table:
    """Read a CSV file with a header: UTF-8 with or without byte order mark, blank lines.

    Cells are separated by commas, or all by semicolons, as in spreadsheets with decimal commas. A
    comma in a number is accepted where it can only be a decimal one.

    Returns
    -------
    Table
        Its `faults` name wrong cells; the caller adds its own and calls `raise_faults`.

    Raises
    ------
    InputError
        The file cannot be read, or its header or the number of cells of a row is wrong, so that the
        cells cannot be checked.
    """
    path = Path(path)
    found = read_header(path)
    if found is None:
        wanted = ",".join(columns.required)
        raise InputError(path, f"the file is empty: its first line must be {wanted}", 1)
    header_line, header = found
    if len(header) == 1 and "\t" in header[0]:
        raise InputError(
            path,
            "the cells are separated by tabs: save the table as CSV with commas or semicolons",
            header_line,
        )
    torn: list[tuple[int | None, str]] = [
        (header_line, text) for text in _header_faults(header, columns)
    ]
    is_comma = _writes_commas(path, header, columns)
    reading = {
        name: _Column(name, columns, is_comma=is_comma) for name in columns.known if name in header
    }
    lines: list[int] = []
    faults: list[tuple[int | None, str]] = []
    for block in read_blocks(path):
        torn += [(line, _describe_torn(count, len(header))) for line, count in block.torn]
        if torn:
            continue
        lines += block.line
        by_name = dict(zip(header, block.columns, strict=True))
        for name, column in reading.items():
            faults += [(block.line[row], text) for row, text in column.read(by_name[name])]
    if torn:
        raise InputError.of_all(path, torn)
    table = Table(path, np.array(lines, np.int64), tuple(header), {}, {}, {}, faults)
    for name in columns.known:
        read = reading.get(name)
        if name in columns.text or name in columns.optional_text:
            table.text[name] = tuple(read.texts) if read else ("",) * len(lines)
        else:
            parts = read.parts if read else [np.full(len(lines), np.nan)]
            table.numbers[name] = np.concatenate([np.empty(0), *parts])
        if name in columns.words:
            rows = read.has_word if read else [False] * len(lines)
            table.has_word[name] = np.array(rows, dtype=np.bool_)
    return table


def _writes_commas(path: Path, header: Sequence[str], columns: Columns) -> bool:
    """Return whether a table has decimal commas, so that ``12,001`` is unambiguous in it."""
    if not may_hold_commas(path):
        return False
    numeric = [k for k, name in enumerate(header) if name in columns.numeric]
    return any(
        "," in cell and has_decimal_comma(cell.strip())
        for block in read_blocks(path)
        if not block.torn
        for k in numeric
        for cell in block.columns[k]
    )


class _Column:
    """Column that is read block by block.

    A whole block is checked at once; its cells are checked one by one only if there is a mistake.
    """

    def __init__(self, name: str, columns: Columns, *, is_comma: bool) -> None:
        self.name = name
        self.texts: list[str] = []
        self.parts: list[Floats] = []
        self.has_word: list[bool] = []
        self._word = columns.words.get(name, "")
        self._choices = columns.choices.get(name, ())
        self._known: dict[str, str] = {}  # each text once in memory
        self._is_comma = is_comma
        self._is_required = name in columns.required
        self._is_text = name in columns.text or name in columns.optional_text

    def read(self, raw: Sequence[str]) -> list[tuple[int, str]]:
        """Read a block of cells; return the mistakes as pairs of row in the block and message."""
        cells = list(map(str.strip, raw))
        faults: list[tuple[int, str]] = []
        if self._is_required and "" in cells:
            faults += [(i, f"{self.name} is empty") for i, cell in enumerate(cells) if not cell]
        if self._word:
            has_word = [cell.casefold() == self._word for cell in cells]
            self.has_word += has_word
            cells = ["" if word else cell for cell, word in zip(cells, has_word, strict=True)]
        if not self._is_text:
            numbers, wrong = _numbers(self.name, cells, is_comma=self._is_comma)
            self.parts.append(numbers)
            least, most = range_of(self.name)
            odd = np.flatnonzero((numbers < least) | (numbers > most)).tolist()
            values = [(row, float(numbers[row])) for row in odd]
            faults += [
                (
                    row,
                    f"{self.name} {find_value_fault(self.name, value)} (got "
                    f"{format_digits(value, 6)})",
                )
                for row, value in values
            ]
            return [*faults, *wrong]
        together = "".join(cells)
        if "'" in together:
            cells = list(map(unguard_formula, cells))
        if UNSHOWABLE.search(together):
            faults += [
                (row, f"{self.name} holds {find_unshowable(cell)}: type it again")
                for row, cell in enumerate(cells)
                if UNSHOWABLE.search(cell)
            ]
        if self.name in NAMES and len(together) > LONGEST_NAME:
            faults += [
                (row, f"{self.name} {fault} (it begins with {cell[:32]!r})")
                for row, cell in enumerate(cells)
                if (fault := find_name_fault(cell))
            ]
        if self._choices:
            faults += [
                (row, f"{self.name} {fault}")
                for row, cell in enumerate(cells)
                if cell and (fault := find_choice_fault(cell, self._choices))
            ]
        self.texts += [self._known.setdefault(cell, cell) for cell in cells]
        return faults


def _header_faults(header: Sequence[str], columns: Columns) -> list[str]:
    faults = [
        f"column {name!r} is there twice: remove one"
        for name in dict.fromkeys(header)
        if header.count(name) > 1
    ]
    missing = [name for name in columns.required if name not in header]
    there = join_names(name or "an empty name" for name in header)
    faults += [
        f"column {name!r} is missing: the header must have it (it has {there})" for name in missing
    ]
    absent = [name for name in columns.known if name not in header]
    for name in dict.fromkeys(header):
        if name in columns.known:
            continue
        hint = suggest_spelling(name, absent if columns.others else columns.known)
        if hint or not (columns.others and name):
            known = f"known are {', '.join(columns.known)}"
            faults.append(f"unknown column {name!r}: {hint or known}")
    return faults


def find_own_columns(path: str | Path, columns: Columns) -> tuple[str, ...]:
    """Return the names of users' own columns in a table, which are not read."""
    _, header = read_header(Path(path)) or (1, [])
    return tuple(name for name in header if name not in columns.known)


def _numbers(
    name: str, cells: Sequence[str], *, is_comma: bool
) -> tuple[Floats, list[tuple[int, str]]]:
    """Parse the numbers (N,) of a column; NaN, and a mistake, for other text.

    `is_comma`: the table has decimal commas, so that ``12,001`` is unambiguous.
    """
    if not any(cells):
        return np.full(len(cells), np.nan), []
    if not _NOT_DECIMAL.search("".join(cells)):  # float() would also accept 1_000, nan and ٣
        with suppress(ValueError):
            values = np.array([float(cell) if cell else np.nan for cell in cells])
            if not (np.abs(values) > LARGEST_NUMBER).any():
                return values, []
    values = np.full(len(cells), np.nan)
    faults = []
    for row, cell in enumerate(cells):
        if not cell:
            continue
        number = parse_number(cell.replace(",", ".") if is_comma and cell.count(",") == 1 else cell)
        if number is None:
            faults.append((row, f"{name} must be a number (got {cell!r}){number_hint(cell)}"))
        else:
            values[row] = number
    return values, faults


def parse_number(text: str) -> float | None:
    """Parse a decimal number of at most LARGEST_NUMBER; None for other text (nan, inf, 1_000).

    A decimal comma is accepted where it is unambiguous: ``1,5``, not ``12,001``.
    """
    text = replace_decimal_comma(text)
    value = float(text) if _NUMBER.fullmatch(text) else np.inf
    return value if abs(value) <= LARGEST_NUMBER else None


def number_hint(text: str) -> str:
    """Explain why text that looks like a number is not accepted."""
    if _NUMBER.fullmatch(text):
        return ": it is far too large"
    return limits.number_hint(text, "the column")
