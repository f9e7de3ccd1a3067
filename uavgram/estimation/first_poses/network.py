"""Initial values of a survey's unknowns: from the telemetry, or from lengths and known points."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from uavgram.estimation.first_poses.length_poses import (
    LengthFrames,
    LengthPoses,
    resect_from_lengths,
    search_frames,
)
from uavgram.geometry.ground.plane import intersect_ground
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.camera import Calibration
from uavgram.model.survey import Survey


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
    """

    frame: Ints
    line: Ints
    start: Ints
    end: Ints


def find_seen_lines(survey: Survey) -> SeenLines:
    """Find the known lengths with both ends in a frame, of those that a plane can start from.

    Both ends must be in one area and at one height above it (others would need a ray of their own:
    they refine the pose but do not start it), and on two pixels.
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
    found &= (survey.area[a] == survey.area[b]) & (
        survey.height_above_m[a] == survey.height_above_m[b]
    )
    level = has_known_height(survey)
    found &= level[a] & level[b]
    found &= (survey.pixel_px[start] != survey.pixel_px[end]).any(axis=1)
    rows = np.flatnonzero(found)
    rows = rows[np.argsort(survey.pick_frame[start[rows]], kind="stable")]
    return SeenLines(survey.pick_frame[start[rows]], line[rows], start[rows], end[rows])


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
    length_sigma[row, line_rank] = survey.length_sigma_m[seen.line[rows]]
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
