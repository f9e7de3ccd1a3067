"""Poses of two views of the same points: from nearly one place, or from essential matrices.

Two views from nearly one place have no parallax, so no pose follows from them alone: but if one of
them has a pose, the other has the same centre, and a few shared points determine its rotation.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from uavgram.estimation.first_poses.resection import compute_across_axes
from uavgram.estimation.first_poses.tied.bundle import TiedRays, compute_tied_rays
from uavgram.estimation.solver.batched import ExplicitProblem, State, minimise_trimmed
from uavgram.geometry.motion.rotation import exp_so3, hat, nearest_rotation
from uavgram.model.arrays import Floats, Ints
from uavgram.model.survey import Survey


def compute_essential_matrices(first: Floats, second: Floats) -> Floats:
    """Compute matrices E with second . E first = 0 from samples of five rays each.

    Parameters
    ----------
    first, second
        (S, 5, 3) rays to the same points from the two cameras, forward (z > 0).

    Returns
    -------
    (M, 3, 3)
        Of all samples together, up to ten of each; two singular values are 1, the third 0.

    Notes
    -----
    Nister 2004, "An efficient solution to the five-point relative pose problem". It holds for
    points in a plane too.
    """
    pairs = zip(_project_rays(first), _project_rays(second), strict=True)
    found = [cv2.findEssentialMat(one, other, np.eye(3))[0] for one, other in pairs]
    # A sample has no solution, or several one below the other.
    stacked = [np.zeros((0, 3)), *(one for one in found if one is not None)]
    essential = np.concatenate(stacked).reshape(-1, 3, 3)
    essential = essential[np.isfinite(essential).all(axis=(1, 2))]
    size = np.linalg.norm(essential, axis=(1, 2), keepdims=True)
    return np.asarray(essential / size * np.sqrt(2.0))


def solve_three_points(world: Floats, ray: Floats) -> tuple[Floats, Floats]:
    """Compute centres (M, 3) and rotations (M, 3, 3), world from camera, from three points each.

    Up to four poses of each sample.

    Parameters
    ----------
    world
        (S, 3, 3) three points of each sample.
    ray
        (S, 3, 3) rays to them, in the camera, forward (z > 0).
    """
    turns, shifts = [], []
    for points, image in zip(world, _project_rays(ray), strict=True):
        _, turn, shift = cv2.solveP3P(points, image, np.eye(3), None, cv2.SOLVEPNP_P3P)
        turns += [cv2.Rodrigues(one)[0] for one in turn]
        shifts += list(shift)
    rotation = np.array(turns, dtype=np.float64).reshape(-1, 3, 3).swapaxes(1, 2)
    center = (-rotation @ np.array(shifts, dtype=np.float64).reshape(-1, 3, 1))[..., 0]
    solved = np.isfinite(center).all(axis=1)
    return center[solved], rotation[solved]


def _project_rays(ray: Floats) -> Floats:
    """Return (..., 2) x and y of rays at z = 1."""
    return np.ascontiguousarray(ray[..., :2] / ray[..., 2:])


MIN_POINTS = 10
"""Smallest number of points that two frames must share, and that must fit the rotation between
them."""

MAX_TYPICAL_RAD = 0.01
"""Largest typical angle between rays after the rotation [rad]: a hundredth of the distance
flown."""

MAX_RELATIVE_RESIDUAL = 3.0
"""Residual in units of the typical one up to which a ray takes part in the rotation."""

MAX_ROUNDS = 10


def add_turned_frames(survey: Survey, center: Floats, rotation: Floats) -> tuple[Floats, Floats]:
    """Add poses of frames that only turned from one that has a pose: (F, 3), (F, 3, 3).

    Parameters
    ----------
    survey
        Survey with the shared points.
    center, rotation
        World from camera; NaN for frames without a pose.
    """
    missing = np.isnan(center[:, 0])
    if not survey.ties.points + survey.matches.points or missing.all() or not missing.any():
        return center, rotation
    return transfer_poses(center, rotation, compute_tied_rays(survey)[0])


def transfer_poses(center: Floats, rotation: Floats, sightings: TiedRays) -> tuple[Floats, Floats]:
    """Transfer poses from frame to frame, each time between the two that share most points.

    Parameters
    ----------
    center, rotation
        (F, 3), (F, 3, 3) world from camera; NaN for frames without a pose.
    sightings
        Shared points.
    """
    center, rotation = center.copy(), rotation.copy()
    shared = sightings.count_shared_points()
    placed = np.isfinite(center[:, 0])
    tried = np.zeros_like(shared, dtype=np.bool_)
    while True:
        count = np.where(placed[:, None] & ~placed[None] & ~tried, shared, 0)
        known, new = np.unravel_index(int(np.argmax(count)), count.shape)
        if count[known, new] < MIN_POINTS:
            return center, rotation
        tried[known, new] = True
        one, other = sightings.find_shared_rows(int(new), int(known))
        turn = estimate_rotation(sightings.ray[one], sightings.ray[other])
        if turn is not None:
            center[new], rotation[new] = center[known], rotation[known] @ turn
            placed[new] = True


def estimate_rotation(first: Floats, second: Floats) -> Floats | None:
    """Compute the rotation (3, 3) of most rays of a camera onto those of a second; None if bad.

    Parameters
    ----------
    first, second
        (n, 3) unit rays to the same points.
    """
    turn = find_best_turn(first, second)
    enough = turn.agree >= max(MIN_POINTS, len(first) // 2)
    return turn.rotation if enough and turn.miss_rad <= MAX_TYPICAL_RAD else None


class Turn(NamedTuple):
    """Rotation between two cameras: rays of the second are about rotation @ those of the first.

    Attributes
    ----------
    rotation
        (3, 3).
    miss_rad
        Typical remaining angle between the rays: the parallax.
    agree
        Number of rays that do not miss by much more.
    """

    rotation: Floats
    miss_rad: float
    agree: int


def find_best_turn(first: Floats, second: Floats) -> Turn:
    """Estimate the best rotation between rays; rays with large residuals are left out.

    Parameters
    ----------
    first, second
        (n, 3) unit rays to the same points, n >= 1.
    """
    good = np.ones(len(first), dtype=np.bool_)
    for _ in range(MAX_ROUNDS):
        rotation = nearest_rotation(second[good].T @ first[good])
        miss = np.linalg.norm(second - first @ rotation.T, axis=1)
        typical = float(np.median(miss))
        near = miss <= MAX_RELATIVE_RESIDUAL * typical + 1e-12
        if (near == good).all():
            break
        good = near
    return Turn(rotation, typical, int(good.sum()))


def decompose_essential(essential: Floats) -> tuple[Floats, Floats]:
    """Compute four poses of the second camera (4, 3, 3), (4, 3): x2 = R x1 + t, t of length one."""
    left, _, right = np.linalg.svd(essential)
    left, right = left * np.linalg.det(left), right * np.linalg.det(right)
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    rotation = np.stack([left @ quarter @ right, left @ quarter.T @ right])
    shift = left[:, 2]
    return np.concatenate([rotation, rotation]), np.stack([shift, shift, -shift, -shift])


def compute_epipolar_angles(essential: Floats, first: Floats, second: Floats) -> Floats:
    """Compute (M, n) angles between rays (n, 3) under M matrices [rad], to first order.

    Sampson's distance (Hartley and Zisserman 2004, sec. 11.4.3) on the sphere instead of the image.

    Parameters
    ----------
    essential
        (M, 3, 3).
    first, second
        (n, 3) unit rays to the same points from the two cameras.
    """
    miss, slope = compute_epipolar_misclosures(essential, first, second)
    return np.asarray(miss / slope)


def compute_epipolar_misclosures(
    essential: Floats, first: Floats, second: Floats
) -> tuple[Floats, Floats]:
    """Compute (M, n) second . E first, and its change with the rays, per rad.

    Parameters
    ----------
    essential
        (M, 3, 3).
    first, second
        (n, 3) unit rays to the same points from the two cameras.
    """
    towards = first @ essential.transpose(0, 2, 1)
    back = second @ essential
    miss = np.einsum("mni,ni->mn", towards, second)
    squared = np.sum(towards**2, axis=2) + np.sum(back**2, axis=2) - 2.0 * miss**2
    return miss, np.sqrt(np.maximum(squared, 1e-18))


SAMPLE_COUNT = 60
"""Number of samples of five rays; with a tenth of the ties wrong, 59 % of them are free of wrong
ones."""

SCORED_COUNT = 150
"""Number of points by which the solutions of the samples are ranked."""

MAX_REFINED = 8
"""Number of solutions that are refined."""

SAME_POSE_RAD = 0.02
"""Angle between two refined poses up to which they are the same [rad]."""

SIGMA_OVER_MEDIAN = 1.4826
"""Standard deviation of normal errors over the median of their sizes."""

TRIMMING_FACTOR = 3.0 * SIGMA_OVER_MEDIAN
"""Residual in units of the median up to which a ray takes part in a pose."""

RIVAL_RESIDUAL_RATIO = 3.0
"""Residual in units of the best pose's up to which another pose is kept: points in a plane allow
two."""


class RelativePose(NamedTuple):
    """Pose x2 = rotation x1 + shift, |shift| = 1, and typical angle between the rays [rad]."""

    rotation: Floats
    shift: Floats
    miss_rad: float


def estimate_relative_poses(
    first: Floats, second: Floats, rng: np.random.Generator
) -> list[RelativePose]:
    """Estimate poses of the second camera from rays (n, 3) to the same points, best first.

    All poses are returned that no other one exceeds by far: if all points are nearly in a plane,
    two may explain them alike. Half of the points may be wrong (least median of squares, Rousseeuw
    1984).

    Parameters
    ----------
    first, second
        (n, 3) unit rays from the two cameras.
    rng
        Random numbers for the samples.
    """
    count = len(first)
    sample = np.argsort(rng.random((SAMPLE_COUNT, count)), axis=1)[:, :5]
    essential = compute_essential_matrices(first[sample], second[sample])
    some = rng.permutation(count)[:SCORED_COUNT]
    if not len(essential):
        return []
    angles = compute_epipolar_angles(essential, first[some], second[some])
    order = np.argsort(np.median(np.abs(angles), axis=1))
    tried: list[int] = []
    for index in order.tolist():
        # Skip matrices of nearly the same direction as one already chosen.
        turned = np.abs(essential[tried].reshape(-1, 9) @ essential[index].ravel())
        if not (turned / 2.0 > np.cos(2.0 * SAME_POSE_RAD)).any():
            tried.append(index)
        if len(tried) >= MAX_REFINED:
            break
    found: list[RelativePose] = []
    for pose in _refine(essential[tried], first, second):
        if not any(_is_same(pose, other) for other in found):
            found.append(pose)
    found.sort(key=lambda pose: pose.miss_rad)
    return [pose for pose in found if pose.miss_rad <= RIVAL_RESIDUAL_RATIO * found[0].miss_rad]


def _is_same(one: RelativePose, other: RelativePose) -> bool:
    turn = np.linalg.norm(one.rotation - other.rotation) / np.sqrt(2.0)
    return bool(
        turn < SAME_POSE_RAD and np.linalg.norm(one.shift - other.shift) < 5.0 * SAME_POSE_RAD
    )


def _choose_in_front(essential: Floats, first: Floats, second: Floats) -> tuple[Floats, Floats]:
    """Choose the pose of the four that has most points ahead of both cameras."""
    rotation, shift = decompose_essential(essential)
    ahead = [_are_ahead(r, t, first, second).sum() for r, t in zip(rotation, shift, strict=True)]
    best = int(np.argmax(ahead))
    return rotation[best], shift[best]


def _are_ahead(rotation: Floats, shift: Floats, first: Floats, second: Floats) -> Floats:
    """Mark the rays (n,) that meet ahead of both cameras: a r1 + t = b r2, a and b positive."""
    turned = first @ rotation.T
    normal = np.cross(turned, second)
    return np.asarray(
        (np.einsum("ni,ni->n", np.cross(second, shift), normal) > 0)
        & (np.einsum("ni,ni->n", np.cross(turned, shift), normal) > 0)
    )


def _refine(essential: Floats, first: Floats, second: Floats) -> list[RelativePose]:
    """Refine poses near matrices (m, 3, 3) by the rays that nearly meet."""
    start = tuple(
        np.stack(part)
        for part in zip(*(_choose_in_front(one, first, second) for one in essential), strict=True)
    )

    def angles(state: State) -> Floats:
        return np.abs(compute_epipolar_angles(hat(state[1]) @ state[0], first, second))

    def weighted(weight: Floats) -> ExplicitProblem:
        def rows(which: Ints, state: State) -> tuple[Floats, Floats]:
            residual, jacobian = _epipolar_rows(state[0], state[1], first, second)
            return residual * weight[which], jacobian * weight[which][..., None]

        return ExplicitProblem(rows, _apply_step)

    pose, miss = minimise_trimmed(angles, weighted, start, TRIMMING_FACTOR)
    return [
        RelativePose(turn, way, SIGMA_OVER_MEDIAN * size)
        for turn, way, size in zip(pose[0], pose[1], miss.tolist(), strict=True)
        if _are_ahead(turn, way, first, second).mean() > 0.5
    ]


def _epipolar_rows(
    rotation: Floats, shift: Floats, first: Floats, second: Floats
) -> tuple[Floats, Floats]:
    """Compute angles (b, n) between rays, and derivatives (b, n, 5) by turn and shift direction.

    miss = r2 . [t] R r1; R exp(w): r2 . [t] R [w] r1; t + dt: r2 . [dt] R r1.
    """
    miss, slope = compute_epipolar_misclosures(hat(shift) @ rotation, first, second)
    by_turn = np.cross(first, np.cross(second, shift[:, None]) @ rotation)
    turned = first @ rotation.swapaxes(1, 2)
    by_shift = np.cross(turned, second) @ compute_across_axes(shift).swapaxes(1, 2)
    return miss / slope, np.concatenate([by_turn, by_shift], axis=2) / slope[..., None]


def _apply_step(state: State, step: Floats) -> State:
    rotation, shift = state
    shift = shift + (step[:, None, 3:] @ compute_across_axes(shift))[:, 0]
    return rotation @ exp_so3(step[:, :3]), shift / np.linalg.norm(shift, axis=1, keepdims=True)
