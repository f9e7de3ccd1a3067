"""Texts in the recording's views: without overlaps as a view opens, and lines to their objects.

Rerun writes each text level below its place, in letters of one size on the screen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Floats, Ints
from uavgram.stages.products.text_places import Label, Placed, place_labels
from uavgram.views.recording.scene import Eye
from uavgram.views.recording.stream import Recorder
from uavgram.views.style import QUIET

HALF_LETTER_ON_SCREEN, LINE_ON_SCREEN = 0.0056, 0.040
"""Half the width of a letter on a usual screen, and the height of a line, in views of space.

Both are tangents of angles of view.
"""
HALF_VIEW = np.array([0.74, 0.50])
"""Half the size of such a view, as tangents."""
HALF_DOT, GAP = 0.004, 0.008
"""Margin around points without texts, and gap between a text and its object."""
REACH = 6.0
"""Largest distance of a text from its object, in its heights: a line leads to it."""


@dataclass(frozen=True, eq=False)
class ViewTexts:
    """Texts in space for one view.

    Attributes
    ----------
    rows
        (n,) indices of these texts among those to place.
    place_m, words
        (n, 3) places below which they are written, and (n,) texts.
    leaders_m
        (2, 3) lines to texts that are not beside their objects.
    """

    rows: Ints
    place_m: Floats
    words: tuple[str, ...]
    leaders_m: list[Floats]


def place_in_space(
    eye: Eye,
    anchor_m: Floats,
    words: Sequence[str],
    *,
    dots_m: Floats | None = None,
    most: int | None = None,
    spread: float = 1.0,
) -> ViewTexts:
    """Place texts in a view of space, the first ones first; those without room are omitted.

    Parameters
    ----------
    eye
        Eye of the view as it opens.
    anchor_m
        (N, 3) named objects.
    words
        (N,) texts.
    dots_m
        (K, 3) points that must not be covered.
    most
        Largest number of texts; by default all.
    spread
        Factor on the room of each.
    """
    spots = eye.project_to_screen(np.reshape(anchor_m, (-1, 3)))
    dots = np.empty((0, 2)) if dots_m is None else eye.project_to_screen(dots_m)
    placed = place_texts(
        spots * [1.0, -1.0],
        words,
        spread * np.array([HALF_LETTER_ON_SCREEN, LINE_ON_SCREEN / 2]),
        (-HALF_VIEW, HALF_VIEW),
        np.column_stack([dots * [1.0, -1.0], np.tile([HALF_DOT, HALF_DOT, 0.0], (len(dots), 1))]),
        most=most,
    )
    rows = np.flatnonzero(np.isfinite(placed.boxes[:, 0])).astype(np.int64)
    places = eye.place_in_space(anchor_m[rows], places_below(placed)[rows] * [1.0, -1.0])
    leaders = [
        np.stack([anchor_m[row], place])
        for row, place in zip(rows, places, strict=True)
        if np.isfinite(placed.leaders[row, 0, 0])
    ]
    return ViewTexts(rows, places, tuple(words[row] for row in rows.tolist()), leaders)


def place_texts(
    spots: Floats,
    words: Sequence[str],
    letter: Floats,
    bounds: tuple[Floats, Floats],
    taken: Floats,
    *,
    ranks: Sequence[int] | None = None,
    most: int | None = None,
    gap: float = GAP / LINE_ON_SCREEN,
) -> Placed:
    """Place level texts of one font size in a view whose y goes down, the first ones first.

    Parameters
    ----------
    spots
        (N, 2) named objects.
    words
        (N,) texts.
    letter
        (2,) half the width of a letter and half the height of a line.
    bounds
        First and last corner (2,) of the view.
    taken
        (t, 5) places where no text may be.
    ranks
        (N,) texts of a lower rank come first, by default in their order; those of a negative one
        must be at their objects.
    most
        Largest number of texts; by default all.
    gap
        Gap between a text and its object, in heights of a line.
    """
    ranks = range(len(words)) if ranks is None else ranks
    labels = [
        Label(
            spot,
            spot,
            letter * [len(text) + 1.0, 1.0],
            2.0 * gap * float(letter[1]),
            "at" if rank < 0 else "beside",
            rank=rank,
        )
        for spot, text, rank in zip(spots, words, ranks, strict=True)
    ]
    return place_labels(labels, taken, bounds, least=1.0, reach=REACH, most=most)


def places_below(placed: Placed) -> Floats:
    """Return the (N, 2) places below which texts are written, where y goes down."""
    return np.asarray(placed.boxes[:, :2] - placed.boxes[:, 3:4] * [0.0, 1.0])


def log_in_space(recorder: Recorder, path: str, placed: ViewTexts) -> None:
    """Log texts and, below the same entity, the lines to their objects.

    Parameters
    ----------
    recorder
        The open recording.
    path
        Path of the entity.
    placed
        The placed texts.
    """
    if placed.words:
        recorder.texts(path, placed.place_m, placed.words)
    recorder.lines(f"{path}/lines", placed.leaders_m, QUIET, 1.2)
