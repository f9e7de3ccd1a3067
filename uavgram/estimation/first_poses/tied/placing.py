"""Tied poses in the axes of the world: levelled by the ground, or fitted to known positions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.estimation.first_poses.tied.bundle import TiedPoses
from uavgram.geometry.motion.rotation import exp_so3, nearest_rotation
from uavgram.model.arrays import Bools, Floats, Ints

SAMPLE_COUNT = 200
"""Number of samples of three points, one of which should be entirely on the ground."""

MAX_EXTENT_RATIO = 0.05
"""Second extent of known positions, as a share of the first, below which they are in line: the roll
about the line is then determined by the ground."""

MIN_POINTS = 10
"""Smallest number of tie points that determine the ground."""


def transform(poses: TiedPoses, turn: Floats, scale: float, shift: Floats) -> TiedPoses:
    """Transform poses to axes where x is scale * turn x + shift.

    Parameters
    ----------
    poses
        Poses in any axes.
    turn
        (3, 3) rotation.
    scale
        Positive.
    shift
        (3,).
    """
    return replace(
        poses,
        center=scale * poses.center @ turn.T + shift,
        rotation=turn @ poses.rotation,
        point=scale * poses.point @ turn.T + shift,
    )


def level_scene(poses: TiedPoses, seed: int = 0) -> TiedPoses | None:
    """Transform poses so that most tie points are on the plane z = 0; None if undetermined.

    The plane with the smallest median distance of the points, among planes through three of them
    that all cameras are above; then the best fit to its near points.

    Parameters
    ----------
    poses
        Poses in any axes.
    seed
        Seed of the random samples.
    """
    point = poses.point[np.isfinite(poses.point[:, 0])]
    center = poses.center[poses.placed]
    if len(point) < MIN_POINTS:
        return None
    rng = np.random.default_rng(seed)
    three = point[np.argsort(rng.random((SAMPLE_COUNT, len(point))), axis=1)[:, :3]]
    normal = np.cross(three[:, 1] - three[:, 0], three[:, 2] - three[:, 0])
    size = np.linalg.norm(normal, axis=1)
    normal, base = normal[size > 0] / size[size > 0, None], three[size > 0, 0]
    side = (center[None] - base[:, None]) @ normal[:, :, None]
    # Turn the normals towards the cameras, and keep planes with all cameras on one side.
    normal *= np.sign(np.median(side[..., 0], axis=1))[:, None]
    above = (np.abs(side[..., 0]) > 0).all(axis=1) & (
        np.abs(np.sign(side[..., 0]).sum(axis=1)) == len(center)
    )
    if not above.any():
        return None
    off = np.abs(((point[None] - base[:, None]) @ normal[:, :, None])[..., 0])
    spread = np.where(above, np.median(off, axis=1), np.inf)
    best = int(np.argmin(spread))
    # Points within three robust sigmas, and the plane of best fit through them (SVD).
    near = point[off[best] <= 3.0 * 1.4826 * spread[best] + 1e-12]
    middle = near.mean(axis=0)
    fitted = np.linalg.svd(near - middle, full_matrices=False)[2][2]
    up = fitted * np.sign(fitted @ normal[best])
    turn = rotate_vector(up, np.array([0.0, 0.0, 1.0]))
    return transform(poses, turn, 1.0, -turn @ middle)


def rotate_vector(source: Floats, target: Floats) -> Floats:
    """Compute the smallest rotation (3, 3) that brings one unit vector (3,) onto another."""
    axis, cosine = np.cross(source, target), float(source @ target)
    sine = float(np.linalg.norm(axis))
    if sine < 1e-12:
        aside = np.linalg.svd(source[None])[2][1]
        return np.eye(3) if cosine > 0 else np.asarray(exp_so3(np.pi * aside))
    return np.asarray(exp_so3(axis / sine * np.arctan2(sine, cosine)))


def fit_to_positions(poses: TiedPoses, position_m: Floats, usable: Bools) -> TiedPoses | None:
    """Transform poses to known positions of cameras (F, 3); None if these do not suffice.

    Positions in line do not determine the roll about the line: then the ground is assumed level.

    Parameters
    ----------
    poses
        Poses in any axes.
    position_m
        (F, 3) east, north, up.
    usable
        (F,) mask of the frames whose position is known.
    """
    rows = np.flatnonzero(usable & poses.placed)
    if len(rows) < 2:
        return None
    given = position_m[rows] - position_m[rows].mean(axis=0)
    extent = np.linalg.svd(given, compute_uv=False)
    if extent[0] <= 0:
        return None
    if len(rows) >= 3 and extent[1] > MAX_EXTENT_RATIO * extent[0]:
        return _fit_similarity(poses, position_m, rows)
    level = level_scene(poses)
    return None if level is None else _fit_similarity(level, position_m, rows, upright=True)


def _fit_similarity(
    poses: TiedPoses, position_m: Floats, rows: Ints, *, upright: bool = False
) -> TiedPoses:
    """Fit a similarity in closed form (Umeyama 1991); `upright`: rotation about up only.

    Parameters
    ----------
    poses
        Poses in any axes, or level.
    position_m
        (F, 3).
    rows
        Frames that are used.
    upright
        Whether the poses are level.
    """
    source, target = poses.center[rows], position_m[rows]
    from_source, from_target = source - source.mean(axis=0), target - target.mean(axis=0)
    product = from_target.T @ from_source
    if upright:
        product[2], product[:, 2] = 0.0, 0.0
        product[2, 2] = np.linalg.norm(product)
    turn = nearest_rotation(product)
    turned = from_source @ turn.T
    scale = float(np.sum(from_target * turned) / np.sum(turned**2))
    shift = target.mean(axis=0) - scale * turn @ source.mean(axis=0)
    return transform(poses, turn, scale, shift)
