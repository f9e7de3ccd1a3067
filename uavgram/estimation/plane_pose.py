"""First pose of a frame from the lengths of lines on the ground, without any other knowledge.

Three lengths have several exact solutions in about half of all scenes, a triangle nearly always;
so the hemisphere of plane normals is searched, all candidates are refined in one batch, and every
distinct minimum is kept.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

from uavgram.geometry.plane_pose import lengths_on_plane
from uavgram.model.arrays import Floats

TILT_STEP_DEG = 7.5
MAX_TILT_DEG = 85.0
ITERATIONS = 40
PLAUSIBLE = 1e-4
"""Probability below which a minimum no longer counts as an explanation of the lengths."""


class PlaneCandidate(NamedTuple):
    """A local minimum: the plane m (3,), and its weighted sum of squared residuals."""

    plane: Floats
    cost: float


def normal_grid() -> Floats:
    """Unit vectors (S, 3) towards the ground, about evenly spread over the visible hemisphere."""
    normals = [np.array([[0.0, 0.0, 1.0]])]
    for tilt in np.deg2rad(np.arange(TILT_STEP_DEG, MAX_TILT_DEG + 1e-9, TILT_STEP_DEG)):
        count = max(6, round(2 * np.pi * np.sin(tilt) / np.deg2rad(TILT_STEP_DEG)))
        azimuth = 2 * np.pi * np.arange(count) / count
        ring = [np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth)]
        normals.append(np.stack([*ring, np.full(count, np.cos(tilt))], axis=-1))
    return np.concatenate(normals)


def search_plane(
    start_ray: Floats, end_ray: Floats, length_m: Floats, sigma_m: Floats
) -> tuple[PlaneCandidate, ...]:
    """All distinct planes that explain the lengths, best first.

    Parameters
    ----------
    start_ray, end_ray
        (L, 3) undistorted rays of the lines' ends, z = 1, camera frame; L >= 3.
    length_m, sigma_m
        (L,) lengths, and the sigma of each with that of its two picks.

    Returns
    -------
    tuple of PlaneCandidate
        The best one always, and every other minimum that the lengths allow; empty if no plane of
        the hemisphere lies in front of all rays.
    """
    normals = normal_grid()
    unit_length, _ = lengths_on_plane(normals, start_ray, end_ray)
    usable = np.isfinite(unit_length).all(axis=1)
    normals, unit_length = normals[usable], unit_length[usable]
    if not len(normals):
        return ()
    # Closed-form scale of each normal: height times unit lengths, geometric mean of the ratios.
    height = np.exp(np.mean(np.log(length_m / unit_length), axis=1))
    planes = normals / height[:, None]
    planes, cost, normal = _refine(planes, start_ray, end_ray, length_m, sigma_m)
    return _distinct(planes, cost, normal, len(length_m) - 3)


def _refine(
    planes: Floats, start_ray: Floats, end_ray: Floats, length_m: Floats, sigma_m: Floats
) -> tuple[Floats, Floats, Floats]:
    """Levenberg-Marquardt on all candidates in one batch: planes, costs, normal matrices."""

    def evaluate(candidates: Floats) -> tuple[Floats, Floats, Floats]:
        length, jacobian = lengths_on_plane(candidates, start_ray, end_ray)
        residual = (length - length_m) / sigma_m
        cost = np.where(np.isfinite(residual).all(axis=1), np.sum(residual**2, axis=1), np.inf)
        return residual, jacobian / sigma_m[:, None], cost

    damping = np.full(len(planes), 1e-3)
    residual, jacobian, cost = evaluate(planes)
    for _ in range(ITERATIONS):
        normal = np.einsum("sli,slj->sij", jacobian, jacobian)
        diagonal = np.einsum("sii->si", normal)
        # The trace keeps a candidate solvable whose lengths are blind to a direction of m.
        ridge = damping[:, None] * diagonal + 1e-12 * diagonal.sum(axis=1, keepdims=True)
        damped = normal + np.eye(3) * ridge[:, None, :]
        gradient = np.einsum("sli,sl->si", jacobian, residual)
        step = -np.linalg.solve(damped, gradient[..., None])[..., 0]
        new_residual, new_jacobian, new_cost = evaluate(planes + step)
        better = new_cost < cost
        planes = np.where(better[:, None], planes + step, planes)
        residual = np.where(better[:, None], new_residual, residual)
        jacobian = np.where(better[:, None, None], new_jacobian, jacobian)
        cost = np.where(better, new_cost, cost)
        damping = np.where(better, damping / 5, np.minimum(damping * 5, 1e8))
    return planes, cost, np.einsum("sli,slj->sij", jacobian, jacobian)


def _distinct(
    planes: Floats, cost: Floats, normal: Floats, degrees: int
) -> tuple[PlaneCandidate, ...]:
    """Minima that differ by more than one sigma, best first, as far as the lengths allow them."""
    order = np.argsort(cost, kind="stable")
    limit = cost[order[0]] + chi2.ppf(1 - PLAUSIBLE, max(degrees, 1))
    kept: list[int] = []
    for index in order[cost[order] <= limit]:
        apart = planes[index] - planes[kept]
        if np.all(np.einsum("ki,kij,kj->k", apart, normal[kept], apart) > 1.0):
            kept.append(int(index))
    return tuple(PlaneCandidate(planes[i], float(cost[i])) for i in kept)
