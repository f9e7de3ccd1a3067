"""Texts in drawings of the report: all that are wanted, none over another, each near its object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.stages.products.text_places import Label, leader, place_labels
from uavgram.views.survey.sheet import COMPASS, LETTER, SCALE_BAR, WIDTH, GridLine, Sheet

HALF_LETTER = {"measured": 3.9, "off_plane": 3.2, "off_ground": 3.2, "label": 2.8}
"""Half the width of a letter, by CSS class, in the widest of the usual fonts."""

HALF_OTHER = 3.5
"""The same of all other classes."""

ASIDE, HALF_LINE = 2.0, 7.0
"""Around a text, and half the height of its line."""

BASELINE = 3.5
"""Below the middle of a text."""

GAP = 4.0
"""Between a text and what it names."""

REACH = 10.0
"""A text may be so far from what it names, in its heights: a line leads to it."""

MOST_NEEDED = 300
"""Of more texts only so many are looked at, and none of them may be away from what it names."""

LEAST_SIZE = 0.5
"""Letters are not made smaller than that share of their size: some texts are left out instead."""


class Wanted(NamedTuple):
    """A text, its CSS class, and (1, 2) the point or (2, 2) the ends of the line that it names.

    One that is not needed is left out where there is no room right beside that, at a distance.
    """

    text: str
    kind: str
    spots: Floats
    is_needed: bool = True
    gap: float = GAP


@dataclass(frozen=True)
class Text:
    """A text with the middle of its baseline at (x, y).

    Attributes
    ----------
    x, y, text, kind
        Where it is, what it says, and a CSS class.
    size
        Of its letters, as a share of what is usual.
    leader
        SVG points of a line to what it names; empty where that is beside it.
    """

    x: float
    y: float
    text: str
    kind: str
    size: float = 1.0
    leader: str = ""


def placed_texts(
    wanted: Sequence[Wanted],
    bounds: tuple[Floats, Floats],
    taken: Sequence[Floats],
    unit: float = 1.0,
) -> tuple[tuple[Text, ...], int]:
    """Place texts in a drawing; those that no place was found for are left out.

    Parameters
    ----------
    wanted
        What is to be written.
    bounds
        First and last corner (2,) of the drawing.
    taken
        (5,) places where no text may be, as of `box`.
    unit
        Length in it of one unit of a letter's height.

    Returns
    -------
    texts
        What was placed.
    missing
        How many texts that are needed are not among them.
    """
    needed = np.array([one.is_needed for one in wanted], np.bool_)
    are_few = needed.sum() <= MOST_NEEDED
    labels = [
        Label(
            one.spots[0],
            one.spots[-1],
            unit
            * np.array([HALF_LETTER.get(one.kind, HALF_OTHER) * len(one.text) + ASIDE, HALF_LINE]),
            unit * one.gap,
            is_needed=one.is_needed and bool(are_few),
        )
        for one in (wanted if are_few else wanted[:MOST_NEEDED])
    ]
    boxes, size = place_labels(labels, np.reshape(taken, (-1, 5)), bounds, LEAST_SIZE, REACH)
    rows = np.flatnonzero(np.isfinite(boxes[:, 0])).tolist()
    texts = tuple(
        Text(
            float(boxes[k, 0]),
            float(boxes[k, 1]) + size * unit * BASELINE,
            wanted[k].text,
            wanted[k].kind,
            size,
            "" if (line := leader(labels[k], boxes[k])) is None else svg_points(line),
        )
        for k in rows
    )
    return texts, int(needed.sum() - needed[rows].sum())


def svg_points(drawn: Floats) -> str:
    """(n, 2) places as SVG has them."""
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in drawn.tolist())


def box(middle: Floats | tuple[float, float], half_width: float, half_height: float) -> Floats:
    """(5,) a level rectangle, as `TextPlaces` has it.

    Parameters
    ----------
    middle
        (2,) its middle.
    half_width, half_height
        Half its size.
    """
    return np.array([*middle, half_width, half_height, 0.0])


def around_drawing(sheet: Sheet, grid: Sequence[GridLine], bar: float) -> list[Floats]:
    """(5,) where the scale bar, the north arrow and the names of the grid are.

    Parameters
    ----------
    sheet, grid
        The drawing, and the lines of its grid.
    bar
        Length of the scale bar in the drawing.
    """
    half = COMPASS / 2
    return [
        box((24.0 + bar / 2, sheet.height - SCALE_BAR / 2 + 5.0), bar / 2 + 10.0, SCALE_BAR / 2),
        box((WIDTH - half, half), half, half),
        *(box((one.x, one.y - 3.0), LETTER * len(one.text) / 2, 6.0) for one in grid if one.text),
    ]
