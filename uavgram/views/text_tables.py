"""Tables of short texts as preformatted text, for paper.

A layout program measures each cell of a table three times but a line of text once: a page of
correlations takes a tenth of the time of its table and looks the same.
"""

from __future__ import annotations

import re
import textwrap
from html import escape, unescape
from typing import NamedTuple

MARK = "plain"
"""Class of the tables that become text: their cells hold plain words and numbers only."""

MOST_ROWS = 5
"""Rows of a block, which is not split over pages; the head is repeated on each page."""

LARGEST_PT, LEAST_PT = 7.0, 4.6
"""Font sizes: as large as the widest line allows; if below the least, the table is kept."""

_ROOM_PT = 182 / 25.4 * 72
"""Width of the text on A4, the narrower paper."""

_LETTER = 0.61
"""Width of a fixed-width letter, as a share of its size (DejaVu, Liberation, Courier)."""

_GAP = 2
_HEAD = 9
"""Letters of a line of a head, unless its longest word is longer."""
_TABLE = re.compile(rf'<table class="[^"]*\b{MARK}\b[^"]*">(.*?)</table>', re.DOTALL)
_ROW = re.compile(r"<tr([^>]*)>(.*?)</tr>", re.DOTALL)
_CELL = re.compile(r"<(t[hd])([^>]*)>(.*?)</\1>", re.DOTALL)

SHEET = """
.columns { table-layout: fixed; }
.columns td, .columns th { border: 0 !important; padding: 0 !important; }
.columns pre { font-family: "DejaVu Sans Mono", monospace; line-height: 1.45; margin: 0; }
.columns .head { font-weight: 700; color: #5b6470; border-bottom: 0.8pt solid #1b1f24; }
"""
"""Style of the text tables."""


class _Cell(NamedTuple):
    text: str
    right: bool
    head: bool
    looks: str
    """CSS classes of a highlighted cell; else empty."""


def with_text_tables(html: str) -> str:
    """Replace the marked tables of a page by text if all their cells are plain and fit."""
    return _TABLE.sub(lambda found: _as_text(found[1]) or found[0], html)


def _as_text(table: str) -> str:
    """Convert a table to text; return an empty text if it has to remain a table."""
    rows = []
    for attributes, content in _ROW.findall(table):
        cells = [
            _Cell(unescape(text).replace("\xad", ""), _is_right(more), tag == "th", _looks(more))
            for tag, more, text in _CELL.findall(content)
        ]
        if attributes or any("<" in text for *_, text in _CELL.findall(content)):
            return ""
        rows.append(cells)
    if not rows or len({len(row) for row in rows}) > 1:
        return ""
    # wide letters and letters without width would break the alignment
    if any(
        ord(letter) >= 0x300 and letter not in "–—…−" for r in rows for c in r for letter in c.text
    ):
        return ""
    heads, body = ([r for r in rows if r[0].head is is_head] for is_head in (True, False))
    return _blocks(heads, body, [cell.right for cell in (body or heads)[0]])


def _classes(attributes: str) -> list[str]:
    found = re.search(r'class="([^"]*)"', attributes)
    return found[1].split() if found else []


def _is_right(attributes: str) -> bool:
    return not {"n", "figures"}.isdisjoint(_classes(attributes))


def _looks(attributes: str) -> str:
    named = _classes(attributes)
    return " ".join(named) if "tag" in named and "good" not in named else ""


def _blocks(heads: list[list[_Cell]], body: list[list[_Cell]], right: list[bool]) -> str:
    widths = [
        max([*(len(row[k].text) for row in body), *(_least(row[k].text) for row in heads)])
        for k in range(len(right))
    ]
    size_pt = min(LARGEST_PT, _ROOM_PT / (_LETTER * (sum(widths) + _GAP * (len(widths) - 1))))
    if size_pt < LEAST_PT:
        return ""
    head = "\n".join(line for row in heads for line in _head(row, widths, right))
    lines = [_line(row, widths, right) for row in body]
    style = f'style="font-size: {size_pt:.2f}pt"'
    named = f'<thead><tr><th><pre class="head" {style}>{head}</pre></th></tr></thead>'
    blocks = "".join(
        f"<tr><td><pre {style}>{chr(10).join(some)}</pre></td></tr>"
        for some in (lines[k : k + MOST_ROWS] for k in range(0, len(lines), MOST_ROWS))
    )
    return f'<table class="columns">{named if head else ""}<tbody>{blocks}</tbody></table>'


def _least(text: str) -> int:
    """Return the length of a head's longest line; heads with columns of their own stay whole."""
    if "  " in text:
        return len(text)
    return max(min(len(text), _HEAD), *map(len, text.split()), 0)


def _head(row: list[_Cell], widths: list[int], right: list[bool]) -> list[str]:
    """Break a head into as many lines as its longest text takes, aligned at the bottom."""
    cells = [
        [cell.text] if "  " in cell.text else textwrap.wrap(cell.text, max(width, 1))
        for cell, width in zip(row, widths, strict=True)
    ]
    deep = max(map(len, cells))
    filled = [[""] * (deep - len(cell)) + cell for cell in cells]
    parts = (
        [one._replace(text=cell[k]) for one, cell in zip(row, filled, strict=True)]
        for k in range(deep)
    )
    return [_line(part, widths, right) for part in parts]


def _line(cells: list[_Cell], widths: list[int], right: list[bool]) -> str:
    """Pad the cells to their widths, as HTML."""
    parts = []
    for cell, width, is_right in zip(cells, widths, right, strict=True):
        text, room = escape(cell.text), " " * (width - len(cell.text))
        shown = f'<span class="{cell.looks}">{text}</span>' if cell.looks else text
        parts.append(room + shown if is_right else shown + room)
    return (" " * _GAP).join(parts).rstrip()
