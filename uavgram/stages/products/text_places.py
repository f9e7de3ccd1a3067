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
            first, count = first + count, 2 * count
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
    between, first, second = (x[a, b], y[a, b]), one[a], other[b]
    near[a, b] = _meet(between, first, second) & _meet(between, second, first)
    return near


def _meet(between: tuple[Floats, Floats], own: Floats, other: Floats) -> Bools:
    """(n,) whether rectangles (n, 5) overlap along both sides of the first ones.

    Parameters
    ----------
    between
        (n,) and (n,): from the middle of one to that of the other.
    own, other
        The rectangles.
    """
    (x, y), (cos, sin) = between, (np.cos(own[:, 4]), np.sin(own[:, 4]))
    turn = other[:, 4] - own[:, 4]
    c, s = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    along = np.abs(x * cos + y * sin) < own[:, 2] + other[:, 2] * c + other[:, 3] * s
    across = np.abs(y * cos - x * sin) < own[:, 3] + other[:, 2] * s + other[:, 3] * c
    return np.asarray(along & across, dtype=np.bool_)
