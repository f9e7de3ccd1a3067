"""The rows of a CSV file, with the line of each; many at a time where nothing is quoted."""

from __future__ import annotations

import csv
import io
import itertools
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from uavgram import input_files
from uavgram.errors import InputError

_LINE = re.compile(r"[^\r\n]+")
_BLOCK = 10_000  # rows at a time
_LONGEST_LINE = 100_000  # a cell may be as long for the csv module
_BYTE_ORDER_MARKS_16 = (b"\xff\xfe", b"\xfe\xff")


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
    """Line and stripped cells of the first line that is not blank; None where all are."""
    return next(((line, _stripped(cells)) for line, cells in _records(path, read_text(path))), None)


def read_blocks(path: Path) -> Iterator[Block]:
    """All that follows the header, blank lines left out.

    Raises
    ------
    InputError
        The file cannot be read, or is no CSV.
    """
    text = read_text(path)
    if '"' in text:
        records = _records(path, text)
        width = len(next(records)[1])
        while rows := list(itertools.islice(records, _BLOCK)):
            yield _block(rows, width)
        return
    mark = separator_of(text)
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    at, header = next(_records(path, text))
    width = len(header)
    for first in range(at, len(lines), _BLOCK):
        block = lines[first : first + _BLOCK]
        yield _plain_block(block, first + 1, width, mark) or _block(
            [(first + line, cells) for line, cells in _records(path, "\n".join(block), mark)], width
        )


def _plain_block(lines: Sequence[str], first: int, width: int, mark: str) -> Block | None:
    """Lines without quotes, none of them blank or torn; None where they are not that."""
    if {line.count(mark) for line in lines} != {width - 1} or max(map(len, lines)) > _LONGEST_LINE:
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
    """Text of a new table with commas, quotes where cells need them."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue()


def separator_of(text: str) -> str:
    """What separates the cells of a table: a semicolon where its header knows no comma."""
    lines = (match[0] for match in _LINE.finditer(text))
    header = next((line for line in lines if line.strip(" ,;")), "")
    return ";" if ";" in header and "," not in header else ","


def may_hold_commas(path: Path) -> bool:
    """Whether cells of a table can hold commas: in quotes, or between semicolons."""
    text = read_text(path)
    return '"' in text or separator_of(text) == ";"


def _records(path: Path, text: str, mark: str = "") -> Iterator[tuple[int, list[str]]]:
    """Line and cells of each row that is not blank; `mark` separates cells, if it is known."""
    mark = mark or separator_of(text)
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


def _stripped(cells: Sequence[str]) -> list[str]:
    return list(map(str.strip, cells))


def read_text(path: Path) -> str:
    """Text of a file in UTF-8, without byte order mark."""
    if _looks_like_utf_16(input_files.read_bytes(path)[:64]):
        raise InputError(path, "is UTF-16 text: save it as CSV UTF-8", 1)
    return input_files.read_text(path, "save it as CSV UTF-8")


def _looks_like_utf_16(start: bytes) -> bool:
    """Whether a mark says so, or every other byte is 0, as in Latin text of two bytes each."""
    is_half_empty = b"\0" in start and not (any(start[::2]) and any(start[1::2]))
    return start.startswith(_BYTE_ORDER_MARKS_16) or is_half_empty
