"""Tracks of tie points: matches put together, their noise, and the choice of the best."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.spatial import cKDTree

from uavgram.model.arrays import Bools, Floats, Ints

LEAST_SUPPORT = 0.5
"""Least share of the other sightings of a point that each must be matched with directly; this
excludes sightings that drift from photo to photo, or are beside the point in one."""


class Matches(NamedTuple):
    """Set of M matches, each of two features.

    Attributes
    ----------
    feature
        (M, 2) rows among the features of all photos.
    pair
        (M,) index of the pair of photos.
    across_px
        (M,) distance from the epipolar line of the other feature, less that of neighbouring
        matches.
    """

    feature: Ints
    pair: Ints
    across_px: Floats

    def take(self, rows: Ints) -> Matches:
        """Select matches."""
        return Matches(self.feature[rows], self.pair[rows], self.across_px[rows])


class Tracks(NamedTuple):
    """Set of S sightings of points, sorted by point.

    Attributes
    ----------
    point
        (S,) counts from 0.
    feature
        (S,) rows among the features of all photos.
    """

    point: Ints
    feature: Ints


def tracks_of(matches: Matches, photo: Ints) -> Tracks:
    """Join features that are matched, directly or through others, into points.

    Parameters
    ----------
    matches
        Verified matches.
    photo
        (F,) photo of each feature.

    Returns
    -------
    Tracks
        Without points that a photo would show twice (a match in them is wrong), and without weakly
        connected sightings.
    """
    if not len(matches.feature):
        return Tracks(np.empty(0, np.int64), np.empty(0, np.int64))
    from scipy.sparse.csgraph import connected_components  # noqa: PLC0415 - slow to load

    one, other = matches.feature.T
    graph = coo_array((np.ones(len(one), np.int8), (one, other)), shape=(len(photo),) * 2)
    _, component = connected_components(graph, directed=False)
    feature = np.unique(matches.feature)
    label = component[feature]
    order = np.lexsort((photo[feature], label))
    feature, label = feature[order], label[order]
    twice = (label[1:] == label[:-1]) & (photo[feature[1:]] == photo[feature[:-1]])
    kept = ~np.isin(label, label[1:][twice])
    degree = np.bincount(matches.feature.ravel(), minlength=len(photo))[feature]
    kept &= degree >= LEAST_SUPPORT * (np.bincount(label)[label] - 1)
    kept &= np.bincount(label, kept)[label] > 1
    _, point = np.unique(label[kept], return_inverse=True)
    return Tracks(point.astype(np.int64), feature[kept])


LARGE = 4.0
"""Size of a feature, in pixels of the reduced photo, above which its error grows: on rendered
streets the error is constant below, and grows with the size above."""

TOO_LARGE = 10.0
"""Size above which a feature is not used as a point."""

MOST_SIGMAS = 4.0
"""Robust sigmas of its pair above which a match is an outlier."""

LEAST_PX = 0.03
"""Lower limit of the sigma of a feature, in pixels of the reduced photo."""


def relative_noise(size_px: Floats, scale: float) -> Floats:
    """Compute errors (F,) of features as multiples of those of small ones.

    Parameters
    ----------
    size_px
        (F,) of the features, in pixels of the photo.
    scale
        Pixels of the photo per pixel of the reduced one.
    """
    return np.maximum(1.0, size_px / (LARGE * scale))


def fitting(matches: Matches, relative: Floats, pairs: int) -> Bools:
    """Mark matches (M,) of small features that are no outliers of their pair.

    Parameters
    ----------
    matches
        Matches of all pairs.
    relative
        (F,) `relative_noise` of the features.
    pairs
        Number of pairs.
    """
    off = np.abs(_normalised(matches, relative))
    median = np.full(pairs, np.inf)
    order = np.lexsort((off, matches.pair))
    start = np.searchsorted(matches.pair[order], np.arange(pairs + 1))
    has = np.diff(start) > 0
    median[has] = off[order[(start[:-1] + start[1:])[has] // 2]]
    small = relative[matches.feature].max(axis=1) < TOO_LARGE / LARGE
    return np.asarray((off < MOST_SIGMAS * 1.4826 * median[matches.pair]) & small)


def sigmas(matches: Matches, relative: Floats, pairs: int, scale: float) -> Floats:
    """Estimate the sigma (F,) of each coordinate of the matched features [px]; NaN for others.

    Parameters
    ----------
    matches
        Matches that fit.
    relative
        (F,) `relative_noise` of the features.
    pairs
        Number of pairs.
    scale
        Pixels of the photo per pixel of the reduced one.
    """
    square = np.bincount(matches.pair, _normalised(matches, relative) ** 2, minlength=pairs)
    of_pair = square / np.maximum(np.bincount(matches.pair, minlength=pairs), 1)
    feature = matches.feature.ravel()
    count = np.bincount(feature, minlength=len(relative))
    total = np.bincount(feature, np.repeat(of_pair[matches.pair], 2), minlength=len(relative))
    with np.errstate(invalid="ignore", divide="ignore"):
        sigma = relative * np.sqrt(total / count)
    return np.asarray(np.maximum(sigma, LEAST_PX * scale))


def _normalised(matches: Matches, relative: Floats) -> Floats:
    """Divide distances across (M,) by their sigma for two features of such size at sigma 1."""
    of_two: Ints = matches.feature
    return np.asarray(matches.across_px / np.sqrt((relative[of_two] ** 2).sum(axis=1)))


GRID = 10, 8
"""Columns and rows of the cells of a photo: about as many sightings are kept in each photo."""

FINE = 60, 45
"""Columns and rows of the cells in which a second sighting adds no information."""

MOST = 100
"""Largest number of sightings kept in a photo."""

ENOUGH = 60
"""Number of sightings above which a photo needs no more that share their cells with others."""

SHARED = 12
"""Wanted number of common points of two matched photos."""

BESIDE = 8
"""Points beside each pick, which show the height of the ground there; see
stages/refine/ground_from_ties."""

NEAR = 0.05
"""Largest distance of these from the pick, as a share of the photo's width."""

SURE = 3
"""Least number of photos that show each of them: with two, the height is less certain."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Sighted:
    """Sightings to choose from.

    Attributes
    ----------
    tracks
        (S,) sightings.
    photo
        (S,) photo of each.
    pixel_px, sigma_px
        (S, 2), (S,).
    width_px, height_px
        Size of the photos.
    picked_photo, picked_px
        (P,), (P, 2) picks by people: photos and pixels.
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
    """Choose the points to keep (K,).

    Long tracks come first, those of smaller noise first among equally long ones: first where most
    of their cells are free, then for pairs of photos with few common points, then for photos with
    few points.
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
        """Yield certain points near each pick, the nearest first."""
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
        """Yield points that are neither kept nor close to kept ones."""
        return (
            point
            for point in self._order
            if point not in self._taken and self._is_free(point, self._fine)
        )

    def _is_free(self, point: int, cells: _Cells) -> bool:
        """Return whether most cells of a point are free."""
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
    """Cells of photos: the one of each sighting, and the occupied ones."""

    def __init__(self, sighted: Sighted, grid: tuple[int, int]) -> None:
        size = np.array([sighted.width_px, sighted.height_px])
        cell = np.clip(sighted.pixel_px / size * grid, 0, np.array(grid) - 1).astype(np.int64)
        cells = (sighted.photo * grid[0] + cell[:, 0]) * grid[1] + cell[:, 1]
        self.of: list[int] = cells.tolist()
        self.full: set[int] = set()
