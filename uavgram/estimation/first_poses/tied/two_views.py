"""How two cameras stand to each other, from the rays to points that both see."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.estimation.first_poses.pose_problem import across_rays
from uavgram.estimation.first_poses.tied.essential import (
    epipolar_angles,
    epipolar_misses,
    essential_matrices,
    poses_of,
)
from uavgram.estimation.solver.batched import Explicit, State, minimise_trimmed
from uavgram.geometry.motion.rotation import exp_so3, hat
from uavgram.model.arrays import Floats, Ints

SAMPLES = 60
"""Samples of five rays; with a tenth of the ties wrong, 59 % of them are free of wrong ones."""

SCORED = 150
"""Points by which the solutions of the samples are told apart."""

MOST = 8
"""Solutions that are refined."""

ALIKE = 0.02
"""Between two refined poses: the same [rad]."""

SIGMA = 1.4826
"""Standard deviation of normal errors, in the median of their sizes."""

TRIMMED = 3.0 * SIGMA
"""Median misses up to which a ray takes part in a pose."""

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
    tried: list[int] = []
    for index in order.tolist():
        turned = np.abs(essential[tried].reshape(-1, 9) @ essential[index].ravel())
        if not (turned / 2.0 > np.cos(2.0 * ALIKE)).any():
            tried.append(index)
        if len(tried) >= MOST:
            break
    found: list[RelativePose] = []
    for pose in _refined(essential[tried], first, second):
        if not any(_same(pose, other) for other in found):
            found.append(pose)
    found.sort(key=lambda pose: pose.miss_rad)
    return [pose for pose in found if pose.miss_rad <= RIVAL * found[0].miss_rad]


def _same(one: RelativePose, other: RelativePose) -> bool:
    turn = np.linalg.norm(one.rotation - other.rotation) / np.sqrt(2.0)
    return bool(turn < ALIKE and np.linalg.norm(one.shift - other.shift) < 5.0 * ALIKE)


def _in_front(essential: Floats, first: Floats, second: Floats) -> tuple[Floats, Floats]:
    """Of the four poses, the one that has most points ahead of both cameras."""
    rotation, shift = poses_of(essential)
    ahead = [_ahead(r, t, first, second).sum() for r, t in zip(rotation, shift, strict=True)]
    best = int(np.argmax(ahead))
    return rotation[best], shift[best]


def _ahead(rotation: Floats, shift: Floats, first: Floats, second: Floats) -> Floats:
    """(n,) whether rays meet ahead of both cameras: a r1 + t = b r2, a and b positive."""
    turned = first @ rotation.T
    normal = np.cross(turned, second)
    return np.asarray(
        (np.einsum("ni,ni->n", np.cross(second, shift), normal) > 0)
        & (np.einsum("ni,ni->n", np.cross(turned, shift), normal) > 0)
    )


def _refined(essential: Floats, first: Floats, second: Floats) -> list[RelativePose]:
    """The poses near matrices (m, 3, 3) that miss least, by the rays that nearly meet."""
    start = tuple(
        np.stack(part)
        for part in zip(*(_in_front(one, first, second) for one in essential), strict=True)
    )

    def angles(state: State) -> Floats:
        return np.abs(epipolar_angles(hat(state[1]) @ state[0], first, second))

    def weighted(weight: Floats) -> Explicit:
        def rows(which: Ints, state: State) -> tuple[Floats, Floats]:
            residual, jacobian = _epipolar_rows(state[0], state[1], first, second)
            return residual * weight[which], jacobian * weight[which][..., None]

        return Explicit(rows, _moved)

    pose, miss = minimise_trimmed(angles, weighted, start, TRIMMED)
    return [
        RelativePose(turn, way, SIGMA * size)
        for turn, way, size in zip(pose[0], pose[1], miss.tolist(), strict=True)
        if _ahead(turn, way, first, second).mean() > 0.5
    ]


def _epipolar_rows(
    rotation: Floats, shift: Floats, first: Floats, second: Floats
) -> tuple[Floats, Floats]:
    """Angles (b, n) between rays, and their derivatives (b, n, 5) by a turn and across the shift.

    miss = r2 . [t] R r1; R exp(w): r2 . [t] R [w] r1; t + dt: r2 . [dt] R r1.
    """
    miss, slope = epipolar_misses(hat(shift) @ rotation, first, second)
    by_turn = np.cross(first, np.cross(second, shift[:, None]) @ rotation)
    turned = first @ rotation.swapaxes(1, 2)
    by_shift = np.cross(turned, second) @ across_rays(shift).swapaxes(1, 2)
    return miss / slope, np.concatenate([by_turn, by_shift], axis=2) / slope[..., None]


def _moved(state: State, step: Floats) -> State:
    rotation, shift = state
    shift = shift + (step[:, None, 3:] @ across_rays(shift))[:, 0]
    return rotation @ exp_so3(step[:, :3]), shift / np.linalg.norm(shift, axis=1, keepdims=True)
