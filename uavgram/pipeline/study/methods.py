"""Ways to find the pose of one photo, compared on the same scenes with the same information."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from uavgram.estimation.first_poses.known_lines import rivals
from uavgram.estimation.first_poses.pose_problem import FeatureRows, first_points, ground_points
from uavgram.estimation.solver.batched import Ends, minimise_each
from uavgram.model.arrays import Bools, Ints
from uavgram.model.study.methods import MethodRow
from uavgram.pipeline.study.method_results import Found, row_of
from uavgram.pipeline.study.method_scenes import MethodScenes, Setting, method_scenes
from uavgram.pipeline.study.method_starts import (
    Starts,
    direct_starts,
    length_starts,
    line_starts,
    log_starts,
    point_starts,
)

AMBIGUOUS = 9.0
"""Rise of the sum of squares up to which another pose fits as well: three sigma."""

LIMITS = (
    Setting(name="three lines", features=(3, 3)),
    Setting(name="lines of 1 to 2 m", length_m=(1.0, 2.0)),
    Setting(name="lines parallel to 3 degrees", turn_deg=3.0),
    Setting(name="all in a corner, a third as wide", share=0.33, length_m=(2.0, 6.0)),
    Setting(name="picks to 3 px", pick_px=3.0),
    Setting(name="distortion left out (k1 = -0.05)", bulge=-0.05),
    Setting(name="points 5 cm off the ground", relief_m=0.05),
    Setting(name="straight down, to 5 degrees", tilt_deg=(0.0, 5.0)),
)
"""Settings beyond the usual one, in which one method or another ends."""

Starter = Callable[[MethodScenes], Starts]


def compared(
    setting: Setting, scenes: int, seed: int = 0, more: Mapping[str, Starter] | None = None
) -> list[MethodRow]:
    """Compare all methods in one setting.

    Parameters
    ----------
    setting
        What the scenes are like.
    scenes
        How many; as many of each number of features.
    seed
        Of the draws.
    more
        Other ways to begin with lines of known position, by name.
    """
    counts = range(setting.features[0], setting.features[1] + 1)
    each = max(1, scenes // len(counts))
    found: dict[str, list[Found]] = {}
    for lines in counts:
        drawn = method_scenes(setting, lines, each, seed)
        for name, method in METHODS.items():
            found.setdefault(name, []).append(method(drawn))
        for name, starter in (more or {}).items():
            found.setdefault(name, []).append(_by_lines(drawn, starter(drawn)))
    return [row_of(setting.name, name, parts) for name, parts in found.items()]


def solved(rows: FeatureRows, starts: Starts) -> Ends:
    """Minima (B, S, ...) from S starts of each scene, the lowest first; cost inf: there is none."""
    scenes, count = starts[0].shape[:2]
    owner = np.repeat(np.arange(scenes), count)
    repeated = _some(rows, owner)
    center, rotation = starts[0].reshape(-1, 3), starts[1].reshape(-1, 3, 3)
    point, good = first_points(repeated, center, rotation)
    center = np.where(good[:, None], center, [0.0, 0.0, -1.0])  # below ground: no pose
    rotation = np.where(good[:, None, None], rotation, np.eye(3))
    if rows.held is not None:  # each start holds its own gauge
        repeated = replace(repeated, held=(center, rotation))
    return minimise_each(repeated, (center, rotation, point)).lowest_first(count)


def _some(rows: FeatureRows, which: Ints) -> FeatureRows:
    logged = rows.logged
    if logged is not None:
        logged = replace(logged, center=logged.center[which], rotation=logged.rotation[which])
    return replace(
        rows,
        pixel_px=rows.pixel_px[which],
        place_m=rows.place_m[which],
        length_m=rows.length_m[which],
        logged=logged,
    )


def _judged(scenes: MethodScenes, ends: Ends, told: Bools | None = None) -> Found:
    """Errors and predicted sigmas of the withheld distances under the best pose of each scene."""
    center, rotation = (part[:, 0] for part in ends.state[:2])
    lens, sigma_px = scenes.rows.calibration, scenes.rows.pick_sigma_px
    point, by_pose, by_pixel = ground_points(lens, scenes.check_px, center, rotation)
    away = point[:, :, 1] - point[:, :, 0]
    length = np.linalg.norm(away, axis=-1)
    unit = away / length[..., None]
    of_pose = np.einsum("bmi,bmij->bmj", unit, by_pose[:, :, 1] - by_pose[:, :, 0])
    of_picks = np.einsum("bmi,bmeij->bmej", unit, by_pixel) * sigma_px
    solvable = np.isfinite(ends.cost[:, 0])
    normal = np.where(solvable[:, None, None], ends.normal[:, 0], np.eye(6))
    whole = np.einsum("bmi,bij,bmj->bm", of_pose, np.linalg.pinv(normal, hermitian=True), of_pose)
    whole = np.where(whole >= 0, whole, np.inf)  # to rounding nothing determines it
    variance = whole + np.sum(of_picks**2, axis=(2, 3))
    none = np.where(solvable, 0.0, np.nan)[:, None]
    return Found(
        error_m=length - scenes.check_m + none,
        sigma_m=np.sqrt(variance) + none,
        true_m=scenes.check_m,
        cost=ends.cost[:, 0],
        ambiguous=np.isfinite(rivals(ends, AMBIGUOUS)) if told is None else told,
    )


def by_points(scenes: MethodScenes) -> Found:
    """Start of every line as a point of known place: IPPE, then maximum likelihood."""
    return _judged(scenes, solved(replace(scenes.rows, start_place=True), point_starts(scenes)))


def by_points_alone(scenes: MethodScenes) -> Found:
    """The same points: the best pose of IPPE as it is, without sigmas."""
    center, rotation = point_starts(scenes)
    count = len(center)
    cost = np.where(np.isfinite(center[:, :, 0]), 0.0, np.inf)
    nothing = np.full((count, center.shape[1], 6, 6), np.nan)
    nothing[:] = np.eye(6)
    fits = np.isfinite(cost)
    ends = Ends((center, rotation), cost, nothing, fits, np.zeros(fits.shape, dtype=np.int64))
    found = _judged(scenes, ends, np.zeros(count, dtype=np.bool_))
    return replace(found, sigma_m=np.full(found.sigma_m.shape, np.nan))


def by_lines(scenes: MethodScenes) -> Found:
    """Lines of known position: the direct start and the search, then maximum likelihood."""
    return _by_lines(scenes, line_starts(scenes))


def by_lines_directly(scenes: MethodScenes) -> Found:
    """Lines of known position from the direct linear transformation alone."""
    return _by_lines(scenes, direct_starts(scenes))


def by_lengths(scenes: MethodScenes) -> Found:
    """Lengths of the lines alone: where the camera stands and heads stays open."""
    starts = length_starts(scenes)
    rows = replace(scenes.rows, length=True, held=(starts[0][:, 0], starts[1][:, 0]))
    return _judged(scenes, solved(rows, starts))


def by_log(scenes: MethodScenes) -> Found:
    """The log alone."""
    return _judged(scenes, solved(replace(scenes.rows, logged=scenes.logged), log_starts(scenes)))


def by_lengths_and_log(scenes: MethodScenes) -> Found:
    """The thesis's lengths with the log as a prior: what this program does."""
    rows = replace(scenes.rows, length=True, logged=scenes.logged)
    return _judged(scenes, solved(rows, log_starts(scenes)))


def by_all(scenes: MethodScenes) -> Found:
    """Start's place, end on its line, length and log together; nothing counts twice."""
    rows = replace(
        scenes.rows, start_place=True, end_on_line=True, length=True, logged=scenes.logged
    )
    starts = [point_starts(scenes), log_starts(scenes)]
    center, rotation = (np.concatenate(part, axis=1) for part in zip(*starts, strict=True))
    return _judged(scenes, solved(rows, (center, rotation)))


METHODS: Mapping[str, Callable[[MethodScenes], Found]] = {
    "points, IPPE alone": by_points_alone,
    "points": by_points,
    "lines of known position": by_lines,
    "lines, direct start only": by_lines_directly,
    "lengths": by_lengths,
    "log": by_log,
    "lengths and log": by_lengths_and_log,
    "all": by_all,
}
"""By name, in the order of tables."""


def _by_lines(scenes: MethodScenes, starts: Starts) -> Found:
    rows = replace(scenes.rows, start_on_line=True, end_on_line=True)
    return _judged(scenes, solved(rows, starts))
