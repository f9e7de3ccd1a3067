"""Which tie points are kept: few, seen by many photos, spread over each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
from scipy.spatial import cKDTree

from uavgram.model.arrays import Floats, Ints
from uavgram.stages.tie.tracks import Tracks

GRID = 10, 8
"""Columns and rows of the cells of a photo: about as many sightings are kept in each photo."""

FINE = 60, 45
"""Columns and rows of the cells in which a second sighting tells nothing new."""

MOST = 100
"""Sightings kept in a photo."""

ENOUGH = 60
"""Sightings from which a photo needs no more that share their cells with others."""

SHARED = 12
"""Points that two photos which were matched should have in common."""

BESIDE = 8
"""Points beside each pick: they tell how high the ground is there, see stages/refine/near_ties."""

NEAR = 0.05
"""How near to a pick those are, as a share of the photo's width."""

SURE = 3
"""Photos that show each of them, at least: of two, the height is less sure."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Sighted:
    """What is to be chosen from.

    Attributes
    ----------
    tracks
        (S,) sightings.
    photo
        (S,) of each.
    pixel_px, sigma_px
        (S, 2), (S,).
    width_px, height_px
        Of the photos.
    picked_photo, picked_px
        (P,), (P, 2) what people picked, and where.
    """

    tracks: Tracks
    photo: Ints
    pixel_px: Floats
    sigma_px: Floats
    width_px: int
    height_px: int
    picked_photo: Ints = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    picked_px: Floats = field(default_factory=lambda: np.empty((0, 2)))


def choose(sighted: Sighted) -> Ints:
    """(K,) the points to keep.

    Long ones first, the better seen first among equally long ones: first where most of their
    cells are free, then for pairs of photos that have little in common, then for photos that
    have few.
    """
    return np.array(_Choice(sighted).chosen(), dtype=np.int64)


class _Choice:
    def __init__(self, sighted: Sighted) -> None:
        point = sighted.tracks.point
        self._starts: list[int] = np.flatnonzero(np.diff(point, prepend=-1)).tolist()
        self._starts.append(len(point))
        self._cells, self._fine = _Cells(sighted, GRID), _Cells(sighted, FINE)
        self._photo: list[int] = sighted.photo.tolist()
        length = np.diff(self._starts)
        noise = np.add.reduceat(sighted.sigma_px, self._starts[:-1]) if len(length) else length
        self._order: list[int] = np.lexsort((noise / np.maximum(length, 1), -length)).tolist()
        self._count: Counter[int] = Counter()
        self._common: Counter[tuple[int, int]] = Counter()
        self._taken: dict[int, None] = {}
        self._sighted = sighted

    def chosen(self) -> list[int]:
        for point in self._order:
            if self._is_free(point, self._cells):
                self._take(point)
        for point in self._left():
            if any(self._common[pair] < SHARED for pair in combinations(self._photos(point), 2)):
                self._take(point)
        for point in self._left():
            if any(self._count[photo] < ENOUGH for photo in self._photos(point)):
                self._take(point)
        self._count.clear()  # photos have as much room again
        for near in self._near_picks():
            self._take_beside(near)
        return sorted(self._taken)

    def _take_beside(self, near: list[int]) -> None:
        """Keep points near a pick, in this order, until there are enough."""
        missing = BESIDE - sum(point in self._taken for point in near)
        for point in near:
            if missing > 0 and point not in self._taken and self._is_free(point, self._fine):
                self._take(point)
                missing -= 1

    def _near_picks(self) -> Iterator[list[int]]:
        """Points that are sure, near each pick, the nearest first."""
        sighted = self._sighted
        point, photo = sighted.tracks.point, sighted.photo
        sure = np.bincount(point)[point] >= SURE if len(point) else np.zeros(0, np.bool_)
        for one in np.unique(sighted.picked_photo):
            rows = np.flatnonzero(sure & (photo == one))
            if not len(rows):
                continue
            picked = sighted.picked_px[sighted.picked_photo == one]
            tree, ranks = cKDTree(sighted.pixel_px[rows]), np.arange(1, min(MOST, len(rows)) + 1)
            away, near = tree.query(picked, ranks, distance_upper_bound=NEAR * sighted.width_px)
            yield from (
                point[rows[which[np.isfinite(distance)]]].tolist()
                for which, distance in zip(np.asarray(near), np.asarray(away), strict=True)
            )

    def _left(self) -> Iterator[int]:
        """Points that are not taken, and do not lie beside those that are."""
        return (
            point
            for point in self._order
            if point not in self._taken and self._is_free(point, self._fine)
        )

    def _is_free(self, point: int, cells: _Cells) -> bool:
        """Whether most cells of a point are free."""
        own = cells.of[self._starts[point] : self._starts[point + 1]]
        return 2 * sum(cell not in cells.full for cell in own) > len(own)

    def _photos(self, point: int) -> list[int]:
        return self._photo[self._starts[point] : self._starts[point + 1]]

    def _take(self, point: int) -> None:
        """Keep a point, unless its photos have enough."""
        photos = self._photos(point)
        if all(self._count[photo] >= MOST for photo in photos):
            return
        self._taken[point] = None
        for cells in (self._cells, self._fine):
            cells.full.update(cells.of[self._starts[point] : self._starts[point + 1]])
        self._count.update(photos)
        self._common.update(combinations(photos, 2))


class _Cells:
    """Cells of photos: the one of each sighting, and which are full."""

    def __init__(self, sighted: Sighted, grid: tuple[int, int]) -> None:
        size = np.array([sighted.width_px, sighted.height_px])
        cell = np.clip(sighted.pixel_px / size * grid, 0, np.array(grid) - 1).astype(np.int64)
        cells = (sighted.photo * grid[0] + cell[:, 0]) * grid[1] + cell[:, 1]
        self.of: list[int] = cells.tolist()
        self.full: set[int] = set()
