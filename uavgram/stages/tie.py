"""Tie points: overlap of photos by prior poses, tracks of matches, choice of the best, remarks."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.spatial import cKDTree

from uavgram.geometry.camera.projection import back_project, project
from uavgram.geometry.ground.plane import intersect_ground
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.camera import Calibration
from uavgram.model.frames import Poses
from uavgram.model.message import Message, MessagePlural
from uavgram.model.survey import TiePicks

OVERLAP_GRID = 8, 6
"""Columns and rows of the pixels by which the overlap of two photos is measured."""

LEAST_SHARE = 0.15
"""Least share of a photo's ground that another must show to be compared with it."""

MOST_NEIGHBOURS = 8
"""Largest number of photos that each is compared with: those of largest overlap."""

SEARCH_SIGMAS = 3.5
"""Radius of a search in standard deviations of the prediction."""

WIDEST_SEARCH = 0.35
"""Radius of a search, as a share of the photo's width, above which a prediction is useless."""

VAGUE_RAD = 0.2
"""Standard deviation of an attitude [rad] above which a pose does not determine the view of a
photo."""

MAX_DISTANCE_RATIO = 6.0
"""Largest distance of ground that counts as shown, in heights of the camera above it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Seen:
    """Cameras over a level ground, before any adjustment.

    Attributes
    ----------
    calibration
        Calibration of the camera.
    poses
        (N,) poses of the photos.
    ground_m, ground_sigma_m
        Height of the ground in the world, and its standard deviation.
    """

    calibration: Calibration
    poses: Poses
    ground_m: float
    ground_sigma_m: float

    @property
    def height_m(self) -> Floats:
        """Heights (N,) of the cameras above the ground."""
        return np.asarray(np.maximum(self.poses.center_world_m[:, 2] - self.ground_m, 1.0))

    @property
    def is_vague(self) -> Bools:
        """Mask (N,) of poses that do not determine the view of their photos."""
        variance = np.diagonal(self.poses.covariance, axis1=1, axis2=2)
        far = SEARCH_SIGMAS * np.sqrt(variance[:, :3].max(axis=1)) > 2.0 * self.height_m
        return np.asarray((variance[:, 3:].max(axis=1) > VAGUE_RAD**2) | far)

    def ground_of(self, photo: int, pixel_px: Floats) -> Floats:
        """Intersect pixels of a photo with the ground (M, 3); NaN where far away or without one."""
        center = self.poses.center_world_m[photo]
        ray = back_project(self.calibration.model, self.calibration.parameters, pixel_px)
        plane = np.array([self.ground_m, 0.0, 0.0])
        world = intersect_ground(
            center, ray @ self.poses.world_from_camera[photo].T, plane, np.zeros(2)
        )
        with np.errstate(invalid="ignore"):
            far = np.linalg.norm(world - center, axis=1) > MAX_DISTANCE_RATIO * self.height_m[photo]
        world[far] = np.nan
        return np.asarray(world)

    def pixels_of(self, photo: int, world_m: Floats) -> Floats:
        """Project points of the world to a photo (M, 2); NaN where it does not show them."""
        camera = self.calibration
        point = (world_m - self.poses.center_world_m[photo]) @ self.poses.world_from_camera[photo]
        return project(camera.model, camera.parameters, point)


class Prediction(NamedTuple):
    """Pixels (M, 2) of one photo in another, NaN where not shown; and the search radius."""

    pixel_px: Floats
    radius_px: float


def compute_overlap(seen: Seen) -> Floats:
    """Compute the share (N, N) of ground shown by two photos: the lesser of the two shares."""
    count = len(seen.poses.frame_id)
    grid = _grid(seen.calibration)
    ground = np.stack([seen.ground_of(k, grid) for k in range(count)])
    shown = np.asarray(np.isfinite(ground).all(axis=2))
    share = np.zeros((count, count))
    # Circle around the ground of each photo, to skip distant pairs.
    photos = np.flatnonzero(shown.any(axis=1))
    middle = np.full((count, 3), np.inf)
    middle[photos] = np.nanmean(ground[photos], axis=1)
    reach = np.zeros(count)
    from_middle = np.linalg.norm(ground[photos] - middle[photos, None], axis=2)
    reach[photos] = np.nanmax(from_middle, axis=1, initial=0.0)
    for k in photos.tolist():
        apart = np.linalg.norm(middle - middle[k], axis=1)
        near = np.flatnonzero(apart <= reach + reach[k])
        pixel = seen.pixels_of(k, ground[near].reshape(-1, 3))
        share[near, k] = _inside(seen.calibration, pixel).reshape(len(near), -1).mean(axis=1)
    # The lesser of the two shares.
    share = np.minimum(share, share.T)
    np.fill_diagonal(share, 0.0)
    return share


def choose_pairs(score: Floats, least: float, most: int = MOST_NEIGHBOURS) -> Ints:
    """Choose pairs (P, 2) of photos to compare, each among the best of one of the two.

    Parameters
    ----------
    score
        (N, N) overlap of two photos; symmetric.
    least
        Score below which they have nothing in common.
    most
        Partners that each photo chooses.
    """
    order = np.argsort(-score, axis=1, kind="stable")[:, :most]
    chosen = np.zeros(score.shape, np.bool_)
    np.put_along_axis(chosen, order, np.take_along_axis(score, order, axis=1) >= least, axis=1)
    return np.argwhere(np.triu(chosen | chosen.T, 1))


def predict(seen: Seen, one: int, other: int, pixel_px: Floats) -> Prediction | None:
    """Predict pixels of one photo in another; None where the prediction is too uncertain.

    Parameters
    ----------
    seen
        The photos.
    one, other
        Rows of the two.
    pixel_px
        (M, 2) in the first.
    """
    radius = _radius(seen, one, other)
    if radius > WIDEST_SEARCH * seen.calibration.width_px:
        return None
    pixel = seen.pixels_of(other, seen.ground_of(one, pixel_px))
    pixel[~_inside(seen.calibration, pixel, radius)] = np.nan
    return Prediction(pixel, radius)


def _radius(seen: Seen, one: int, other: int) -> float:
    """Compute the search radius [px] from sigmas of attitudes, positions and ground height."""
    both = seen.poses.covariance[[one, other]]
    variance = np.diagonal(both, axis1=1, axis2=2)
    height = float(seen.height_m[[one, other]].min())
    base = np.diff(seen.poses.center_world_m[[one, other]], axis=0)[0]
    turn = variance[:, 3:].max(axis=1).sum()
    place = variance[:, :3].max(axis=1).sum() / height**2
    ground = (np.linalg.norm(base) * max(seen.ground_sigma_m, 0.05 * height) / height**2) ** 2
    return float(SEARCH_SIGMAS * seen.calibration.parameters[0] * np.sqrt(turn + place + ground))


def _grid(camera: Calibration) -> Floats:
    """Return pixels (M, 2) spread over a photo."""
    u = (np.arange(OVERLAP_GRID[0]) + 0.5) * camera.width_px / OVERLAP_GRID[0]
    v = (np.arange(OVERLAP_GRID[1]) + 0.5) * camera.height_px / OVERLAP_GRID[1]
    return np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)


def _inside(camera: Calibration, pixel_px: Floats, margin: float = 0.0) -> Bools:
    """Mark pixels (M,) inside a photo, or outside by less than a margin."""
    size = np.array([camera.width_px, camera.height_px])
    with np.errstate(invalid="ignore"):
        return np.asarray(((pixel_px > -margin) & (pixel_px < size + margin)).all(axis=1))


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


def join_tracks(matches: Matches, photo: Ints) -> Tracks:
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


NOISY_SIZE_PX = 4.0
"""Size of a feature, in pixels of the reduced photo, above which its error grows: on rendered
streets the error is constant below, and grows with the size above."""

MAX_SIZE_PX = 10.0
"""Size above which a feature is not used as a point."""

MAX_RESIDUAL_SIGMAS = 4.0
"""Robust sigmas of its pair above which a match is an outlier."""

MIN_SIGMA_PX = 0.03
"""Lower limit of the sigma of a feature, in pixels of the reduced photo."""


def compute_relative_noise(size_px: Floats, scale: float) -> Floats:
    """Compute errors (F,) of features as multiples of those of small ones.

    Parameters
    ----------
    size_px
        (F,) of the features, in pixels of the photo.
    scale
        Pixels of the photo per pixel of the reduced one.
    """
    return np.maximum(1.0, size_px / (NOISY_SIZE_PX * scale))


def mark_fitting_matches(matches: Matches, relative: Floats, pairs: int) -> Bools:
    """Mark matches (M,) of small features that are no outliers of their pair.

    Parameters
    ----------
    matches
        Matches of all pairs.
    relative
        (F,) `compute_relative_noise` of the features.
    pairs
        Number of pairs.
    """
    off = np.abs(_normalise_distances(matches, relative))
    median = np.full(pairs, np.inf)
    order = np.lexsort((off, matches.pair))
    start = np.searchsorted(matches.pair[order], np.arange(pairs + 1))
    has = np.diff(start) > 0
    median[has] = off[order[(start[:-1] + start[1:])[has] // 2]]
    small = relative[matches.feature].max(axis=1) < MAX_SIZE_PX / NOISY_SIZE_PX
    return np.asarray((off < MAX_RESIDUAL_SIGMAS * 1.4826 * median[matches.pair]) & small)


def estimate_sigmas(matches: Matches, relative: Floats, pairs: int, scale: float) -> Floats:
    """Estimate the sigma (F,) of each coordinate of the matched features [px]; NaN for others.

    Parameters
    ----------
    matches
        Matches that fit.
    relative
        (F,) `compute_relative_noise` of the features.
    pairs
        Number of pairs.
    scale
        Pixels of the photo per pixel of the reduced one.
    """
    square = np.bincount(
        matches.pair, _normalise_distances(matches, relative) ** 2, minlength=pairs
    )
    of_pair = square / np.maximum(np.bincount(matches.pair, minlength=pairs), 1)
    feature = matches.feature.ravel()
    count = np.bincount(feature, minlength=len(relative))
    total = np.bincount(feature, np.repeat(of_pair[matches.pair], 2), minlength=len(relative))
    with np.errstate(invalid="ignore", divide="ignore"):
        sigma = relative * np.sqrt(total / count)
    return np.asarray(np.maximum(sigma, MIN_SIGMA_PX * scale))


def _normalise_distances(matches: Matches, relative: Floats) -> Floats:
    """Divide distances across (M,) by their sigma for two features of such size at sigma 1."""
    of_two: Ints = matches.feature
    return np.asarray(matches.across_px / np.sqrt((relative[of_two] ** 2).sum(axis=1)))


GRID = 10, 8
"""Columns and rows of the cells of a photo: about as many sightings are kept in each photo."""

FINE = 60, 45
"""Columns and rows of the cells in which a second sighting adds no information."""

MAX_SIGHTINGS = 100
"""Largest number of sightings kept in a photo."""

SUFFICIENT_SIGHTINGS = 60
"""Number of sightings above which a photo needs no more that share their cells with others."""

WANTED_COMMON_POINTS = 12
"""Wanted number of common points of two matched photos."""

POINTS_BESIDE_PICK = 8
"""Points beside each pick, which show the height of the ground there; see
stages/refine/ground_from_ties."""

MAX_PICK_DISTANCE_SHARE = 0.05
"""Largest distance of these from the pick, as a share of the photo's width."""

MIN_SURE_PHOTOS = 3
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
    return np.array(_Choice(sighted).choose_points(), dtype=np.int64)


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

    def choose_points(self) -> list[int]:
        for point in self._order:
            if self._is_free(point, self._cells):
                self._take(point)
        for point in self._left():
            if any(
                self._common[pair] < WANTED_COMMON_POINTS
                for pair in combinations(self._photos(point), 2)
            ):
                self._take(point)
        for point in self._left():
            if any(self._count[photo] < SUFFICIENT_SIGHTINGS for photo in self._photos(point)):
                self._take(point)
        self._count.clear()  # photos have as much room again
        for near in self._near_picks():
            self._take_beside(near)
        return sorted(self._taken)

    def _take_beside(self, near: list[int]) -> None:
        """Keep points near a pick, in this order, until there are enough."""
        missing = POINTS_BESIDE_PICK - sum(point in self._taken for point in near)
        for point in near:
            if missing > 0 and point not in self._taken and self._is_free(point, self._fine):
                self._take(point)
                missing -= 1

    def _near_picks(self) -> Iterator[list[int]]:
        """Yield certain points near each pick, the nearest first."""
        sighted = self._sighted
        point, photo = sighted.tracks.point, sighted.photo
        sure = np.bincount(point)[point] >= MIN_SURE_PHOTOS if len(point) else np.zeros(0, np.bool_)
        for one in np.unique(sighted.picked_photo):
            rows = np.flatnonzero(sure & (photo == one))
            if not len(rows):
                continue
            picked = sighted.picked_px[sighted.picked_photo == one]
            tree, ranks = (
                cKDTree(sighted.pixel_px[rows]),
                np.arange(1, min(MAX_SIGHTINGS, len(rows)) + 1),
            )
            away, near = tree.query(
                picked, ranks, distance_upper_bound=MAX_PICK_DISTANCE_SHARE * sighted.width_px
            )
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
        if all(self._count[photo] >= MAX_SIGHTINGS for photo in photos):
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


def report_ties(ties: TiePicks, photos: Sequence[str], file: str) -> Iterator[Message]:
    """Report the number of tie points, and photos without any.

    Parameters
    ----------
    ties
        Tie points as found.
    photos
        Names of all photos.
    file
        Name of the table that holds them.
    """
    if not ties.image:
        yield Message(
            "warning",
            "ties-none",
            "No two photos were found to show the same ground, so nothing ties them together. Are "
            "they of one place, and do they overlap? Check also that the camera file is theirs.",
        )
        return
    count = Counter(ties.image)
    numbers = sorted(count[name] for name in photos if name in count)
    yield Message(
        "info",
        "ties-found",
        f"{len(set(ties.tie))} tie points were found in {len(count)} of {len(photos)} photos, "
        f"{numbers[0]} to {numbers[-1]} in each: {file}.",
        files=(file,),
    )
    for name in photos:
        if name not in count:
            yield _report_untied_photo(name)
    yield from _report_untied_groups(ties, [name for name in photos if name in count])


def _report_untied_photo(photo: str) -> Message:
    return Message(
        "info",
        "photo-untied",
        f"Nothing in the photo {photo!r} was found in another one, so no tie point helps to place "
        "it: it may be blurred, or show another place.",
        frames=(photo,),
        several=MessagePlural(
            "Nothing in {count} photos was found in others, so no tie point helps to place them",
            repr(photo),
            ending="They may be blurred, or show another place.",
        ),
    )


def _report_untied_groups(ties: TiePicks, photos: Sequence[str]) -> Iterator[Message]:
    """Report groups of photos without common tie points."""
    from scipy.sparse.csgraph import connected_components  # noqa: PLC0415 - slow to load

    at = {name: k for k, name in enumerate(photos)}
    photo = np.array([at[name] for name in ties.image])
    point = np.unique(np.array(ties.tie), return_inverse=True)[1] + len(at)
    size = (int(point.max()) + 1,) * 2
    graph = coo_array((np.ones(len(photo), np.int8), (photo, point)), shape=size)
    _, group = connected_components(graph, directed=False)
    groups = Counter(group[: len(at)].tolist())
    if len(groups) == 1:
        return
    largest, most = groups.most_common(1)[0]
    others = tuple(name for name, k in zip(photos, group[: len(at)], strict=True) if k != largest)
    yield Message(
        "info",
        "ties-apart",
        f"The photos fall into {len(groups)} groups, and no tie point joins one with another: "
        f"{most} photos are joined; only poses and picks join {len(others)} others, such as "
        f"{others[0]!r}, with them. Pick points that both groups show.",
        frames=others,
    )
