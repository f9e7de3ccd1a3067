"""Sheets of plates to print: PDF pages at true size, each with a ruler that checks the printer.

Everything is drawn as outlines, so that edges are as sharp as the printer allows. A plate larger
than a page is split over several, which are cut along their marks and joined.
"""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline

from uavgram.model.arrays import Floats

PAPERS_MM = {
    "a4": (210.0, 297.0),
    "letter": (215.9, 279.4),
    "a3": (297.0, 420.0),
    "a2": (420.0, 594.0),
    "a1": (594.0, 841.0),
    "a0": (841.0, 1189.0),
}
MARGIN_MM = 10.0
"""Width of the margin that printers leave white."""

FOOT_MM = 27.0
"""Height of the foot of each page, for text and ruler."""

RULER_MM = 100
_MM_PER_INCH = 25.4
_CROSS_MM = 4.0


@dataclass(frozen=True)
class Sheet:
    """Content of one sheet.

    Attributes
    ----------
    name
        Name of the plate, as in its labels.
    outlines_mm
        (k, 2) each, outlines of the black areas; y downwards, black to the right.
    size_mm
        Width and height, including the white border.
    words
        Further text.
    """

    name: str
    outlines_mm: Sequence[Floats]
    size_mm: tuple[float, float]
    words: str


def room_mm(paper: str) -> tuple[float, float]:
    """Return width and height of the part of a page that is available for plates."""
    width, height = PAPERS_MM[paper]
    return width - 2 * MARGIN_MM, height - 2 * MARGIN_MM - FOOT_MM


def pages_of(size_mm: tuple[float, float], paper: str) -> tuple[int, int]:
    """Return the columns and rows of pages that a sheet takes."""
    room = room_mm(paper)
    columns, rows = (max(1, math.ceil(s / r - 1e-9)) for s, r in zip(size_mm, room, strict=True))
    return columns, rows


def sheets_pdf(sheets: Sequence[Sheet], paper: str) -> bytes:
    """Draw the sheets as a PDF.

    Parameters
    ----------
    sheets
        The sheets, in their order.
    paper
        A key of `PAPERS_MM`.
    """
    drawn = io.BytesIO()
    # a fixed date: the same plates give the same file
    facts = {"Title": "coded plates", "CreationDate": datetime(2000, 1, 1, tzinfo=UTC)}
    with PdfPages(drawn, metadata=facts) as pdf:
        for sheet in sheets:
            columns, rows = pages_of(sheet.size_mm, paper)
            for row in range(rows):
                for column in range(columns):
                    pdf.savefig(_page(sheet, paper, (column, row), (columns, rows)))
    return drawn.getvalue()


def _page(sheet: Sheet, paper: str, at: tuple[int, int], count: tuple[int, int]) -> Figure:
    width, height = PAPERS_MM[paper]
    figure = Figure(figsize=(width / _MM_PER_INCH, height / _MM_PER_INCH))
    room = room_mm(paper)
    box = MARGIN_MM / width, (MARGIN_MM + FOOT_MM) / height, room[0] / width, room[1] / height
    plate = figure.add_axes(box)
    spare = [max(0.0, r * n - s) / 2 for r, n, s in zip(room, count, sheet.size_mm, strict=True)]
    left, top = at[0] * room[0] - spare[0], at[1] * room[1] - spare[1]
    plate.set_xlim(left, left + room[0])
    plate.set_ylim(top + room[1], top)
    plate.axis("off")
    plate.add_patch(PathPatch(_outline(sheet.outlines_mm), facecolor="black", linewidth=0))
    if count != (1, 1):
        _cut_marks(plate, left, top, room)
    foot = figure.add_axes((0.0, 0.0, 1.0, (MARGIN_MM + FOOT_MM) / height))
    foot.set_xlim(0.0, width)
    foot.set_ylim(0.0, MARGIN_MM + FOOT_MM)
    foot.axis("off")
    part = (
        ""
        if count == (1, 1)
        else f"   column {at[0] + 1} of {count[0]}, row {at[1] + 1} of {count[1]}"
    )
    foot.text(MARGIN_MM, MARGIN_MM + 21.0, sheet.name, fontsize=20, va="center")
    foot.text(MARGIN_MM + 26.0, MARGIN_MM + 21.0, f"{sheet.words}{part}", fontsize=8, va="center")
    _ruler(foot)
    return figure


def _outline(outlines: Sequence[Floats]) -> Outline:
    places = np.concatenate([np.vstack([loop, loop[:1]]) for loop in outlines])
    codes = np.concatenate(
        [
            [Outline.MOVETO, *[Outline.LINETO] * (len(loop) - 1), Outline.CLOSEPOLY]
            for loop in outlines
        ]
    )
    return Outline(places, codes)


def _cut_marks(axis: Axes, left: float, top: float, room: tuple[float, float]) -> None:
    for x in (left, left + room[0]):
        for y in (top, top + room[1]):
            axis.plot(
                [x - _CROSS_MM, x + _CROSS_MM], [y, y], color="grey", linewidth=0.3, clip_on=False
            )
            axis.plot(
                [x, x], [y - _CROSS_MM, y + _CROSS_MM], color="grey", linewidth=0.3, clip_on=False
            )


def _ruler(axis: Axes) -> None:
    """Draw a ruler of 100 mm, and what to do if its print is not 100 mm long."""
    y = MARGIN_MM + 8.0
    axis.plot([MARGIN_MM, MARGIN_MM + RULER_MM], [y, y], color="black", linewidth=0.4)
    for mm in range(RULER_MM + 1):
        tall = 5.0 if mm % 10 == 0 else 3.5 if mm % 5 == 0 else 2.0
        x = MARGIN_MM + mm
        axis.plot([x, x], [y, y + tall], color="black", linewidth=0.25)
    for cm in range(0, RULER_MM + 1, 50):
        axis.text(MARGIN_MM + cm, y + 5.5, str(cm), fontsize=6, ha="center", va="bottom")
    axis.text(
        MARGIN_MM,
        y - 1.5,
        "Measure this ruler: 100 mm from first to last line. If it is not, print at 100 % (no "
        "fit to page); or measure the black square and state its side as side_m.",
        fontsize=6,
        va="top",
    )
