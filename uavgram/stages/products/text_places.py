"""Where the texts of a drawing go so that none covers another."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Bools, Floats, Ints

ROUNDS = 200
"""How often a text is moved farther out before it stays where it would cover another."""

_AT_ONCE = 6
"""Rounds that are tried together at first."""

_ROOM = 64
"""Places that are kept room for at first."""

_SQUARE = 8.0
"""Side of a square in which places are looked up, in half the width of the first text."""

_MANY = 100
"""Places from which on they are looked at square by square."""

_WIDE = 5.0
"""Side of what is looked at together, in sides of a square."""

_MOST_SQUARES = 1000
"""What reaches into more of them is compared with everything."""

_FEW = 400
"""So many places are sooner compared with all than looked up."""

_ROUNDED_UP = 1.001
"""What is no farther than that may meet, whatever the rounding."""


class Choice(NamedTuple):
    """Where a text went: rounds from `first` to before `end` were tried, and the place `which`.

    `is_crowded` where none of all rounds was free, and it covers another.
    """

    first: int
    end: int
    which: int
    is_crowded: bool


class TextPlaces:
    """The places that are taken, while texts are placed one after the other.

    A place is a rectangle (x, y, half its width, half its height, angle [rad] counterclockwise),
    x and y of its middle in the units of the drawing.

    Parameters
    ----------
    like
        Which places the same texts took, one after the other, in another drawing of the same
        things: where such a place is free here too, nothing else is tried, nor where there was
        none.
    """

    def __init__(self, like: Sequence[Choice] = ()) -> None:
        self._like = iter(like)
        self.choices: list[Choice] = []
        self._taken = np.zeros((_ROOM, 5))
        self._count = 0
        self._side = 0.0  # of a square; the first text says how large
        self._in_square: dict[tuple[int, int], list[int]] = {}
        self._large: list[int] = []

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
        is_free = np.ones(len(candidates), np.bool_)
        for rows in self._apart(candidates):
            some = candidates[rows]
            is_free[rows] = ~overlaps(some, self._near(some)).any(axis=1)
        free = np.flatnonzero(is_free)
        if not len(free):
            return None
        self.reserve(candidates[free[0]])
        return int(free[0])

    def take_near(self, candidates: Callable[[Ints], Floats]) -> Floats:
        """Take the first free place of places that go farther and farther out.

        Parameters
        ----------
        candidates
            Of rounds (n,), each from 0 on: their (c, 5) places, the best first.

        Returns
        -------
        (5,) the place; after `ROUNDS` without a free one, the first of all.
        """
        if (like := next(self._like, None)) is not None:
            places = candidates(np.arange(like.first, like.end))[[like.which]]
            if like.is_crowded or self.take(places) is not None:
                self.choices.append(like)
                return np.asarray(places[0])
        first, count = 0, _AT_ONCE
        while first < ROUNDS:  # more and more at a time: most texts have room at once
            end = min(first + count, ROUNDS)
            places = candidates(np.arange(first, end))
            if (which := self.take(places)) is not None:
                self.choices.append(Choice(first, end, which, is_crowded=False))
                return np.asarray(places[which])
            first, count = end, 3 * count
        self.choices.append(Choice(0, 1, 0, is_crowded=True))
        return np.asarray(candidates(np.zeros(1, np.int64))[0])

    def reserve(self, place: Floats) -> None:
        """Keep a place (5,) free of all that is placed from now on."""
        if self._count == len(self._taken):
            self._taken = np.concatenate([self._taken, np.zeros_like(self._taken)])
        self._taken[self._count] = place
        x, y, width, height, _ = place.tolist()
        reach = math.hypot(width, height)
        squares = self._squares((x - reach, y - reach), (x + reach, y + reach))
        if squares is None:
            self._large.append(self._count)
        for square in squares or ():
            self._in_square.setdefault(square, []).append(self._count)
        self._count += 1

    def _apart(self, candidates: Floats) -> Sequence[Ints | slice]:
        """Rows of places that lie together: what is near to all of many would be far from most."""
        if self._count <= _FEW or len(candidates) < _MANY:
            return [np.s_[:]]
        square = np.floor(candidates[:, :2] / (_WIDE * self._side))
        order = np.lexsort(square.T)
        new = np.flatnonzero((np.diff(square[order], axis=0) != 0).any(axis=1)) + 1
        return np.split(order, new)

    def _near(self, candidates: Floats) -> Floats:
        """(n, 5) what is taken and may meet some places, in the order in which it was taken."""
        if not self._side:
            self._side = _SQUARE * float(candidates[:, 2:4].max(initial=0.0))
        if self._count <= _FEW or not len(candidates):
            return self._taken[: self._count]
        reach = np.hypot(candidates[:, 2], candidates[:, 3])[:, None]
        low, high = candidates[:, :2] - reach, candidates[:, :2] + reach
        squares = self._squares(low.min(axis=0).tolist(), high.max(axis=0).tolist())
        if squares is None:
            return self._taken[: self._count]
        found = {row for square in squares for row in self._in_square.get(square, ())}
        return self._taken[sorted(found.union(self._large))]

    def _squares(
        self, low: Sequence[float], high: Sequence[float]
    ) -> Iterable[tuple[int, int]] | None:
        """The squares between two corners; None where there are too many of them."""
        if not self._side:
            return None
        (x, to_x), (y, to_y) = (
            (a // self._side, b // self._side) for a, b in zip(low, high, strict=True)
        )
        if not (to_x - x + 1.0) * (to_y - y + 1.0) <= _MOST_SQUARES:
            return None
        return product(range(int(x), int(to_x) + 1), range(int(y), int(to_y) + 1))


def around(anchor: Floats, half: Floats, gap: float, ring: int | Ints) -> Floats:
    """(8, 5) level places of a text around a point: right above first, then the other corners.

    Parameters
    ----------
    anchor
        (2,) the point.
    half
        (2,) half the width and height of the text.
    gap
        Between point and text in the innermost ring.
    ring
        From 0 on; each is one height of the text farther out. Of (n,) rings, (8n, 5) places.
    """
    away = half + gap + 2.0 * np.reshape(ring, (-1, 1, 1)) * half[1]
    middle = (anchor + _CORNERS * away).reshape(-1, 2)
    return np.column_stack([middle, np.broadcast_to([*half, 0.0], (len(middle), 3))])


_CORNERS = np.array(
    [(1, 1), (-1, 1), (1, -1), (-1, -1), (1, 0), (-1, 0), (0, 1), (0, -1)], np.float64
)


def overlaps(one: Floats, other: Floats) -> Bools:
    """(a, b) whether rectangles (a, 5) and (b, 5) have a common area.

    Two convex shapes have none if and only if a line parts them; of rectangles, one that is
    parallel to a side (Ericson 2005, Real-Time Collision Detection, 4.4.1).
    """
    # All places of one text have the same angle.
    if len(one) and (one[:, 4] == one[0, 4]).all():
        return _meet(one, other, float(one[0, 4]))
    met = np.empty((len(one), len(other)), np.bool_)
    for angle in np.unique(one[:, 4]):
        rows = one[:, 4] == angle
        met[rows] = _meet(one[rows], other, float(angle))
    return met


def _meet(one: Floats, other: Floats, angle: float) -> Bools:
    """The same of rectangles (a, 5) that all have one angle, in whose axes all is counted."""
    to_own = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    turn = other[:, 4] - angle
    cos, sin = np.cos(turn), np.sin(turn)
    c, s = np.abs(cos), np.abs(sin)
    half, (w, h) = one[:, 2:4], other[:, 2:4].T
    own, (x, y) = one[:, :2] @ to_own, (other[:, :2] @ to_own).T
    wide, tall = w * c + h * s, w * s + h * c
    # Most pairs are far apart, which comparing their ends shows soonest.
    begin, end = (own - half)[..., None], (own + half)[..., None]
    met: Bools = begin[:, 0] < x + _ROUNDED_UP * wide
    met &= end[:, 0] > x - _ROUNDED_UP * wide
    met &= begin[:, 1] < y + _ROUNDED_UP * tall
    met &= end[:, 1] > y - _ROUNDED_UP * tall
    pairs = np.flatnonzero(met)
    a, b = np.divmod(pairs, len(other))
    x, y, w, h, wide, tall, cos, sin, c, s = np.stack([x, y, w, h, wide, tall, cos, sin, c, s])[
        :, b
    ]
    own_x, own_y, width, height = np.column_stack([own, half])[a].T
    x, y = own_x - x, own_y - y
    met.ravel()[pairs] = (
        (np.abs(x) < width + wide)
        & (np.abs(y) < height + tall)
        & (np.abs(x * cos + y * sin) < w + width * c + height * s)  # along the others' sides
        & (np.abs(y * cos - x * sin) < h + width * s + height * c)
    )
    return met
