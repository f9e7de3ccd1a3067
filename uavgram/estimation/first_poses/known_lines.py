"""Poses of photos from lines of known position, and detection of a contradicting line."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc

from uavgram.estimation.first_poses.first_values import estimate_ground_height, has_known_height
from uavgram.estimation.first_poses.resection import LineRows, move_poses
from uavgram.estimation.solver.batched import ExplicitProblem, Minima, minimise_each
from uavgram.geometry.camera.projection import back_project_with_jacobian
from uavgram.geometry.ground.plane import factor_homographies
from uavgram.geometry.motion.rotation import exp_so3
from uavgram.model.arrays import Floats, Ints
from uavgram.model.frames import CandidatePoses
from uavgram.model.survey import Survey

MIN_ROWS = 6
"""Smallest number of rows: a pose has six unknowns."""
MAX_INCREASE = 25.0
"""Largest difference of the sum of squares to the best, up to which another minimum is returned."""
MIN_PROBABILITY = 1e-4
"""Probability of a frame's sum of squares below which some line is wrong."""
MIN_DECREASE = 2.0 * float(np.log(1000.0))
"""Reduction of the sum of squares by which one line is a likelier fault than any other."""
MAX_FRAMES = 3
"""Number of frames by which a line is judged: those with most rows."""
CONTROL_NUMBER = -1
"""Number that marks the rows of control points, in place of a line's."""
STEP_DEG = 20.0
"""Angle between the rotations of the search [deg]."""
TILTS_DEG = (0.0, 22.0, 40.0, 56.0, 72.0)
CANDIDATE_COUNT, FINALIST_COUNT = 64, 6
"""Number of rotations whose sum of squares is minimised, and number of these that are minimised to
the end."""
FIRST_STEPS, LAST_STEPS = 12, 100
MAX_AT_ONCE = 400_000
"""Largest number of rotations times picks that are tried at once."""


class _Rows(NamedTuple):
    """Picks (R,) on lines, with number of the thing; start, direction (R, 2), sigma (R,) [m]."""

    pick: Ints
    thing: Ints
    start_m: Floats
    along: Floats
    sigma_m: Floats


class _Rays(NamedTuple):
    """Rays (P, 3) of all picks, and roots (P, 2, 2) of the covariances of their x and y."""

    ray: Floats
    root: Floats


def estimate_line_poses(survey: Survey) -> tuple[CandidatePoses, ...]:
    """Estimate the pose of each frame with enough points on lines of known position.

    A control point counts as two lines, to the east and to the north: a few may supplement the
    lines. A line that contradicts the others is left out.
    """
    rows = _rows(survey)
    if not len(rows.pick):
        return ()
    rays, height, odd = _rays(survey), estimate_ground_height(survey), find_outlying_line(survey)
    found = []
    for frame, own in _group_rows_by_frame(survey, rows, rays).items():
        some = own[~np.isin(rows.thing[own], list(odd))]
        ends = _poses(rows, rays, some if len(some) >= MIN_ROWS else own)
        cost = ends.cost[0]
        near = np.flatnonzero(np.isfinite(cost) & (cost <= cost[0] + MAX_INCREASE))
        if len(near):
            found.append(
                CandidatePoses(
                    frame_id=survey.frame_id[frame],
                    center_world_m=ends.state[0][0, near] + [0.0, 0.0, height],
                    world_from_camera=ends.state[1][0, near],
                    misfit=np.sqrt(cost[near] / len(own)),
                )
            )
    return tuple(found)


def find_outlying_line(survey: Survey) -> frozenset[int]:
    """Return the number of the line without which all others agree; empty if there is none.

    Empty if several lines are possible.
    """
    rows = _rows(survey)
    if not len(rows.pick):
        return frozenset()
    rays = _rays(survey)
    frames = _group_rows_by_frame(survey, rows, rays)
    misfits = [own for own in frames.values() if _cost(rows, rays, own) == np.inf]
    if not misfits:
        return frozenset()
    misfits = sorted(misfits, key=len)[-MAX_FRAMES:]
    shown = [set(rows.thing[own].tolist()) - {CONTROL_NUMBER} for own in misfits]
    without = {
        thing: sum(_cost(rows, rays, own[rows.thing[own] != thing]) for own in misfits)
        for thing in set.intersection(*shown)
    }
    best, *others = sorted((cost, thing) for thing, cost in without.items()) or [
        (np.inf, CONTROL_NUMBER)
    ]
    is_sure = best[0] < np.inf and all(cost - best[0] >= MIN_DECREASE for cost, _ in others)
    return frozenset([best[1]] if is_sure else ())


def _cost(rows: _Rows, rays: _Rays, own: Ints) -> float:
    """Compute the sum of squares of lines that determine a pose, check it, and fit it; else inf."""
    degrees = len(own) - MIN_ROWS
    if degrees <= 0:
        return float("inf")
    cost = float(_poses(rows, rays, own).cost[0, 0])
    return cost if np.isfinite(cost) and chdtrc(degrees, cost) >= MIN_PROBABILITY else float("inf")


def _poses(rows: _Rows, rays: _Rays, own: Ints) -> Minima:
    """Estimate poses of one frame by some of its rows, over ground at z = 0."""
    pick = rows.pick[own]
    return find_poses_from_lines(
        LineRows(
            ray=rays.ray[pick][None],
            ray_root=rays.root[pick][None],
            start_m=rows.start_m[own][None],
            along=rows.along[own][None],
            sigma_m=rows.sigma_m[own][None],
        )
    )


def _group_rows_by_frame(survey: Survey, rows: _Rows, rays: _Rays) -> dict[int, Ints]:
    """Return the rows of each frame that has enough of them."""
    usable = np.isfinite(rays.ray[rows.pick]).all(axis=1)
    frame = survey.pick_frame[rows.pick]
    found = {f: np.flatnonzero(usable & (frame == f)) for f in range(len(survey.frame_id))}
    return {f: own for f, own in found.items() if len(own) >= MIN_ROWS}


def _rays(survey: Survey) -> _Rays:
    lens = survey.calibration
    ray, by_pixel, _ = back_project_with_jacobian(lens.model, lens.parameters, survey.pixel_px)
    return _Rays(ray, by_pixel[:, :2] * survey.pick_sigma_px[:, None, None])


def _rows(survey: Survey) -> _Rows:
    """Return the picks of points on the ground that are on a line; no rows without lines."""
    lines: dict[int, list[tuple[float, ...]]] = {}
    for one in survey.known:
        if one.position is None:
            continue
        start, end = one.position.ends_m[:, :2]
        along = (end - start) / np.linalg.norm(end - start)
        for label in one.label:
            lines.setdefault(label, []).append((one.index, *start, *along, one.sigma))
    if lines:
        _add_control(survey, lines)
    level = has_known_height(survey) & (survey.height_above_m == 0.0)
    found = [
        (pick, *line)
        for pick, label in enumerate(survey.pick_label.tolist())
        if level[label]
        for line in lines.get(label, ())
    ]
    table = np.array(found, dtype=np.float64).reshape(-1, 7)
    index: Ints = table[:, :2].astype(np.int64)
    return _Rows(index[:, 0], index[:, 1], table[:, 2:4], table[:, 4:6], table[:, 6])


def _add_control(survey: Survey, lines: dict[int, list[tuple[float, ...]]]) -> None:
    """Add each control point as a line to the north and one to the east."""
    for label, (east, north, _), (sigma_east, sigma_north, _) in zip(
        survey.control_label.tolist(),
        survey.control_world_m.tolist(),
        survey.control_sigma_m.tolist(),
        strict=True,
    ):
        lines.setdefault(label, []).extend(
            [
                (CONTROL_NUMBER, east, north, 0.0, 1.0, sigma_east),
                (CONTROL_NUMBER, east, north, 1.0, 0.0, sigma_north),
            ]
        )


def find_poses_from_lines(seen: LineRows) -> Minima:
    """Find the minima of each photo, the lowest first.

    Returns
    -------
    Ends
        With shapes (B, S, ...): S poses, some may be equal; an infinite cost marks none.

    Notes
    -----
    Starts: the direct linear transformation, if there are enough picks; and a search over
    rotations. For a given rotation, each pick is linear in the centre C: with the ray d = R r,
    which meets the ground at C - (C_z / d_z) d, the condition is n . (C - (C_z / d_z) d) = n . A.
    """
    direct = compute_direct_poses(seen)
    found = _search_rotations(seen)
    center = np.concatenate([direct[0][:, None], found[0]], axis=1)
    rotation = np.concatenate([direct[1][:, None], found[1]], axis=1)
    near = _find_minima(seen, center, rotation, FIRST_STEPS)
    center, rotation = (part[:, :FINALIST_COUNT] for part in near.state)
    return _find_minima(seen, center, rotation, LAST_STEPS)


def _find_minima(seen: LineRows, center: Floats, rotation: Floats, iterations: int) -> Minima:
    """Return minima (B, S, ...) from S starts of each photo, the lowest first."""
    starts = center.shape[1]
    photo = np.repeat(np.arange(len(center)), starts)
    start = center.reshape(-1, 3), rotation.reshape(-1, 3, 3)
    problem = ExplicitProblem(seen.of_photos(photo).rows, move_poses)
    return minimise_each(problem, start, iterations).lowest_first(starts)


def compute_direct_poses(seen: LineRows) -> tuple[Floats, Floats]:
    """Compute centres (B, 3) and rotations (B, 3, 3) by direct linear transformation.

    The homography G takes rays to the ground: with a line's coordinates l and a ray on it, l^T G r
    = 0 (as Hartley and Zisserman 2004, sec. 4.1, for lines); least squares. Below eight picks the
    result has no meaning; the search has other starts.
    """
    middle = seen.start_m.mean(axis=1)
    size = np.sqrt(np.mean(np.sum((seen.start_m - middle[:, None]) ** 2, axis=2), axis=1))
    local = (seen.start_m - middle[:, None]) / size[:, None, None]
    line = np.concatenate(
        [seen.across, -np.sum(seen.across * local, axis=2, keepdims=True)], axis=2
    )
    rows = np.einsum("bni,bnj->bnij", line, seen.ray).reshape(*line.shape[:2], 9)
    _, _, vectors = np.linalg.svd(rows)
    to_ground = vectors[:, -1].reshape(-1, 3, 3)
    # G is the inverse of [r1 r2 t] up to scale; the matrix of its cofactors always exists.
    first, second, third = (to_ground[:, i] for i in range(3))
    columns = np.stack(
        [np.cross(second, third), np.cross(third, first), np.cross(first, second)], axis=2
    )
    to_camera, origin = factor_homographies(columns)
    center = -np.einsum("bji,bj->bi", to_camera, origin) * size[:, None]
    center[:, :2] += middle
    return center, to_camera.swapaxes(1, 2)


def _search_rotations(seen: LineRows) -> tuple[Floats, Floats]:
    """Return centres (B, S, 3) and rotations (B, S, 3, 3) of the likeliest rotations."""
    grid = make_rotations()
    block = max(1, MAX_AT_ONCE // (len(grid) * seen.ray.shape[1]))
    parts = [
        _solve_positions(seen, grid, slice(k, k + block)) for k in range(0, len(seen.ray), block)
    ]
    center, rotation = (np.concatenate(part) for part in zip(*parts, strict=True))
    return center, rotation


def _solve_positions(seen: LineRows, grid: Floats, photos: slice) -> tuple[Floats, Floats]:
    across = seen.across[photos]
    target = np.einsum("bni,bni->bn", across, seen.start_m[photos])[:, None]
    ray = np.einsum("gij,bnj->bgni", grid, seen.ray[photos])
    down = np.minimum(ray[..., 2], -1e-9)
    # Linear condition on the centre for each rotation: n . (C - (C_z / d_z) d) = n . A.
    rows = np.empty(ray.shape)
    rows[..., :2] = across[:, None]
    rows[..., 2] = -np.einsum("bni,bgni->bgn", across, ray[..., :2]) / down
    weight = -down / np.linalg.norm(ray, axis=-1)  # far places move more for the same angle
    weighted = rows * weight[..., None]
    transposed = weighted.swapaxes(-1, -2)
    normal = transposed @ weighted
    normal += 1e-9 * np.trace(normal, axis1=-2, axis2=-1)[..., None, None] * np.eye(3)
    right = transposed @ (weight * target)[..., None]
    center = np.linalg.solve(normal, right)[..., 0]
    off = (np.einsum("bgni,bgi->bgn", rows, center) - target) * weight
    height = center[..., 2]
    misfit = np.sum(off**2, axis=-1) / np.maximum(height, 1e-9) ** 2
    upwards = (ray[..., 2] >= -1e-9).any(axis=-1)
    misfit[(height <= 0) | upwards] = np.inf
    best = np.argpartition(misfit, CANDIDATE_COUNT, axis=1)[:, :CANDIDATE_COUNT]
    return np.take_along_axis(center, best[..., None], axis=1), grid[best]


def make_rotations() -> Floats:
    """Return (G, 3, 3) rotations of cameras that look down, about `STEP_DEG` apart."""
    roll = np.deg2rad(np.arange(0.0, 360.0, STEP_DEG))
    found = []
    for tilt in np.deg2rad(TILTS_DEG):
        count = max(1, int(np.ceil(np.sin(tilt) * 2 * np.pi / np.deg2rad(STEP_DEG))))
        azimuth = 2.0 * np.pi * np.arange(count) / count
        about_up, about_axis = (
            exp_so3(angle.reshape(-1, 1) * [0.0, 0.0, 1.0])
            for angle in np.meshgrid(azimuth, roll, indexing="ij")
        )
        # Looking down with image up to the north, then tilted towards the north.
        tilted = exp_so3(np.array([tilt, 0.0, 0.0])) @ np.diag([1.0, -1.0, -1.0])
        found.append(about_up @ tilted @ about_axis)
    return np.concatenate(found)
