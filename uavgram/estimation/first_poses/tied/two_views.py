"""How two cameras stand to each other, from the rays to points that both see."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.estimation.first_poses.tied.essential import (
    epipolar_angles,
    epipolar_misses,
    essential_matrices,
    poses_of,
)
from uavgram.geometry.motion.rotation import exp_so3, hat
from uavgram.model.arrays import Floats

SAMPLES = 60
"""Samples of five rays; with a tenth of the ties wrong, 59 % of them are free of wrong ones."""

SCORED = 150
"""Points by which the solutions of the samples are told apart."""

MOST = 8
"""Solutions that are refined."""

ALIKE = 0.02
"""Between two refined poses: the same [rad]."""

RIVAL = 3.0
"""Times the best misfit up to which another pose is kept: points in a plane allow two."""


class RelativePose(NamedTuple):
    """x2 = rotation x1 + shift, |shift| = 1, and how far rays typically miss each other [rad]."""

    rotation: Floats
    shift: Floats
    miss_rad: float


def relative_poses(first: Floats, second: Floats, rng: np.random.Generator) -> list[RelativePose]:
    """Poses of the second camera that explain the rays (n, 3) to the same points, best first.

    Those that no other one beats by far: where all points lie about in a plane, two may explain
    them alike. Half of the points may be wrong (least median of squares, Rousseeuw 1984).

    Parameters
    ----------
    first, second
        (n, 3) unit rays from the two cameras.
    rng
        For the samples.
    """
    count = len(first)
    sample = np.argsort(rng.random((SAMPLES, count)), axis=1)[:, :5]
    essential = essential_matrices(first[sample], second[sample])
    some = rng.permutation(count)[:SCORED]
    if not len(essential):
        return []
    angles = epipolar_angles(essential, first[some], second[some])
    order = np.argsort(np.median(np.abs(angles), axis=1))
    found: list[RelativePose] = []
    tried: list[Floats] = []
    for index in order:
        flat = essential[index].ravel()
        if any(abs(flat @ one) / 2.0 > np.cos(2.0 * ALIKE) for one in tried):
            continue
        tried.append(flat)
        pose = _refined(_in_front(essential[index], first, second), first, second)
        if pose is not None and not any(_same(pose, other) for other in found):
            found.append(pose)
        if len(tried) >= MOST:
            break
    found.sort(key=lambda pose: pose.miss_rad)
    return [pose for pose in found if pose.miss_rad <= RIVAL * found[0].miss_rad]


def _same(one: RelativePose, other: RelativePose) -> bool:
    turn = np.linalg.norm(one.rotation - other.rotation) / np.sqrt(2.0)
    return bool(turn < ALIKE and np.linalg.norm(one.shift - other.shift) < 5.0 * ALIKE)


def _in_front(essential: Floats, first: Floats, second: Floats) -> RelativePose:
    """Of the four poses, the one that has most points ahead of both cameras."""
    rotation, shift = poses_of(essential)
    ahead = [_ahead(r, t, first, second).sum() for r, t in zip(rotation, shift, strict=True)]
    best = int(np.argmax(ahead))
    return RelativePose(rotation[best], shift[best], np.inf)


def _ahead(rotation: Floats, shift: Floats, first: Floats, second: Floats) -> Floats:
    """(n,) whether rays meet ahead of both cameras: a r1 + t = b r2, a and b positive."""
    turned = first @ rotation.T
    normal = np.cross(turned, second)
    return np.asarray(
        (np.einsum("ni,ni->n", np.cross(second, shift), normal) > 0)
        & (np.einsum("ni,ni->n", np.cross(turned, shift), normal) > 0)
    )


def _refined(pose: RelativePose, first: Floats, second: Floats) -> RelativePose | None:
    """The pose near another that misses least, by Gauss and Newton over rays that nearly meet."""
    rotation, shift, miss = pose
    for _ in range(8):
        essential = hat(shift) @ rotation
        value, slope = (v[0] for v in epipolar_misses(essential[None], first, second))
        angle = value / slope
        spread = 1.4826 * float(np.median(np.abs(angle)))
        good = np.abs(angle) <= 3.0 * spread + 1e-12
        if spread > 0.995 * miss or good.sum() < 6:
            break
        best, miss = (rotation, shift), spread
        one, two = first[good], second[good]
        # miss = r2 . [t] R r1; R exp(w): r2 . [t] R [w] r1; t + dt: r2 . [dt] R r1.
        turned = one @ rotation.T
        by_turn = np.cross(one, np.cross(two, shift) @ rotation)
        across = np.linalg.svd(shift[None])[2][1:]
        by_shift = np.cross(turned, two) @ across.T
        jacobian = np.concatenate([by_turn, by_shift], axis=1) / slope[good, None]
        step = np.linalg.lstsq(jacobian, -angle[good], rcond=1e-10)[0]
        rotation = rotation @ exp_so3(step[:3])
        shift = shift + step[3:] @ across
        shift = shift / np.linalg.norm(shift)
    if not np.isfinite(miss):
        return None
    kept = _ahead(*best, first, second).mean()
    return RelativePose(*best, miss) if kept > 0.5 else None
