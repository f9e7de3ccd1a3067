"""Initial values of a survey's unknowns: poses, ground, points off the ground and tie points."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from uavgram.estimation.first_poses.length_poses import (
    LengthFrames,
    LengthPoses,
    resect_from_lengths,
    search_frames,
)
from uavgram.estimation.survey.selection import replace_matches_by_picks
from uavgram.geometry.camera.projection import back_project
from uavgram.geometry.ground.plane import intersect_ground
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.camera import Calibration
from uavgram.model.survey import Sightings, Survey


def estimate_ground_height(survey: Survey) -> float:
    """Estimate the height of the ground from control points, or from lines of known position.

    Control points whose own height above the ground is known count, if there are any. Otherwise the
    height is that of the lowest control point: they are on the ground or above it. If lines have no
    heights, it is the prior height of the ground.
    """
    label, up = survey.control_label, survey.control_world_m[:, 2]
    if not len(label):
        lines = [one.position for one in survey.known if one.position is not None]
        heights = [line.ends_m[:, 2].mean() for line in lines if line.has_height]
        return float(np.median(heights)) if heights else survey.ground.height_m
    level = has_known_height(survey)[label]
    if not level.any():
        return float(up.min())
    return float(np.mean((up - survey.height_above_m[label])[level]))


SAME_PLANE_SIGMAS = 0.01
"""Distance between two planes, in sigmas, up to which they are the same."""

CACHE_SIZE = 64
"""Number of sets of frames whose poses are cached: searches for errors request the same ones
often."""

MAX_HEIGHT_SIGMA_M = 0.3
"""Largest sigma of a stated height for which a point may place cameras [m]: some 10 pixels from 30
m."""


MAX_RISE = 0.1
"""Largest difference in height between the ends of a length, as a share of it, with which it may
place cameras, as if both ends were on one plane."""


class FirstValues(NamedTuple):
    """Initial values; NaN if nothing determines them.

    Attributes
    ----------
    point_m
        (K, 2) east and north.
    center, rotation
        (F, 3), (F, 3, 3) world from camera.
    height_m
        Height of the plane.
    departure_m
        (K,) initial heights above the plane of points whose height is free.
    """

    point_m: Floats
    center: Floats
    rotation: Floats
    height_m: float
    departure_m: Floats


def intersect_seed_rays(survey: Survey, ray: Floats) -> FirstValues:
    """Intersect the picks' rays (P, 3) from the seeds with the plane: the median over frames."""
    seeds = survey.seeds
    assert seeds is not None  # noqa: S101  (the caller asked)
    frame, label = survey.pick_frame, survey.pick_label
    direction = np.einsum("nij,nj->ni", seeds.world_from_camera[frame], ray)
    plane = np.array([survey.ground.height_m, 0.0, 0.0])
    ground = intersect_ground(
        seeds.center_world_m[frame], direction, plane, np.zeros(2), survey.height_above_m[label]
    )
    point = _median_by_label(ground[:, :2], label, len(survey.label))
    poses = seeds.center_world_m, seeds.world_from_camera
    return FirstValues(point, *poses, plane[0], np.zeros(len(point)))


def has_known_height(survey: Survey) -> Bools:
    """Mark the points (K,) whose height is known well enough to determine a camera's position."""
    return np.asarray(~survey.is_free & (survey.height_sigma_m <= MAX_HEIGHT_SIGMA_M))


class SeenLines(NamedTuple):
    """Known lengths with both ends in one frame, one row each, by frame.

    Attributes
    ----------
    frame, line
        (S,) of the survey.
    start, end
        (S,) picks of the two ends.
    sigma_m
        (S,) of the length between the ends as if on one plane: a rise moves one of them there by
        about as much, at a usual view.
    """

    frame: Ints
    line: Ints
    start: Ints
    end: Ints
    sigma_m: Floats


def find_seen_lines(survey: Survey) -> SeenLines:
    """Find the known lengths with both ends in a frame, of those that a plane can start from.

    Both ends must be in one area, at nearly one height above it, and on two pixels.
    """
    labels = len(survey.label)
    key = survey.pick_frame * labels + survey.pick_label
    by_key = np.argsort(key, kind="stable")
    by_label = np.argsort(survey.pick_label, kind="stable")
    bounds = np.searchsorted(survey.pick_label[by_label], np.arange(labels + 1))
    number = np.diff(bounds)[survey.line_start]
    # All picks of the start of each line, and for each the pick of the end in the same frame.
    line = np.repeat(np.arange(len(number)), number)
    within = np.arange(len(line)) - np.repeat(np.cumsum(number) - number, number)
    start = by_label[bounds[survey.line_start[line]] + within]
    wanted = survey.pick_frame[start] * labels + survey.line_end[line]
    place = np.minimum(np.searchsorted(key[by_key], wanted), max(len(key) - 1, 0))
    end = by_key[place]
    found = key[end] == wanted
    a, b = survey.line_start[line], survey.line_end[line]
    found &= survey.area[a] == survey.area[b]
    rise_m = np.abs(survey.height_above_m[a] - survey.height_above_m[b])
    found &= rise_m <= MAX_RISE * survey.length_m[line]
    level = has_known_height(survey)
    found &= level[a] & level[b]
    found &= (survey.pixel_px[start] != survey.pixel_px[end]).any(axis=1)
    rows = np.flatnonzero(found)
    rows = rows[np.argsort(survey.pick_frame[start[rows]], kind="stable")]
    sigma_m = np.hypot(survey.length_sigma_m[line[rows]], rise_m[rows])
    return SeenLines(survey.pick_frame[start[rows]], line[rows], start[rows], end[rows], sigma_m)


def count_lines_per_frame(survey: Survey) -> Ints:
    """Count (F,) known lengths with both ends in each frame; one taped twice counts once."""
    return _count_lines_per_frame(survey, find_seen_lines(survey))


def _count_lines_per_frame(survey: Survey, seen: SeenLines) -> Ints:
    ends = np.stack([survey.pick_label[seen.start], survey.pick_label[seen.end]])
    different = np.unique(np.column_stack([seen.frame, *np.sort(ends, axis=0)]), axis=0)
    return np.bincount(different[:, 0], minlength=len(survey.frame_id))


def estimate_length_poses(survey: Survey) -> dict[int, LengthPoses]:
    """Estimate poses from the lengths of each frame with three or more, best first.

    All frames are searched together, and each candidate is refined to the maximum of its own
    likelihood, with its covariance. Candidates that converge to the same maximum count once.
    """
    seen = find_seen_lines(survey)
    enough = np.flatnonzero(_count_lines_per_frame(survey, seen) >= 3)
    if not len(enough):
        return {}
    found = _estimate_poses(_CacheKey(survey.calibration, _collect_lines(survey, seen, enough)))
    return {int(enough[k]): poses for k, poses in found.items()}


class _CacheKey:
    """Frames of a camera as a cache key; equal if all numbers are equal."""

    def __init__(self, calibration: Calibration, frames: LengthFrames) -> None:
        self.calibration, self.frames = calibration, frames
        camera = calibration.model, calibration.parameters.tobytes()
        numbers = calibration.covariance.tobytes(), *(column.tobytes() for column in frames)
        self._key = *camera, frames.start.shape, *numbers

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _CacheKey) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)


@lru_cache(maxsize=CACHE_SIZE)
def _estimate_poses(asked: _CacheKey) -> dict[int, LengthPoses]:
    """Estimate poses of frames that lengths explain, by index, best first."""
    searched = search_frames(asked.calibration, asked.frames)
    start, cost = (np.concatenate(column) for column in zip(*searched, strict=True))
    row = np.repeat(np.arange(len(searched)), [len(found.cost) for found in searched])
    if not len(row):  # no pose explains the lengths of any frame
        return {}
    poses = resect_from_lengths(asked.calibration, asked.frames.take(row), start)
    # If the iterations fail, the result of the search is still an initial value.
    failed = ~poses.converged
    poses = poses._replace(
        plane=np.where(failed[:, None], start, poses.plane),
        cost=np.where(failed, cost, poses.cost),
    )
    order = np.lexsort((poses.cost, row))
    return {k: _keep_distinct(poses.take(order[row[order] == k])) for k in np.unique(row).tolist()}


def _keep_distinct(poses: LengthPoses) -> LengthPoses:
    """Keep the first of the poses that converged to the same plane."""
    variance = np.einsum("bii->bi", poses.covariance)
    sigma = np.sqrt(np.where(poses.converged[:, None], variance, 0.0))
    same = np.all(np.abs(poses.plane[:, None] - poses.plane) <= SAME_PLANE_SIGMAS * sigma, axis=2)
    first = np.argmax(same, axis=0)
    distinct = poses.take(np.flatnonzero(first == np.arange(len(first))))
    for column in distinct:
        column.flags.writeable = False  # the cache returns the same arrays again
    return distinct


def _collect_lines(survey: Survey, seen: SeenLines, frame: Ints) -> LengthFrames:
    """Collect the lines of some frames, padded to the largest number of picks and of lines."""
    rows = np.flatnonzero(np.isin(seen.frame, frame))
    row = np.searchsorted(frame, seen.frame[rows])
    used, at = np.unique(np.stack([seen.start[rows], seen.end[rows]]), return_inverse=True)
    owner = np.searchsorted(frame, survey.pick_frame[used])
    pick_rank, line_rank = _rank(owner, len(frame)), _rank(row, len(frame))
    shape = len(frame), int(line_rank.max()) + 1
    pixel = np.zeros((len(frame), int(pick_rank.max()) + 1, 2))
    pixel[:] = survey.calibration.parameters[2:4]
    sigma = np.ones(pixel.shape[:2])
    pixel[owner, pick_rank] = survey.pixel_px[used]
    sigma[owner, pick_rank] = survey.pick_sigma_px[used]
    ends = np.zeros((2, *shape), dtype=np.int64)
    ends[1] = 1
    ends[:, row, line_rank] = pick_rank[at.reshape(2, -1)]
    length, length_sigma = np.ones(shape), np.full(shape, np.inf)
    length[row, line_rank] = survey.length_m[seen.line[rows]]
    length_sigma[row, line_rank] = seen.sigma_m[rows]
    return LengthFrames(pixel, sigma, ends[0], ends[1], length, length_sigma)


def _rank(owner: Ints, owners: int) -> Ints:
    """Count (n,) earlier entries with the same owner."""
    order = np.argsort(owner, kind="stable")
    first = np.searchsorted(owner[order], np.arange(owners))
    rank = np.empty(len(owner), dtype=np.int64)
    rank[order] = np.arange(len(owner)) - first[owner[order]]
    return rank


def _median_by_label(value: Floats, label: Ints, count: int) -> Floats:
    """Compute (count, 2) medians of the finite rows of each label, by coordinate; NaN if none.

    One gross error of three does not move it far.
    """
    finite = np.isfinite(value).all(axis=1)
    number = np.bincount(label[finite], minlength=count)
    first = np.cumsum(number) - number
    has_any = number > 0
    low = (first + (number - 1) // 2)[has_any]
    high = (first + number // 2)[has_any]
    median = np.full((count, 2), np.nan)
    for axis in range(2):
        own = value[finite, axis]
        ordered = own[np.lexsort((own, label[finite]))]
        median[has_any, axis] = (ordered[low] + ordered[high]) / 2.0
    return median


MAX_RELATIVE_SIGMA = 0.1
"""Sigma of an intersection of rays, as a share of its distance, above which it has no meaning:
usually the rays then come from one place."""


def add_free_points(survey: Survey, values: FirstValues) -> FirstValues:
    """Add initial values of the points whose height is free.

    A point gets none (NaN) if its rays do not determine it, unless its coordinates or another known
    thing may do so: such a point starts at its coordinates, or on the ground.

    Parameters
    ----------
    survey
        Observations.
    values
        Initial values with poses.
    """
    free = np.flatnonzero(survey.is_free)
    if not len(free):
        return values
    shown, camera = replace_matches_by_picks(survey), survey.calibration
    frame, label = shown.pick_frame, shown.pick_label
    every_ray = back_project(camera.model, camera.parameters, shown.pixel_px)
    is_seen = np.isfinite(every_ray).all(axis=1) & np.isfinite(values.center[frame, 0])
    rows = np.flatnonzero(survey.is_free[label] & is_seen)
    center, owner, ray = values.center[frame[rows]], label[rows], every_ray[rows]
    direction = np.einsum("nij,nj->ni", values.rotation[frame[rows]], ray)
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    sigma = shown.pick_sigma_px[rows] / camera.parameters[0]
    # Intersections of the rays; where these fail, the mean intersection with the ground.
    met, spread = intersect_rays(center, direction, sigma, owner, len(survey.label))
    plane = np.array([values.height_m, 0.0, 0.0])
    ground = intersect_ground(center, direction, plane, np.zeros(2), np.zeros(len(rows)))
    point = compute_means(ground, owner, len(survey.label))
    point[survey.control_label] = survey.control_world_m
    anchored = np.zeros(len(survey.label), dtype=np.bool_)
    for known in (survey.control_label, survey.line_start, survey.line_end):
        anchored[known] = True
    for thing in survey.known:
        anchored[list(thing.label)] = True
    point[~anchored & (spread > MAX_RELATIVE_SIGMA)] = np.nan
    good = are_in_front(met, center, direction, owner) & (spread <= MAX_RELATIVE_SIGMA)
    point[good] = met[good]
    point_m, departure_m = values.point_m.copy(), values.departure_m.copy()
    point_m[free] = point[free, :2]
    departure_m[free] = np.nan_to_num(point[free, 2] - values.height_m)
    return values._replace(point_m=point_m, departure_m=departure_m)


def intersect_rays(
    center: Floats, direction: Floats, sigma_rad: Floats, owner: Ints, count: int
) -> tuple[Floats, Floats]:
    """Intersect rays: points (K, 3), and their largest sigma as a share of the distance (K,).

    The point nearest to all rays, in sigmas: minimum of the sum of |(I - d d^T)(x - c)|^2 over
    (sigma times the distance)^2, the distances those of the unweighted one.

    Parameters
    ----------
    center, direction
        (n, 3) origins of the rays, and unit vectors along them.
    sigma_rad
        (n,) standard deviations across them.
    owner
        (n,) point of each, 0 to count - 1.
    count
        Number K of points.
    """
    across = np.eye(3) - direction[:, :, None] * direction[:, None, :]
    onto = np.einsum("nij,nj->ni", across, center)
    weight = np.ones(len(owner))
    met, spread = np.full((count, 3), np.nan), np.full(count, np.inf)
    # First without weights, then with weights by the distances.
    for _ in range(2):
        normal = _sums(weight[:, None] * across.reshape(-1, 9), owner, count).reshape(-1, 3, 3)
        right = _sums(weight[:, None] * onto, owner, count)
        values = np.linalg.eigvalsh(normal)
        solvable = values[:, 0] > 1e-12 * values[:, 2]
        met[solvable] = np.linalg.solve(normal[solvable], right[solvable, :, None])[..., 0]
        distance = np.linalg.norm(met[owner] - center, axis=1)
        weight = np.nan_to_num(1.0 / np.maximum(sigma_rad * distance, 1e-9) ** 2, nan=1.0)
        mean = np.bincount(owner, distance, count) / np.maximum(np.bincount(owner, None, count), 1)
        with np.errstate(divide="ignore", invalid="ignore"):
            largest = 1.0 / np.sqrt(values[:, 0]) / mean
        spread = np.where(solvable & np.isfinite(largest), largest, np.inf)
    return met, spread


def _sums(rows: Floats, owner: Ints, count: int) -> Floats:
    """Sum the rows (n, k) of each owner, to (count, k)."""
    return np.stack([np.bincount(owner, column, count) for column in rows.T], axis=1)


def are_in_front(met: Floats, center: Floats, direction: Floats, owner: Ints) -> Bools:
    """Mark the points (K,) that are ahead on all of their rays.

    Parameters
    ----------
    met
        (K, 3) points; NaN for missing ones.
    center, direction
        (n, 3) origins of the rays, and unit vectors along them.
    owner
        (n,) point of each ray.
    """
    ahead = np.einsum("ni,ni->n", met[owner] - center, direction) > 0
    behind = np.bincount(owner[~ahead], minlength=len(met)) > 0
    return np.asarray(np.isfinite(met[:, 0]) & ~behind)


def compute_means(place: Floats, owner: Ints, count: int) -> Floats:
    """Compute (count, 3) means of the finite rows of each owner; NaN if there is none.

    Parameters
    ----------
    place
        (n, 3) places.
    owner
        (n,) point of each.
    count
        Number of points.
    """
    finite = np.isfinite(place).all(axis=1)
    total = np.zeros((count, 3))
    np.add.at(total, owner[finite], place[finite])
    number = np.bincount(owner[finite], minlength=count)
    return np.where(number[:, None] > 0, total / np.maximum(number, 1)[:, None], np.nan)


MIN_RELATIVE_DISTANCE = 0.05
"""Smallest distance of an initial point from its camera, as a share of the flying height. The
camera itself moves by part of it during the readout."""

MIN_LABELS = 3
"""Number of labels in a frame that determine its pose if its ties determine only its rotation."""


def add_first_ties(survey: Survey, values: FirstValues) -> tuple[Survey, Floats]:
    """Remove sightings without initial values, and return those of the remaining tie points.

    Parameters
    ----------
    survey
        Observations.
    values
        Initial values of poses and labels.

    Returns
    -------
    survey
        Without sightings of points that are not in front of their cameras, and without ties that
        are redundant to the labels in their frames.
    point_m : (T, 3)
        For chains of matches east, north and departure; then for tie points east, north, up.
    """
    if not survey.matches.points + survey.ties.points:
        return survey, np.zeros((0, 3))
    chain, tie = _chains(survey, values), _ties(survey, values)
    label = survey.pick_label[survey.matches.pick]
    up = values.height_m + survey.height_above_m[label] + chain[:, 2]
    matches, chains = _keep_in_front(survey.matches, np.column_stack([chain[:, :2], up]), values)
    tie[_are_from_one_place(survey, values)] = np.nan
    ties, points = _keep_in_front(survey.ties, tie, values)
    usable = replace(survey, matches=matches, ties=ties)
    return usable, np.concatenate([chain[chains], tie[points]])


def _are_from_one_place(survey: Survey, values: FirstValues) -> Bools:
    """Mark ties (T,) of frames that only turned, while labels in each of them give its pose.

    They have no depth, and iterations on it would not converge.
    """
    ties = survey.ties
    low, high = np.full((ties.points, 3), np.inf), np.full((ties.points, 3), -np.inf)
    np.minimum.at(low, ties.point, values.center[ties.frame])
    np.maximum.at(high, ties.point, values.center[ties.frame])
    labels = np.bincount(find_seen_labels(survey)[0], minlength=len(survey.frame_id))
    fewest = np.full(ties.points, MIN_LABELS)
    np.minimum.at(fewest, ties.point, labels[ties.frame])
    return np.asarray((low == high).all(axis=1) & (fewest == MIN_LABELS))


def find_seen_labels(survey: Survey) -> tuple[Ints, Ints]:
    """Return frames and labels, (n,) each, of all pairs in which the frame shows the label."""
    shown = replace_matches_by_picks(survey)
    first, second = np.unique(np.stack([shown.pick_frame, shown.pick_label]), axis=1)
    return first, second


def _chains(survey: Survey, values: FirstValues) -> Floats:
    """Return (T, 3) east, north and departure of chains of matches: those of their labels."""
    label = survey.pick_label[survey.matches.pick]
    return np.column_stack([values.point_m[label], values.departure_m[label]])


def _ties(survey: Survey, values: FirstValues) -> Floats:
    """Intersect the rays of tie points (T, 3) if well ahead; else the rays and the ground."""
    ties, camera = survey.ties, survey.calibration
    ray = back_project(camera.model, camera.parameters, ties.pixel_px)
    direction = np.einsum("nij,nj->ni", values.rotation[ties.frame], ray)
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    good = np.isfinite(direction[:, 0]) & np.isfinite(values.center[ties.frame, 0])
    seen, owner = (values.center[ties.frame[good]], direction[good]), ties.point[good]
    met, spread = intersect_rays(
        *seen, ties.sigma_px[good] / camera.parameters[0], owner, ties.points
    )
    plane = np.array([values.height_m, 0.0, 0.0])
    ground = intersect_ground(*seen, plane, np.zeros(2), np.zeros(len(owner)))
    point = compute_means(ground, owner, ties.points)
    meets = are_in_front(met, *seen, owner) & (spread <= MAX_RELATIVE_SIGMA)
    point[meets] = met[meets]
    return point


def _keep_in_front(
    sightings: Sightings, world_m: Floats, values: FirstValues
) -> tuple[Sightings, Ints]:
    """Keep sightings of points (T, 3) well in front of their cameras; return these points, too.

    Parameters
    ----------
    sightings
        Sightings: frame and point of each.
    world_m
        (T, 3) initial values; NaN for points without.
    values
        Initial values of poses.
    """
    away = world_m[sightings.point] - values.center[sightings.frame]
    forward = values.rotation[sightings.frame][:, :, 2]
    depth = np.einsum("ni,ni->n", away, forward)
    height = np.abs(values.center[sightings.frame, 2] - values.height_m)
    return sightings.remove(~(depth > MIN_RELATIVE_DISTANCE * height))
