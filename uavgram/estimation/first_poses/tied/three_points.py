"""The pose of a camera from points whose places are known: three rays, and then all of them."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.first_poses.pose_problem import RayRows, across_rays
from uavgram.estimation.solver.batched import State, minimise_trimmed
from uavgram.model.arrays import Floats, Ints

SAMPLES = 60
"""Samples of three points; with a fifth of them wrong, 31 are still expected to be right."""

SCORED = 150
"""Points by which the solutions of the samples are told apart."""

TRIMMED = 4.0
"""Typical misses up to which a ray takes part in the pose."""


def poses_from_three(world: Floats, ray: Floats) -> tuple[Floats, Floats]:
    """Centres (M, 3) and rotations (M, 3, 3), world from camera, of samples of three points.

    Parameters
    ----------
    world
        (S, 3, 3) three points of each sample.
    ray
        (S, 3, 3) unit rays to them, in the camera.

    Notes
    -----
    Grunert 1841, as given by Haralick et al. 1994, "Review and analysis of solutions of the three
    point perspective pose estimation problem", eq. 9; up to four poses of each sample.
    """
    a, b, c = (
        np.sum((world[:, i] - world[:, j]) ** 2, axis=1) for i, j in ((1, 2), (0, 2), (0, 1))
    )
    alpha, beta, gamma = (
        np.sum(ray[:, i] * ray[:, j], axis=1) for i, j in ((1, 2), (0, 2), (0, 1))
    )
    with np.errstate(all="ignore"):
        p, q, r = (a - c) / b, (a + c) / b, c / b
        quartic = np.stack(
            [
                (p - 1) ** 2 - 4 * r * alpha**2,
                4 * (p * (1 - p) * beta - (1 - q) * alpha * gamma + 2 * r * alpha**2 * beta),
                2
                * (
                    p**2
                    - 1
                    + 2 * p**2 * beta**2
                    + 2 * (1 - r) * alpha**2
                    - 4 * q * alpha * beta * gamma
                    + 2 * (1 - a / b) * gamma**2
                ),
                4 * (-p * (1 + p) * beta + 2 * (a / b) * gamma**2 * beta - (1 - q) * alpha * gamma),
                (1 + p) ** 2 - 4 * (a / b) * gamma**2,
            ],
            axis=1,
        )
        usable = np.isfinite(quartic).all(axis=1) & (np.abs(quartic[:, 0]) > 1e-12)
    sample, v = _real_roots(quartic, np.flatnonzero(usable))
    with np.errstate(all="ignore"):
        u = (p[sample] - 1) * v**2 - 2 * p[sample] * beta[sample] * v + 1 + p[sample]
        u = u / (2.0 * (gamma[sample] - v * alpha[sample]))
        nearest = np.sqrt(b[sample] / (1 + v**2 - 2 * v * beta[sample]))
    good = np.isfinite(u) & np.isfinite(nearest) & (u > 0) & (v > 0)
    distance = nearest[good, None] * np.stack([np.ones(good.sum()), u[good], v[good]], axis=1)
    sample = sample[good]
    local = distance[:, :, None] * ray[sample]
    rotation = _triads(world[sample]) @ _triads(local).transpose(0, 2, 1)
    return world[sample, 0] - np.einsum("mij,mj->mi", rotation, local[:, 0]), rotation


def _real_roots(quartic: Floats, rows: Ints) -> tuple[Ints, Floats]:
    """Which polynomial (m,) and the root (m,), of the real roots of some."""
    companion = np.zeros((len(rows), 4, 4))
    companion[:, [1, 2, 3], [0, 1, 2]] = 1.0
    companion[:, 0] = -quartic[rows, 1:] / quartic[rows, :1]
    roots = np.linalg.eigvals(companion)
    real = np.abs(roots.imag) <= 1e-4 * np.abs(roots)
    which, root = np.nonzero(real)
    return rows[which], np.asarray(roots[which, root].real, dtype=np.float64)


def _triads(three: Floats) -> Floats:
    """(M, 3, 3) orthonormal axes, as columns, that three points each span."""
    along = three[:, 1] - three[:, 0]
    along = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    up = np.cross(along, three[:, 2] - three[:, 0])
    up = up / np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-300)
    return np.stack([along, up, np.cross(along, up)], axis=2)


def ray_angles(center: Floats, rotation: Floats, world: Floats, ray: Floats) -> Floats:
    """(M, n) angles between rays and points under M poses [rad]; large behind the camera.

    Parameters
    ----------
    center, rotation
        (M, 3), (M, 3, 3) world from camera.
    world, ray
        (n, 3) points, and unit rays in the camera.
    """
    seen = (world[None] - center[:, None]) @ rotation
    seen /= np.maximum(np.linalg.norm(seen, axis=2, keepdims=True), 1e-300)
    chord = np.linalg.norm(seen - ray[None], axis=2)
    return np.asarray(2.0 * np.arcsin(np.minimum(0.5 * chord, 1.0)))


def resected(
    world: Floats, ray: Floats, rng: np.random.Generator
) -> tuple[Floats, Floats, float] | None:
    """Centre (3,), rotation (3, 3) and typical miss [rad] of the camera that sees points so.

    Half of the points may be wrong (least median of squares).

    Parameters
    ----------
    world, ray
        (n, 3) points, and unit rays to them in the camera; n >= 4.
    rng
        For the samples.
    """
    sample = np.argsort(rng.random((SAMPLES, len(world))), axis=1)[:, :3]
    center, rotation = poses_from_three(world[sample], ray[sample])
    if not len(center):
        return None
    some = rng.permutation(len(world))[:SCORED]
    angle = np.median(ray_angles(center, rotation, world[some], ray[some]), axis=1)
    best = int(np.argmin(angle))
    across = across_rays(ray)

    def angles(state: State) -> Floats:
        return ray_angles(state[0], state[1], world, ray)

    def weighted(weight: Floats) -> RayRows:
        return RayRows(ray[None], across * weight[..., None, None], world[None])

    pose, miss = minimise_trimmed(angles, weighted, (center[[best]], rotation[[best]]), TRIMMED)
    return pose[0][0], pose[1][0], float(miss[0])
