"""Tables as data: the same content as text, Markdown, or HTML (``templates/tables.html``)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from uavgram.model.naming import METRIC, Units
from uavgram.views.units import table_unit

GAUGE_SIGMAS = 6.0
"""Sigmas from the middle of a gauge to its ends; larger values are drawn at the end."""

MAX_ROWS = 200
"""Largest number of rows in Markdown; longer tables are in the files beside the recording."""


class Gauge(NamedTuple):
    """Number of sigmas as a mark on a scale from minus to plus `GAUGE_SIGMAS`.

    Attributes
    ----------
    at, low, high
        Positions of the mark and of the ends of the zone within the limit, in percent of the scale.
    outside
        Whether the mark is beyond the limit.
    """

    at: float
    low: float
    high: float
    outside: bool


def draw_gauge(sigmas: float, limit: float) -> Gauge | None:
    """Draw a number of sigmas against a limit; return None if it is not finite."""
    if not np.isfinite(sigmas):
        return None
    at, low, high = (
        round(50.0 + 50.0 * float(np.clip(one, -GAUGE_SIGMAS, GAUGE_SIGMAS)) / GAUGE_SIGMAS, 1)
        for one in (sigmas, -limit, limit)
    )
    return Gauge(at, low, high, outside=abs(sigmas) > limit)


class Cell(NamedTuple):
    """Cell of a table.

    Attributes
    ----------
    text, second
        Its lines; the terminal shows the first only.
    below
        Small text below it.
    look
        Its appearance: ``good``, ``look`` or ``bad`` give a colour; ``value`` is the main value of
        the table, ``doubt`` a doubtful and ``struck`` a contradicted one; ``mono`` is a code or a
        checksum; ``write`` is room for handwriting; or empty.
    tags
        Short warnings behind the text.
    hint, link
        Text shown under the pointer, and address that opens with a click.
    picture
        Address of a small picture above the text.
    gauge
        A number of sigmas drawn as a scale.
    """

    text: str
    second: str = ""
    below: str = ""
    look: str = ""
    tags: tuple[str, ...] = ()
    hint: str = ""
    link: str = ""
    picture: str = ""
    gauge: Gauge | None = None


Cells = Sequence[Cell | str]


class Row(NamedTuple):
    """Cells of a row, and whether it is one that does not fit."""

    cells: Cells
    is_bad: bool = False


class Table(NamedTuple):
    """Table as a place shows it.

    Attributes
    ----------
    titles, numbers
        (c,) titles of its columns, and whether they are aligned to the right.
    rows
        Cells of each row.
    bad
        Whether each row is one that does not fit.
    """

    titles: tuple[str, ...]
    numbers: tuple[bool, ...]
    rows: tuple[tuple[Cell, ...], ...]
    bad: tuple[bool, ...]


def make_table(titles: str, rows: Iterable[Row | Cells], units: Units = METRIC) -> Table:
    """Make a table.

    Parameters
    ----------
    titles
        Titles separated by bars, such as ``photo | >height [m]``: a column of numbers begins with
        ``>``, one of main values with ``*``; ``[m]`` becomes the unit of lengths, and ``[tape]``,
        too, unless cells in feet and inches name it.
    rows
        Rows, or their cells.
    units
        Units of the project.
    """
    taped = "" if units.length == "ft-in" else " [m]"
    named = titles.replace(" [tape]", taped).replace("[m]", f"[{table_unit(units).symbol}]")
    marked = named.split(" | ") if named else []
    looks = ["value" * title.startswith("*") for title in marked]
    made = [row if isinstance(row, Row) else Row(row) for row in rows]
    return Table(
        tuple(title.lstrip(">*") for title in marked),
        tuple(title.startswith((">", "*")) for title in marked),
        tuple(
            tuple(
                Cell(one, look=look) if isinstance(one, str) else one
                for one, look in zip(row.cells, looks, strict=True)
            )
            for row in made
        ),
        tuple(row.is_bad for row in made),
    )


def format_table(table: Table, *, is_whole: bool = False) -> str:
    """Format a table as text; if `is_whole`, what is below a cell is behind it."""
    right = [k for k, is_number in enumerate(table.numbers) if is_number]
    return align_columns(
        [
            table.titles,
            *([f"{one.text} {one.below * is_whole}".rstrip() for one in row] for row in table.rows),
        ],
        right,
    )


def align_columns(cells: Sequence[Sequence[str]], right: Sequence[int]) -> str:
    """Format rows of text as columns two blanks apart, with a rule below the first row."""
    widths = [max(len(row[c]) for row in cells) for c in range(len(cells[0]))]
    lines = [
        "  ".join(
            text.rjust(width) if c in right else text.ljust(width)
            for c, (text, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in cells
    ]
    return "\n".join([lines[0], "-" * max(len(line) for line in lines), *lines[1:]])


_LOUD = {"value": "**", "bad": "**", "look": "**", "struck": "~~"}


def plain(text: str) -> str:
    """Escape text written by a person so that Markdown shows it unchanged."""
    return re.sub(r"([\\`*_{}\[\]<>#|~$!])", r"\\\1", " ".join(text.split()))


def markdown(table: Table, most: int = MAX_ROWS) -> str:
    """Format a table as Markdown, with a note if rows are omitted.

    Parameters
    ----------
    table
        The table.
    most
        Largest number of rows.
    """
    lines = [table.titles, ("---",) * len(table.titles)]
    lines += [tuple(_in_markdown(cell) for cell in row) for row in table.rows[:most]]
    more = len(table.rows) - most
    note = [f"\n{more} more rows are in the report and in results.json."] if more > 0 else []
    return "\n".join([*("| " + " | ".join(line) + " |" for line in lines), *note]).replace(
        "\xad", ""
    )


def _in_markdown(cell: Cell) -> str:
    loud = _LOUD.get(cell.look, "") * bool(cell.text)
    text = f"{loud}{plain(cell.text)}{loud}" + " ?" * (cell.look == "doubt")
    text += f" {plain(cell.second)}" * bool(cell.second)
    return text + f", {plain(cell.below)}" * bool(cell.below)
