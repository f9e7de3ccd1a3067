"""Texts in drawings on paper, without overlaps, each near its object."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.stages.products.text_places import Label, Where, place_labels
from uavgram.views.style import INK


class Letters(NamedTuple):
    """Style of a text: height of its letters in units of the drawing, and colour."""

    size: float
    is_bold: bool = False
    colour: str = "#1b1f24"
    style: Literal["normal", "italic"] = "normal"


LETTERS = {
    "measured": Letters(11.0, is_bold=True, colour=INK["measured"]),
    "known": Letters(11.0, colour=INK["used"]),
    "name": Letters(10.0, colour="#444444"),
    "off_ground": Letters(9.5, is_bold=True),
    "off_plane": Letters(9.5, style="italic"),
    "scale": Letters(11.0),
    "grid": Letters(8.5, colour="#4a525c"),
    "photo": Letters(10.0, is_bold=True, colour="#0b4f8a"),
    "label": Letters(9.0, colour="#444444"),
}
"""Styles of the texts in the drawings of the report, by kind."""

WIDTHS = {
    "'": 0.19, "ijl": 0.222, " !,./:;I[\\]ft|": 0.278, "()-r²³`": 0.333, "*": 0.389, "°": 0.4,
    "Jcksvxyz": 0.5, "+=<>~±": 0.584, "FTZ": 0.611, "&ABEKPSVXY": 0.667, "CDHNRUw": 0.722,
    "GOQ": 0.778, "Mm": 0.833, "%": 0.889, "W": 0.944, "@": 1.015, "…—": 1.0,
}  # fmt: skip
"""Widths of letters, as shares of their height, in Arial and the fonts that are as wide."""
USUAL_WIDTH, WIDE_WIDTH, BOLD = 0.556, 1.0, 1.06
"""Widths of all other letters, of those of the Far East, and the factor for bold ones."""
_WIDTH_OF = {letter: width for letters, width in WIDTHS.items() for letter in letters}

ASIDE, HALF_LINE, BASELINE = 2.0, 0.64, 0.32
"""Margin around a text in units of the drawing; half a line, and the baseline below, in letters."""

HALF_CAPITAL = 0.42
"""Half the height of capitals, in letters: a line from above or below ends there."""

GAP = 4.0
"""Gap between a text and its object."""

REACH = 10.0
"""Largest distance of a text from its object, in its heights: a line leads to it."""

MAX_NEEDED = 300
"""Number of texts above which only the first are placed, and only beside their objects."""

MIN_SIZE = 0.5
"""Least font size, as a share of the usual; if texts need less, some are omitted."""


class TextRequest(NamedTuple):
    """Text, its kind, and (1, 2) the point or (2, 2) the ends of the line that it names.

    A text that is not needed is omitted if there is no room beside its object, at `gap`; `where`
    and `turn` are those of a `Label`; the colour is by default that of the kind.
    """

    text: str
    kind: str
    spots: Floats
    is_needed: bool = True
    gap: float = GAP
    rank: int = 0
    where: Where = "beside"
    turn: float = 0.0
    colour: str = ""


class PlacedText(NamedTuple):
    """Text with the middle of its baseline at x and y.

    Attributes
    ----------
    x, y, text, kind
        Its place, content and kind.
    size
        Font size, as a share of the usual.
    half_width, half_height
        Half the size of its box.
    turn
        Its angle [rad], clockwise as y goes down.
    leader
        (2, 2) line from its object to its box; None if that is beside it.
    colour
        Its colour; empty: that of its kind.
    side
        Where its place is exact for a font of another width: -1 its beginning, 0 its middle, 1 its
        end.
    """

    x: float
    y: float
    text: str
    kind: str
    size: float = 1.0
    half_width: float = 0.0
    half_height: float = 0.0
    turn: float = 0.0
    leader: Floats | None = None
    colour: str = ""
    side: int = 0


def place_texts(
    wanted: Sequence[TextRequest],
    bounds: tuple[Floats, Floats],
    taken: Sequence[Floats] | Floats,
    unit: float = 1.0,
    letters: Mapping[str, Letters] = LETTERS,
    reach: float = REACH,
    least: float = MIN_SIZE,
) -> tuple[tuple[PlacedText, ...], int]:
    """Place texts in a drawing; those for which no place is found are omitted.

    Parameters
    ----------
    wanted
        Texts to place.
    bounds
        First and last corner (2,) of the drawing.
    taken
        (5,) places where no text may be, see `box`.
    unit
        Length in the drawing of one unit of a letter's height.
    letters
        Style of each kind of text.
    reach
        Largest distance of a text from its object, in its heights.
    least
        Least font size, as a share of the usual.

    Returns
    -------
    texts
        The placed texts.
    missing
        Number of needed texts that are not among them.
    """
    needed = np.array([one.is_needed for one in wanted], np.bool_)
    are_few = needed.sum() <= MAX_NEEDED
    labels = [
        Label(
            one.spots[0],
            one.spots[-1],
            unit * half_size(one.text, letters[one.kind]),
            unit * one.gap,
            is_needed=one.is_needed and bool(are_few),
            rank=one.rank,
            where=one.where,
            turn=one.turn,
        )
        for one in (wanted if are_few else wanted[:MAX_NEEDED])
    ]
    free = np.reshape(taken, (-1, 5))
    boxes, leaders, sides, size = place_labels(labels, free, bounds, least, reach)
    rows = np.flatnonzero(np.isfinite(boxes[:, 0])).tolist()
    texts = []
    for k in rows:
        one, height = wanted[k], size * unit * letters[wanted[k].kind].size
        x, y, half_width, half_height, turn = boxes[k].tolist()
        leader: Floats | None = None if np.isnan(leaders[k, 0, 0]) else leaders[k].copy()
        if leader is not None and sides[k] == 0 and not turn:  # end at the letters, not at the box
            leader[1, 1] -= np.sign(leader[1, 1] - y) * (half_height - HALF_CAPITAL * height)
        below = BASELINE * height
        at = x - below * math.sin(turn), y + below * math.cos(turn)
        texts.append(
            PlacedText(
                *at, one.text, one.kind, size, half_width, half_height, turn, leader, one.colour
            )
        )
    return tuple(texts), int(needed.sum() - needed[rows].sum())


def half_size(text: str, letters: Letters) -> Floats:
    """Return (2,) half the width and height of a text's box, for any of the usual fonts."""
    width = sum(
        WIDE_WIDTH if letter >= "\u2e80" else _WIDTH_OF.get(letter, USUAL_WIDTH) for letter in text
    )
    bold = BOLD if letters.is_bold else 1.0
    return np.array([letters.size * bold * width / 2 + ASIDE, HALF_LINE * letters.size])


def svg_points(drawn: Floats) -> str:
    """Format (n, 2) places for SVG."""
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in drawn.tolist())


def box(middle: Floats | tuple[float, float], half_width: float, half_height: float) -> Floats:
    """Return (5,) a rectangle parallel to the axes, as in `TextPlaces`.

    Parameters
    ----------
    middle
        (2,) its middle.
    half_width, half_height
        Half its size.
    """
    return np.array([*middle, half_width, half_height, 0.0])
