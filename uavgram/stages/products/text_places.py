"""Place the texts of a picture without overlap, and close to the objects that they name."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np

from uavgram.model.arrays import Bools, Floats, Ints

REACH = 4.0
"""Largest initial distance of a text from its object, in heights of a line of text, by default."""

_FARTHER = 1.1
"""Factor of the largest distance, in heights of the letters, each time that these get smaller."""

_SMALLER = (0.5, 0.8)
"""Range of the factor by which letters get smaller: the smaller, the more texts had no room."""

_SHARES = (0.5, 0.35, 0.65, 0.2, 0.8)
"""Positions of the middle of a text along its line, as shares of the line."""

_FIRST = (16, 80)
"""Numbers of places that are tried first: most texts have room at once."""

_CLOSE = 1
"""Number of heights of a text from its line up to which it is rotated, if it may be level too."""

_ROOM = 64
"""Initial capacity for places."""

_FEW = 64
"""Number of taken places up to which a choice of those near by takes longer than all of them."""

_OVER_LETTERS = 0.7
"""Share of a text's half width at which a line from above or below ends, so that it meets
letters."""

_FEET = np.linspace(0.0, 1.0, 65)
"""Shares of a line from which a line to its text may begin."""

_MOVED_GAP = 0.375
"""Gap between the end of a line and a text moved beyond it, as a share of half the text's
height."""


Where = Literal["beside", "along", "near", "at"]
"""Level, beside a point or on a line; rotated, beside a line; rotated where there is room close to
the line, else level; or at one fixed place."""


class Label(NamedTuple):
    """Text to be placed, with letters of full size, in the units of the picture.

    Attributes
    ----------
    start, end
        (2,) ends of the line that it names; of a point both are the same.
    half
        (2,) half its width and height.
    gap
        Distance between the text and its object.
    where
        Places that are tried. A text with one fixed place is in the middle of its line, rotated by
        `turn`.
    is_needed
        If false, it is left out where there is no room right beside its object.
    rank
        Texts of a lower rank are placed first; within a rank those with the least choice.
    turn
        Angle [rad] of a text with one fixed place.
    """

    start: Floats
    end: Floats
    half: Floats
    gap: float
    where: Where = "beside"
    is_needed: bool = True
    rank: int = 0
    turn: float = 0.0


class Placed(NamedTuple):
    """Places of texts.

    Attributes
    ----------
    boxes
        (n, 5) places as of `TextPlaces`; NaN where there was no room even for the smallest letters.
    leaders
        (n, 2, 2) lines from the objects to the edges of their boxes; NaN where these are close.
    sides
        (n,) end of a leader: -1 at the beginning of the text, 1 at its end, 0 above or below it, or
        no leader.
    size
        Size of the letters, as a share of the full one.
    """

    boxes: Floats
    leaders: Floats
    sides: Ints
    size: float


def place_labels(
    labels: Sequence[Label],
    taken: Floats | None = None,
    bounds: tuple[Floats, Floats] | None = None,
    least: float = 0.01,
    reach: float = REACH,
    most: int | None = None,
) -> Placed:
    """Place all texts; the letters of all are made smaller until there is room for each.

    All drawings use this function: report, plan, field sheet, CAD drawing and recording.

    Parameters
    ----------
    labels
        Texts to be placed.
    taken
        (t, 5) places that are kept free.
    bounds
        Lower and upper corner (2,) of the picture; by default it is unlimited.
    least
        Least size of letters; texts without room at it are left out.
    reach
        Largest initial distance of texts from their objects, in heights of a line of text.
    most
        Largest number of texts; by default all.
    """
    taken = np.empty((0, 5)) if taken is None else np.reshape(taken, (-1, 5))
    length = [float(np.linalg.norm(one.end - one.start)) for one in labels]
    order = np.lexsort(
        (length, [one.rank for one in labels], [not one.is_needed for one in labels])
    )
    size = 1.0
    while True:
        places, boxes = TextPlaces(taken), np.full((len(labels), 5), np.nan)
        for count, row in enumerate(order):
            if most is not None and np.isfinite(boxes[order[:count], 0]).sum() == most:
                return _add_leaders(labels, boxes, size)
            box = _place(places, labels[row], size, reach, bounds)
            if box is not None:
                boxes[row] = box
            elif labels[row].is_needed and size > least:
                break
        else:
            return _add_leaders(labels, boxes, size)
        # No room for a needed text: make all letters smaller, and allow longer distances.
        needed = [row for row, one in enumerate(labels) if one.is_needed]
        fitted = float(np.isfinite(boxes[needed, 0]).mean())
        size = max(least, size * min(max(fitted, _SMALLER[0]), _SMALLER[1]))
        reach *= _FARTHER


def _add_leaders(labels: Sequence[Label], boxes: Floats, size: float) -> Placed:
    leaders, sides = np.full((len(labels), 2, 2), np.nan), np.zeros(len(labels), np.int64)
    has_place = np.isfinite(boxes[:, 0])
    rows = [row for row in np.flatnonzero(has_place).tolist() if labels[row].where != "at"]
    if rows:
        leaders[rows], sides[rows] = _make_leaders([labels[row] for row in rows], boxes[rows])
    return Placed(boxes, leaders, sides, size)


def _make_leaders(labels: Sequence[Label], boxes: Floats) -> tuple[Floats, Ints]:
    """Return the lines (n, 2, 2) from texts' objects to the edges of their boxes (n, 5), and sides.

    NaN where the text is not farther than half its height and the usual gap. The line ends in the
    middle of a side of the box where it comes from that side, otherwise above or below letters.
    """
    start = np.array([label.start for label in labels])
    way = np.array([label.end for label in labels]) - start
    center, half = boxes[:, :2], boxes[:, 2:4]
    # Feet on the line: the one nearest to the middle of the text, then all along the line.
    middle = _dot(center - start, way) / np.maximum(_dot(way, way), 1e-12)
    along = np.broadcast_to(_FEET, (len(labels), len(_FEET)))
    shares = np.column_stack([np.clip(middle, 0.0, 1.0), along])
    feet = start[:, None] + shares[..., None] * way[:, None]
    cos, sin = np.cos(boxes[:, 4]), np.sin(boxes[:, 4])
    axes = np.stack([np.stack([cos, sin], 1), np.stack([-sin, cos], 1)], 1)
    own = (feet - center[:, None]) @ np.swapaxes(axes, 1, 2)
    off = own - np.clip(own, -half[:, None], half[:, None])
    away = np.hypot(off[..., 0], off[..., 1])
    nearest_m = away.min(axis=1)
    gap = [label.gap / label.half[1] for label in labels]
    is_beside = nearest_m <= (1.0 + np.array(gap)) * half[:, 1]
    # beside the middle of the text, unless that is much farther
    first = np.argmin(away > (nearest_m + half[:, 1])[:, None], axis=1)
    each = np.arange(len(labels))
    foot, own = feet[each, first], own[each, first]
    side = np.where(np.abs(own[:, 0]) <= half[:, 0], 0, np.sign(own[:, 0])).astype(np.int64)
    edge = np.clip(own, -half, half)
    over = _OVER_LETTERS * half[:, 0]
    edge[:, 0] = np.where(side == 0, np.clip(own[:, 0], -over, over), edge[:, 0])
    edge[:, 1] = np.where(side == 0, edge[:, 1], 0.0)
    leaders = np.stack([foot, center + (edge[:, None] @ axes)[:, 0]], axis=1)
    return np.where(is_beside[:, None, None], np.nan, leaders), np.where(is_beside, 0, side)


def _dot(one: Floats, other: Floats) -> Floats:
    """Compute the scalar products (n,) of vectors (n, 2)."""
    return np.asarray((one * other).sum(axis=1))


def _place(
    places: TextPlaces,
    label: Label,
    size: float,
    reach: float,
    bounds: tuple[Floats, Floats] | None,
) -> Floats | None:
    """Take the best free place (5,); None where none is."""
    half, gap = size * label.half, size * label.gap
    rounds = np.arange(max(int(reach - gap / (2 * half[1])), 0) + 1 if label.is_needed else 1)
    way, middle = label.end - label.start, (label.start + label.end) / 2
    length = math.hypot(*way)
    shift = np.zeros(2)
    if label.where == "at":
        candidates = np.array([[*middle, *half, label.turn]])
    elif label.where == "along" and length > 0:
        shift = _compute_shift_aside(half, length) / 2 * way / length
        candidates = _along(label.start + shift, way / length, length, half, gap, rounds)
        candidates[:, 2] += math.hypot(*shift)
    else:
        candidates = list_places_around(middle, half, gap, rounds)
        if length > 0:
            on_line = label.start + np.array(_SHARES)[:, None] * way
            on_line = np.column_stack([on_line, np.broadcast_to([*half, 0.0], (len(on_line), 3))])
            candidates = np.concatenate([on_line, candidates])
        if length > 0 and label.where == "near":
            close = _along(label.start, way / length, length, half, gap, rounds[:_CLOSE])
            beside = close.reshape(-1, len(_SHARES) + 2, 5)[:, : len(_SHARES)]
            candidates = np.concatenate([beside.reshape(-1, 5), candidates])
    # Move level places into the picture, and drop others outside it.
    if bounds is not None:
        candidates = _within_bounds(candidates, bounds, label.where)
    for first, end in pairwise((0, *_FIRST, len(candidates))):
        some = candidates[first:end]
        if len(some) and (which := places.take(some)) is not None:
            return np.array([*(some[which, :2] - shift), *half, some[which, 4]])
    return None


def _within_bounds(candidates: Floats, bounds: tuple[Floats, Floats], where: Where) -> Floats:
    """Move level places (c, 5) into the picture; keep rotated and fixed ones that are inside."""
    cos, sin = np.abs(np.cos(candidates[:, 4])), np.abs(np.sin(candidates[:, 4]))
    width, height = candidates[:, 2], candidates[:, 3]
    reach = np.column_stack([cos * width + sin * height, sin * width + cos * height])
    low, high = bounds[0] + reach, bounds[1] - reach
    if where in ("beside", "near"):
        level = candidates[:, 4] == 0.0
        moved = np.clip(candidates[:, :2], low, np.maximum(low, high))
        candidates[level, :2] = moved[level]
        low[level] = -np.inf
        high[level] = np.inf
    inside = (candidates[:, :2] >= low).all(axis=1) & (candidates[:, :2] <= high).all(axis=1)
    return np.asarray(candidates[inside])


def _compute_shift_aside(half: Floats, length: float) -> float:
    """Return the shift along its line that some programs give to a text longer than the line.

    `RS_Dimension::updateCreateDimensionLine` of LibreCAD 2.2: by half of both and a gap, for any
    place of the text. Both places are kept free.
    """
    return float(half[0] + length / 2 + _MOVED_GAP * half[1]) if 2 * half[0] > length else 0.0


def _along(
    start: Floats, way: Floats, length: float, half: Floats, gap: float, rounds: Ints
) -> Floats:
    """Return places (c, 5) on both sides of a line, at growing distances, and beyond its ends."""
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
    """Occupied places, while texts are placed one after the other.

    A place is a rectangle (x, y, half its width, half its height, angle [rad] counterclockwise), x
    and y of its middle in the units of the drawing.

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
        """Take the first free place.

        Parameters
        ----------
        candidates
            (c, 5) places, the best first.

        Returns
        -------
        Its index; None where all of them are taken.
        """
        free = np.flatnonzero(~overlaps(candidates, self._near(candidates)).any(axis=1))
        if not len(free):
            return None
        self.reserve(candidates[free[0]])
        return int(free[0])

    def reserve(self, place: Floats) -> None:
        """Reserve a place (5,)."""
        if self._count == len(self._taken):
            self._taken = np.concatenate([self._taken, np.zeros_like(self._taken)])
            self._reach = np.concatenate([self._reach, np.zeros_like(self._reach)])
        self._taken[self._count] = place
        self._reach[self._count] = math.hypot(place[2], place[3])
        self._count += 1

    def _near(self, candidates: Floats) -> Floats:
        """Return taken places (n, 5) that may overlap places (c, 5)."""
        taken, reach = self._taken[: self._count], self._reach[: self._count]
        if not len(candidates) or len(taken) <= _FEW:
            return taken
        x, y, width, height, _ = candidates.T
        reach = reach + math.hypot(width.max(), height.max())
        is_near = (taken[:, 0] > x.min() - reach) & (taken[:, 0] < x.max() + reach)
        is_near &= (taken[:, 1] > y.min() - reach) & (taken[:, 1] < y.max() + reach)
        return np.asarray(taken[is_near])


def list_places_around(anchor: Floats, half: Floats, gap: float, ring: int | Ints) -> Floats:
    """Return level places (16, 5) of a text around a point: right above first, then other corners.

    Parameters
    ----------
    anchor
        (2,) the point.
    half
        (2,) half the width and height of the text.
    gap
        Distance between point and text in the innermost ring.
    ring
        From 0 on; each is one height of the text farther out. For (n,) rings, (16n, 5) places.
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


# Diagonal places are at the same distance as straight ones.
_GAP_SHARES = np.where(_DIRECTIONS.all(axis=1, keepdims=True), math.sqrt(0.5), 1.0)


def overlaps(one: Floats, other: Floats) -> Bools:
    """Return whether rectangles (a, 5) and (b, 5) have a common area, (a, b).

    Two convex shapes have none if and only if a line separates them; for rectangles, one that is
    parallel to a side (Ericson 2005, Real-Time Collision Detection, 4.4.1).
    """
    x, y = one[:, :1] - other[:, 0], one[:, 1:2] - other[:, 1]
    if not one[:, 4].any() and not other[:, 4].any():  # as in most pictures
        width, height = one[:, 2:3] + other[:, 2], one[:, 3:4] + other[:, 3]
        return np.asarray((np.abs(x) < width) & (np.abs(y) < height))
    reach = _circumradius(one)[:, None] + _circumradius(other)
    found = np.asarray(x * x + y * y < reach * reach)
    i, j = np.nonzero(found)  # only pairs whose circumcircles meet
    x, y = x[i, j], y[i, j]
    _, _, w, h, angle = one[i].T
    _, _, other_w, other_h, other_angle = other[j].T
    turn = other_angle - angle
    c, s = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    found[i, j] = _within(x, y, angle, w + other_w * c + other_h * s, h + other_w * s + other_h * c)
    found[i, j] &= _within(x, y, other_angle, other_w + w * c + h * s, other_h + w * s + h * c)
    return found


def _circumradius(places: Floats) -> Floats:
    """Return the radius (n,) of the circle around each rectangle (n, 5)."""
    return np.hypot(places[:, 2], places[:, 3])


def _within(x: Floats, y: Floats, angle: Floats, width: Floats, height: Floats) -> Bools:
    """Return whether places are within rectangles about zero, rotated by an angle [rad]."""
    cos, sin = np.cos(angle), np.sin(angle)
    aside, up = np.abs(x * cos + y * sin), np.abs(y * cos - x * sin)
    return np.asarray((aside < width) & (up < height))
