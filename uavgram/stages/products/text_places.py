"""Where the texts of a drawing go so that none covers another."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from uavgram.model.arrays import Bools, Floats

ROUNDS = 200
"""How often a text is moved farther out before it stays where it would cover another."""


class TextPlaces:
    """The places that are taken, while texts are placed one after the other.

    A place is a rectangle (x, y, half its width, half its height, angle [rad] counterclockwise),
    x and y of its middle in the units of the drawing.
    """

    def __init__(self) -> None:
        self._taken = np.zeros((0, 5))

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
        free = np.flatnonzero(~overlaps(candidates, self._taken).any(axis=1))
        if not len(free):
            return None
        self.reserve(candidates[free[0]])
        return int(free[0])

    def take_near(self, candidates: Callable[[int], Floats]) -> Floats:
        """Take the first free place of places that go farther and farther out.

        Parameters
        ----------
        candidates
            Of a round, from 0 on: its (c, 5) places, the best first.

        Returns
        -------
        (5,) the place; after `ROUNDS` without a free one, the first of all.
        """
        first, count = 0, 1
        while first < ROUNDS:  # more and more at a time: most texts have room at once
            places = np.concatenate([candidates(k) for k in range(first, first + count)])
            if (which := self.take(places)) is not None:
                return np.asarray(places[which])
            first, count = first + count, 4 * count
        return np.asarray(candidates(0)[0])

    def reserve(self, place: Floats) -> None:
        """Keep a place (5,) free of all that is placed from now on."""
        self._taken = np.concatenate([self._taken, place[None]])


def around(anchor: Floats, half: Floats, gap: float, ring: int) -> Floats:
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
        From 0 on; each is one height of the text farther out.
    """
    away = half + gap + 2.0 * ring * half[1]
    corners = [(1, 1), (-1, 1), (1, -1), (-1, -1), (1, 0), (-1, 0), (0, 1), (0, -1)]
    middle = anchor + np.array(corners, np.float64) * away
    return np.column_stack([middle, np.broadcast_to([*half, 0.0], (len(middle), 3))])


def overlaps(one: Floats, other: Floats) -> Bools:
    """(a, b) whether rectangles (a, 5) and (b, 5) have a common area.

    Two convex shapes have none if and only if a line parts them; of rectangles, one that is
    parallel to a side (Ericson 2005, Real-Time Collision Detection, 4.4.1).
    """
    reach = np.hypot(one[:, 2], one[:, 3])[:, None] + np.hypot(other[:, 2], other[:, 3])
    x, y = (other[:, k] - one[:, None, k] for k in range(2))
    near: Bools = x**2 + y**2 < reach**2
    a, b = np.nonzero(near)
    first, second, between = one[a], other[b], np.stack([x[a, b], y[a, b]], axis=1)
    meet = np.ones(len(a), dtype=np.bool_)
    for axes in (_sides(first), _sides(second)):
        for k in range(2):
            axis = axes[:, k]
            extent = _extent(first, axis) + _extent(second, axis)
            meet &= np.abs(np.einsum("ni,ni->n", between, axis)) < extent
    near[a, b] = meet
    return near


def _sides(places: Floats) -> Floats:
    """(n, 2, 2) unit vectors along width and height."""
    cos, sin = np.cos(places[:, 4]), np.sin(places[:, 4])
    return np.stack([np.stack([cos, sin], axis=1), np.stack([-sin, cos], axis=1)], axis=1)


def _extent(places: Floats, axis: Floats) -> Floats:
    """(n,) half the size of each rectangle along an axis of its own."""
    along = np.abs(np.einsum("nki,ni->nk", _sides(places), axis))
    return np.asarray(np.einsum("nk,nk->n", along, places[:, 2:4]))
