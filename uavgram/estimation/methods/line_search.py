"""Poses of many photos from lines of known position: every start that may lead to the best one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from uavgram.estimation.methods.damped import Ends, Linear, State, minimised
from uavgram.estimation.methods.on_lines import OnLines
from uavgram.geometry.motion.rotation import nearest_rotation
from uavgram.model.arrays import Floats, Ints

STEP_DEG = 20.0
"""Between the rotations of the search."""
TILTS_DEG = (0.0, 22.0, 40.0, 56.0, 72.0)
LIKELIEST, FINALISTS = 64, 6
"""Rotations from which the sum of squares is brought down; of these, how many to the end."""
FIRST_STEPS, LAST_STEPS = 12, 100
MOST_AT_ONCE = 400_000
"""Rotations times picks that are tried at once."""
SAME_DIRECTION_RAD, SAME_PLACE = 0.01, 0.02
"""Poses closer than this, and by a share of the camera's height, are one."""


@dataclass(frozen=True, eq=False)
class _Repeated:
    """The problems of some photos, each from several starts."""

    seen: OnLines
    owner: Ints

    def linearised(self, which: Ints, state: State) -> Linear:
        return self.seen.linearised(self.owner[which], state)

    def moved(self, state: State, linear: Linear, step: Floats) -> State:
        return self.seen.moved(state, linear, step)


def poses_from_lines(seen: OnLines) -> Ends:
    """Minima of each photo, the lowest first.

    Returns
    -------
    Ends
        With shapes (B, S, ...): S poses, of which some may be the same; cost inf: there is none.

    Notes
    -----
    Starts: the direct linear transformation, where the picks are enough; and a search over
    rotations. Given one, each pick is linear in the centre C: with the ray d = R r, which meets the
    ground at C - (C_z / d_z) d, the condition is n . (C - (C_z / d_z) d) = n . A.
    """
    direct = direct_poses(seen)
    found = _searched(seen)
    center = np.concatenate([direct[0][:, None], found[0]], axis=1)
    rotation = np.concatenate([direct[1][:, None], found[1]], axis=1)
    near = _sorted(_minimised(seen, center, rotation, FIRST_STEPS))
    best = slice(None), slice(FINALISTS)
    return _sorted(_minimised(seen, near.center[best], near.rotation[best], LAST_STEPS))


def _minimised(seen: OnLines, center: Floats, rotation: Floats, iterations: int) -> Ends:
    """Minima (B, S, ...) from S starts of each photo."""
    photos, starts = center.shape[:2]
    problem = _Repeated(seen, np.repeat(np.arange(photos), starts))
    ends = minimised(problem, (center.reshape(-1, 3), rotation.reshape(-1, 3, 3)), iterations)
    return _each(ends, lambda part: part.reshape(photos, starts, *part.shape[1:]))


def _sorted(ends: Ends) -> Ends:
    """Each photo's, the lowest first."""
    order = np.argsort(ends.cost, axis=1, kind="stable")
    return _each(ends, lambda part: part[np.arange(len(order))[:, None], order])


def _each(ends: Ends, changed: Callable[[Any], Any]) -> Ends:
    """The same change of all parts."""
    return Ends(
        changed(ends.center),
        changed(ends.rotation),
        changed(ends.cost),
        changed(ends.normal),
        changed(ends.converged),
    )


def rivals(ends: Ends, within: float) -> Floats:
    """(B,) by how much the next other minimum is worse than the best; beyond `within`, inf."""
    center, cost = ends.center, ends.cost
    height = np.maximum(center[:, :1, 2], 1e-9)
    apart = np.linalg.norm(center - center[:, :1], axis=2) / height
    turn = np.einsum("bij,bsij->bs", ends.rotation[:, 0], ends.rotation)
    other = (apart > SAME_PLACE) | (np.arccos(np.clip((turn - 1) / 2, -1, 1)) > SAME_DIRECTION_RAD)
    with np.errstate(invalid="ignore"):
        worse = np.where(other & ends.converged, cost - cost[:, :1], np.inf)
    least = np.nan_to_num(worse, nan=np.inf).min(axis=1)
    return np.where(least <= within, least, np.inf)


def direct_poses(seen: OnLines) -> tuple[Floats, Floats]:
    """Centres (B, 3) and rotations (B, 3, 3) by direct linear transformation, least squares.

    The homography G takes rays to the ground: with a line's coordinates l and a ray on it,
    l^T G r = 0 (as Hartley and Zisserman 2004, sec. 4.1, for lines). Below eight picks the answer
    means nothing; the search has others.
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
    # G = [X_1 X_2 X_3] up to scale is the inverse of [r1 r2 t]: by cofactors it always exists.
    first, second, third = (to_ground[:, i] for i in range(3))
    columns = np.stack(
        [np.cross(second, third), np.cross(third, first), np.cross(first, second)], axis=2
    )
    scale = np.sqrt(
        np.linalg.norm(columns[:, :, 0], axis=1) * np.linalg.norm(columns[:, :, 1], axis=1)
    )
    columns /= np.maximum(scale, 1e-300)[:, None, None]
    columns *= np.where(columns[:, 2:3, 2:3] < 0, -1.0, 1.0)  # the middle lies before the camera
    rough = np.stack(
        [columns[:, :, 0], columns[:, :, 1], np.cross(columns[:, :, 0], columns[:, :, 1])], axis=2
    )
    to_camera = nearest_rotation(rough)
    center = -np.einsum("bji,bj->bi", to_camera, columns[:, :, 2]) * size[:, None]
    center[:, :2] += middle
    return center, to_camera.swapaxes(1, 2)


def _searched(seen: OnLines) -> tuple[Floats, Floats]:
    """Centres (B, S, 3) and rotations (B, S, 3, 3) of the likeliest rotations."""
    grid = rotations()
    block = max(1, MOST_AT_ONCE // (len(grid) * seen.ray.shape[1]))
    parts = [_of_block(seen, grid, slice(k, k + block)) for k in range(0, len(seen.ray), block)]
    center, rotation = (np.concatenate(part) for part in zip(*parts, strict=True))
    return center, rotation


def _of_block(seen: OnLines, grid: Floats, photos: slice) -> tuple[Floats, Floats]:
    across = seen.across[photos]
    target = np.einsum("bni,bni->bn", across, seen.start_m[photos])[:, None]
    ray = np.einsum("gij,bnj->bgni", grid, seen.ray[photos])
    down = np.minimum(ray[..., 2], -1e-9)
    rows = np.empty(ray.shape)
    rows[..., :2] = across[:, None]
    rows[..., 2] = -np.einsum("bni,bgni->bgn", across, ray[..., :2]) / down
    weight = -down / np.linalg.norm(ray, axis=-1)  # far places move more by the same angle
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
    best = np.argpartition(misfit, LIKELIEST, axis=1)[:, :LIKELIEST]
    return np.take_along_axis(center, best[..., None], axis=1), grid[best]


def rotations() -> Floats:
    """(G, 3, 3) world from camera of cameras that look down, about `STEP_DEG` apart."""
    roll = np.deg2rad(np.arange(0.0, 360.0, STEP_DEG))
    found = []
    for tilt in np.deg2rad(TILTS_DEG):
        count = max(1, int(np.ceil(np.sin(tilt) * 2 * np.pi / np.deg2rad(STEP_DEG))))
        azimuth = 2.0 * np.pi * np.arange(count) / count
        about_up, about_axis = np.meshgrid(azimuth, roll, indexing="ij")
        looking = _about_z(about_up.ravel()) @ _tilted(float(tilt)) @ _about_z(about_axis.ravel())
        found.append(looking)
    return np.concatenate(found)


def _about_z(angle: Floats) -> Floats:
    turn = np.zeros((len(angle), 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = np.cos(angle)
    turn[:, 1, 0], turn[:, 0, 1], turn[:, 2, 2] = np.sin(angle), -np.sin(angle), 1.0
    return turn


def _tilted(tilt: float) -> Floats:
    """World from camera of one that looks north and down, `tilt` away from straight down."""
    sine, cosine = np.sin(tilt), np.cos(tilt)
    return np.array([[1.0, 0.0, 0.0], [0.0, -cosine, sine], [0.0, -sine, -cosine]])
