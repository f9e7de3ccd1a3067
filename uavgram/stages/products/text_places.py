"""Where the texts of a picture go: none covers another, and none is far from what it names."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Bools, Floats, Ints

REACH = 4.0
"""A text is at most that far from what it names at first, in heights of a line of text, where
nothing else is asked for."""

_FARTHER = 1.1
"""Each time that the letters get smaller, texts may be so much farther away, in their heights."""

_SMALLER = (0.5, 0.8)
"""Letters get smaller by such a factor, the nearer to the first the more texts had no room."""

_SHARES = (0.5, 0.35, 0.65, 0.2, 0.8)
"""Of a line, where the middle of its text may be."""

_FIRST = (16, 80)
"""So many places are tried first: most texts have room at once."""

_ROOM = 64
"""Places that are kept room for at first."""

_MOVED_GAP = 0.375
"""Of half the height of a text: between the end of a line and a text that was moved beyond it."""


class Label(NamedTuple):
    """A text to be placed, with letters of full size, in the units of the picture.

    Attributes
    ----------
    start, end
        (2,) ends of the line that it names; of a point both are the same.
    half
        (2,) half its width and height.
    gap
        Between the text and what it names.
    is_turned
        Whether it runs along the line, beside it; otherwise it is level, and may be on the line.
    is_needed
        Otherwise it is left out where there is no room right beside what it names.
    """

    start: Floats
    end: Floats
    half: Floats
    gap: float
    is_turned: bool = False
    is_needed: bool = True


class Placed(NamedTuple):
    """Where texts went.

    Attributes
    ----------
    boxes
        (n, 5) places as of `TextPlaces`; NaN where there was no room even for the smallest letters.
    size
        Of the letters, as a share of the full one.
    """

    boxes: Floats
    size: float


def place_labels(
    labels: Sequence[Label],
    taken: Floats,
    bounds: tuple[Floats, Floats] | None = None,
    least: float = 0.01,
    reach: float = REACH,
) -> Placed:
    """Place all texts; the letters of all are made smaller until there is room for each.

    Parameters
    ----------
    labels
        What is to be placed; those with the least choice are placed first.
    taken
        (t, 5) places that are kept free.
    bounds
        Lower and upper corner (2,) of the picture; by default it is endless.
    least
        Size of letters that are not made smaller.
    reach
        How far texts may be from what they name at first, in heights of a line of text.
    """
    length = np.array([float(np.linalg.norm(one.end - one.start)) for one in labels])
    is_extra = np.array([not one.is_needed for one in labels], np.bool_)
    order = np.lexsort((length, is_extra))
    size = 1.0
    while True:
        places, boxes = TextPlaces(taken), np.full((len(labels), 5), np.nan)
        for row in order:
            box = _place(places, labels[row], size, reach, bounds)
            if box is not None:
                boxes[row] = box
            elif labels[row].is_needed and size > least:
                break
        else:
            return Placed(boxes, size)
        fitted = float(np.isfinite(boxes[~is_extra, 0]).mean())
        size = max(least, size * min(max(fitted, _SMALLER[0]), _SMALLER[1]))
        reach *= _FARTHER


def leader(label: Label, box: Floats) -> Floats | None:
    """(2, 2) a line from what a text names to the text; None where these are close.

    Parameters
    ----------
    label
        The text.
    box
        (5,) its place.
    """
    way = label.end - label.start
    share = float((box[:2] - label.start) @ way) / max(float(way @ way), 1e-12)
    foot = label.start + min(max(share, 0.0), 1.0) * way
    cos, sin = math.cos(box[4]), math.sin(box[4])
    axes = np.array([[cos, sin], [-sin, cos]])
    edge = box[:2] + np.clip(axes @ (foot - box[:2]), -box[2:4], box[2:4]) @ axes
    beside = (1.0 + label.gap / label.half[1]) * box[3]
    return np.stack([foot, edge]) if np.linalg.norm(edge - foot) > beside else None


def _place(
    places: TextPlaces,
    label: Label,
    size: float,
    reach: float,
    bounds: tuple[Floats, Floats] | None,
) -> Floats | None:
    """Take the best place that is free, (5,); None where none is."""
    half, gap = size * label.half, size * label.gap
    rounds = np.arange(max(int(reach - gap / (2 * half[1])), 0) + 1 if label.is_needed else 1)
    way = label.end - label.start
    length = math.hypot(*way)
    shift = np.zeros(2)
    if label.is_turned and length > 0:
        shift = _moved_aside(half, length) / 2 * way / length
        candidates = _along(label.start + shift, way / length, length, half, gap, rounds)
        candidates[:, 2] += math.hypot(*shift)
    else:
        candidates = around((label.start + label.end) / 2, half, gap, rounds)
        if length > 0:
            on_line = label.start + np.array(_SHARES)[:, None] * way
            on_line = np.column_stack([on_line, np.broadcast_to([*half, 0.0], (len(on_line), 3))])
            candidates = np.concatenate([on_line, candidates])
    if bounds is not None:
        low, high = bounds[0] + candidates[:, 2:4], bounds[1] - candidates[:, 2:4]
        candidates[:, :2] = np.clip(candidates[:, :2], low, np.maximum(low, high))
    for some in np.split(candidates, _FIRST):
        if (which := places.take(some)) is not None:
            return np.array([*(some[which, :2] - shift), *half, some[which, 4]])
    return None


def _moved_aside(half: Floats, length: float) -> float:
    """How far some programs move a text along its line where it is longer than that.

    `RS_Dimension::updateCreateDimensionLine` of LibreCAD 2.2: by half of both and a gap, wherever
    the text was. Both places are kept free.
    """
    return float(half[0] + length / 2 + _MOVED_GAP * half[1]) if 2 * half[0] > length else 0.0


def _along(
    start: Floats, way: Floats, length: float, half: Floats, gap: float, rounds: Ints
) -> Floats:
    """(c, 5) places on both sides of a line, farther and farther out, and beyond its ends."""
    beyond = float(half[0] + half[1]) / length
    share = np.array([*_SHARES, 1.0 + beyond, -beyond])
    out = gap + half[1] + 2 * half[1] * np.repeat(rounds, 2)
    out[1::2] *= -1.0
    across = np.array([-way[1], way[0]])
    middle = start + length * share[:, None] * way + out[:, None, None] * across
    size = [*half, math.atan2(way[1], way[0])]
    return np.column_stack(
        [middle.reshape(-1, 2), np.broadcast_to(size, (len(out) * len(share), 3))]
    )


class TextPlaces:
    """The places that are taken, while texts are placed one after the other.

    A place is a rectangle (x, y, half its width, half its height, angle [rad] counterclockwise),
    x and y of its middle in the units of the drawing.

    Parameters
    ----------
    taken
        (t, 5) places that are taken from the beginning.
    """

    def __init__(self, taken: Floats | None = None) -> None:
        self._taken, self._reach = np.zeros((_ROOM, 5)), np.zeros(_ROOM)
        self._count = 0
        for place in () if taken is None else taken:
            self.reserve(place)

    def take(self, candidates: Floats) -> int | None:
        """Take the first place that is free.

        Parameters
        ----------
        candidates
            (c, 5) places, the best first.

        Returns
        -------
        Which one; None where all of them are taken.
        """
        free = np.flatnonzero(~overlaps(candidates, self._near(candidates)).any(axis=1))
        if not len(free):
            return None
        self.reserve(candidates[free[0]])
        return int(free[0])

    def reserve(self, place: Floats) -> None:
        """Keep a place (5,) free of all that is placed from now on."""
        if self._count == len(self._taken):
            self._taken = np.concatenate([self._taken, np.zeros_like(self._taken)])
            self._reach = np.concatenate([self._reach, np.zeros_like(self._reach)])
        self._taken[self._count] = place
        self._reach[self._count] = math.hypot(place[2], place[3])
        self._count += 1

    def _near(self, candidates: Floats) -> Floats:
        """(n, 5) what is taken and may meet some places (c, 5)."""
        taken, reach = self._taken[: self._count], self._reach[: self._count]
        if not len(candidates) or not len(taken):
            return taken
        x, y, width, height, _ = candidates.T
        reach = reach + math.hypot(width.max(), height.max())
        is_near = (taken[:, 0] > x.min() - reach) & (taken[:, 0] < x.max() + reach)
        is_near &= (taken[:, 1] > y.min() - reach) & (taken[:, 1] < y.max() + reach)
        return np.asarray(taken[is_near])


def around(anchor: Floats, half: Floats, gap: float, ring: int | Ints) -> Floats:
    """(16, 5) level places of a text around a point: right above first, then the other corners.

    Parameters
    ----------
    anchor
        (2,) the point.
    half
        (2,) half the width and height of the text.
    gap
        Between point and text in the innermost ring.
    ring
        From 0 on; each is one height of the text farther out. Of (n,) rings, (16n, 5) places.
    """
    away = half + gap * _GAP_SHARES + 2.0 * np.reshape(ring, (-1, 1, 1)) * half[1]
    middle = (anchor + _DIRECTIONS * away).reshape(-1, 2)
    return np.column_stack([middle, np.broadcast_to([*half, 0.0], (len(middle), 3))])


_DIRECTIONS = np.array(
    [
        *((1, 1), (-1, 1), (1, -1), (-1, -1), (1, 0), (-1, 0), (0, 1), (0, -1)),
        *((1, 0.5), (-1, 0.5), (1, -0.5), (-1, -0.5)),
        *((0.5, 1), (-0.5, 1), (0.5, -1), (-0.5, -1)),
    ],
    np.float64,
)


# Both ways it is as far aside as straight out.
_GAP_SHARES = np.where(_DIRECTIONS.all(axis=1, keepdims=True), math.sqrt(0.5), 1.0)


def overlaps(one: Floats, other: Floats) -> Bools:
    """(a, b) whether rectangles (a, 5) and (b, 5) have a common area.

    Two convex shapes have none if and only if a line parts them; of rectangles, one that is
    parallel to a side (Ericson 2005, Real-Time Collision Detection, 4.4.1).
    """
    x, y, w, h, angle = one.T[:, :, None]
    other_x, other_y, other_w, other_h, other_angle = other.T
    x, y = x - other_x, y - other_y
    if not one[:, 4].any() and not other[:, 4].any():  # as in most pictures
        return np.asarray((np.abs(x) < w + other_w) & (np.abs(y) < h + other_h))
    turn = other_angle - angle
    c, s = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    return np.asarray(
        _within(x, y, angle, w + other_w * c + other_h * s, h + other_w * s + other_h * c)
        & _within(x, y, other_angle, other_w + w * c + h * s, other_h + w * s + h * c)
    )


def _within(x: Floats, y: Floats, angle: Floats, width: Floats, height: Floats) -> Bools:
    """Whether places are within rectangles about zero that are turned by an angle [rad]."""
    cos, sin = np.cos(angle), np.sin(angle)
    aside, up = np.abs(x * cos + y * sin), np.abs(y * cos - x * sin)
    return np.asarray((aside < width) & (up < height))
