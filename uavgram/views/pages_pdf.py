"""PDF of self-contained pages: pictures as separate files, long tables as preformatted text."""

from __future__ import annotations

import base64
import gc
import importlib
import logging
import re
import textwrap
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from html import escape, unescape
from typing import Any, NamedTuple

from uavgram.errors import UavgramError
from uavgram.model.maps import Paper

DRAWING, PHOTO = "image/svg+xml", "image/jpeg"
SCHEME = "part"
"""Scheme of the addresses of parts."""

_DRAWING = re.compile(r"<svg\b([^>]*)>(.*?)</svg>", re.DOTALL)
_PHOTO = re.compile(r"data:image/jpeg;base64,([A-Za-z0-9+/=]+)")
_STYLE = re.compile(r"<style>.*?</style>", re.DOTALL)
_CLASS = re.compile(r'class="([^"]*)"')
_LABEL = re.compile(r'aria-label="([^"]*)"')
_SPACE = 'xmlns="http://www.w3.org/2000/svg"'


class PageFile(NamedTuple):
    """File of the page: its type and content."""

    kind: str
    content: bytes


class SplitPage(NamedTuple):
    """Page without its drawings and photos, and these parts by their addresses."""

    html: str
    parts: dict[str, PageFile]


def split_page(html: str) -> SplitPage:
    """Move each drawing and photo to a file of its own; styles of drawings then apply to images.

    A layout program styles each element of a page, including those inside drawings, and reads
    addresses letter by letter. Content in separate files avoids this cost.

    Parameters
    ----------
    html
        A page with inline drawings, and photos as data URLs.
    """
    parts: dict[str, PageFile] = {}

    def photo(found: re.Match[str]) -> str:
        return _add(parts, PHOTO, base64.b64decode(found[1]))

    def drawing(found: re.Match[str]) -> str:
        content = f"<svg {_SPACE}{found[1]}>{found[2]}</svg>".encode()
        label, looks = _LABEL.search(found[1]), _CLASS.search(found[1])
        return (
            f'<img class="{looks[1] if looks else ""}" alt="{label[1] if label else ""}" '
            f'src="{_add(parts, DRAWING, content)}">'
        )

    short = _DRAWING.sub(drawing, _PHOTO.sub(photo, html))
    styled = _STYLE.sub(lambda found: re.sub(r"\bsvg\b", "img", found[0]), short)
    return SplitPage(styled, parts)


def _add(parts: dict[str, PageFile], kind: str, content: bytes) -> str:
    address = f"{SCHEME}:{len(parts)}"
    parts[address] = PageFile(kind, content)
    return address


MARK = "plain"
"""Class of the tables that become text: their cells hold plain words and numbers only."""

MAX_ROWS = 5
"""Rows of a block, which is not split over pages; the head is repeated on each page."""

LARGEST_PT, MIN_PT = 7.0, 4.6
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


def convert_tables_to_text(html: str) -> str:
    """Replace the marked tables of a page by text if all their cells are plain and fit.

    A layout program measures each cell of a table three times but a line of text once: a page of
    correlations takes a tenth of the time of its table and looks the same.
    """
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
    if size_pt < MIN_PT:
        return ""
    head = "\n".join(line for row in heads for line in _head(row, widths, right))
    lines = [_line(row, widths, right) for row in body]
    style = f'style="font-size: {size_pt:.2f}pt"'
    named = f'<thead><tr><th><pre class="head" {style}>{head}</pre></th></tr></thead>'
    blocks = "".join(
        f"<tr><td><pre {style}>{chr(10).join(some)}</pre></td></tr>"
        for some in (lines[k : k + MAX_ROWS] for k in range(0, len(lines), MAX_ROWS))
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


PAPER_SIZES: dict[Paper, str] = {"a4": "A4", "letter": "letter"}
"""Names of the paper sizes in style sheets."""


def page_pdf(html: str, sheet: str, name: str, **options: object) -> bytes:
    """Lay a page out on paper; nothing is loaded that is not in the page itself.

    Parameters
    ----------
    html
        The page.
    sheet
        Additional style sheet: at least the size of the paper.
    name
        Name of the file without its ending, for messages.
    **options
        Options of WeasyPrint's ``write_pdf``.

    Raises
    ------
    UavgramError
        If WeasyPrint, or a library of the system that it needs, is missing.
    """
    weasyprint = weasyprint_for(name)
    # WeasyPrint reports every screen style that it ignores
    logging.getLogger("weasyprint").setLevel(logging.ERROR)
    with warnings.catch_warnings(), _pause_garbage_collection():
        warnings.simplefilter("ignore", ResourceWarning)  # it leaves its colour profile open
        short, parts = split_page(convert_tables_to_text(html))
        inside = _fetcher(weasyprint, parts)
        page: bytes = weasyprint.HTML(string=short, url_fetcher=inside).write_pdf(
            stylesheets=[weasyprint.CSS(string=SHEET + sheet)], **options
        )
    return page


@contextmanager
def _pause_garbage_collection() -> Iterator[None]:
    """Disable the garbage collector during a layout, which keeps nearly all its objects.

    The collector would take a tenth of the time.
    """
    was = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()


def _fetcher(weasyprint: Any, parts: dict[str, PageFile]) -> Any:  # noqa: ANN401
    """Make a fetcher that returns the page's own parts and loads nothing from elsewhere."""

    class Inside(weasyprint.urls.URLFetcher):  # type: ignore[misc]
        def fetch(self, url: str, headers: object = None) -> Any:  # noqa: ANN401
            if url not in parts:
                return super().fetch(url, headers)
            kind, content = parts[url]
            return weasyprint.urls.URLFetcherResponse(url, content, {"Content-Type": kind})

    return Inside(allowed_protocols=())


def weasyprint_for(name: str) -> Any:  # noqa: ANN401
    """Import WeasyPrint, to make ``name.pdf`` with it.

    Raises
    ------
    UavgramError
        If it, or a library of the system that it needs, is missing.
    """
    try:
        return importlib.import_module("weasyprint")
    except ImportError as fault:
        raise UavgramError(
            f"{name}.pdf needs WeasyPrint, which is not installed: pip install weasyprint. "
            f"Or print {name}.html from a browser."
        ) from fault
    except OSError as fault:  # it loads the libraries when it is imported
        raise UavgramError(
            f"{name}.pdf needs the library Pango of this system, which is missing: install it "
            "(Debian and Ubuntu: apt install libpango-1.0-0 libpangoft2-1.0-0; macOS: brew install "
            f"pango). Or print {name}.html from a browser. ({fault})"
        ) from fault
