"""First poses of single frames from whatever is known of points on the ground, without a log.

Lengths, angles, parallels and equal lengths together: three numbers of a pose over the plane (two
of its tilt, one of its height) need three of them that say something different, one in metres. As
with lengths alone (`pose_search`) there may be several poses: the hemisphere of plane normals is
searched, and every distinct minimum is kept.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from uavgram.estimation.first_poses.plane_things import (
    SCALED,
    PlaneRows,
    PlaneThing,
    fitting_heights,
    row_count,
    rows_on_planes,
)
from uavgram.estimation.first_poses.pose_search import PLAUSIBLE, normal_grid
from uavgram.model.arrays import Bools, Floats, Ints

ITERATIONS = 30
AT_REST = 1e-6
"""Step, as a share of the plane's size, below which a candidate stands still."""

SETTLED = 1e-4
"""What another step may still take off the cost of a candidate at rest."""

UNKNOWN = 1.0
"""Sigma of a plane as a share of its size, from which on its numbers mean nothing."""

THINNED = (5, 10, 20)
"""Iterations after which, of candidates within a hundredth of each other, only the best goes on."""


class KnownPlanes(NamedTuple):
    """Planes that explain what a frame's known things say, best first.

    Attributes
    ----------
    plane
        (n, 3) m = normal / height in the camera frame [1/m].
    covariance
        (n, 3, 3) from things and picks; the lens counts as exact.
    cost
        (n,) weighted sum of squared misses; degrees of freedom: number of rows less three.
    """

    plane: Floats
    covariance: Floats
    cost: Floats


NOTHING = KnownPlanes(np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros(0))


def search_known(ray: Floats, ray_sigma: Floats, things: tuple[PlaneThing, ...]) -> KnownPlanes:
    """All distinct planes that known things allow a frame.

    Parameters
    ----------
    ray
        (E, 3) undistorted rays of its picks, z = 1.
    ray_sigma
        (E,) of their x and y: those of the pixels over the focal length.
    things
        What is known of its points.

    Returns
    -------
    KnownPlanes
        None at all where the things do not determine one: fewer than three rows, none in metres,
        or all of them about the same.
    """
    rows = sum(row_count(one.kind, len(one.pick)) for one in things)
    if rows < 3 or not any(one.kind in SCALED for one in things):
        return NOTHING
    used = sorted({k for one in things for k in one.pick})
    at = {pick: k for k, pick in enumerate(used)}
    things = tuple(one._replace(pick=tuple(at[k] for k in one.pick)) for one in things)
    return _found(ray[used].tobytes(), ray_sigma[used].tobytes(), things)


@lru_cache(maxsize=256)
def _found(rays: bytes, sigmas: bytes, things: tuple[PlaneThing, ...]) -> KnownPlanes:
    """The planes; once for a frame, though an adjustment begins many times."""
    ray, ray_sigma = np.frombuffer(rays).reshape(-1, 3), np.frombuffer(sigmas)
    rows = sum(row_count(one.kind, len(one.pick)) for one in things)
    normal = normal_grid()
    height = fitting_heights(normal, ray, ray_sigma, things)
    start = (normal / height[:, None])[np.isfinite(height)]
    plane = _descended(start, ray, ray_sigma, things)
    information, gradient, cost = _normal_equations(rows_on_planes(plane, ray, ray_sigma, things))
    covariance, determined = _covariances(plane, information, cost)
    gain = np.einsum("ci,cij,cj->c", gradient, covariance, gradient)
    resting = np.flatnonzero(gain < SETTLED)
    # Where two solutions merge nothing determines the one that is left; it may be the true one.
    order = resting[np.lexsort((cost[resting], ~determined[resting]))]
    if not determined[order[:1]].any():
        return NOTHING
    limit = cost[order[0]] + float(chdtri(max(rows - 3, 1), PLAUSIBLE))
    kept: list[int] = []
    for one in order[cost[order] <= limit]:
        apart = plane[kept] - plane[one]
        if not (np.einsum("ki,ij,kj->k", apart, information[one], apart) < 1.0).any():
            kept.append(int(one))
    found = KnownPlanes(plane[kept], covariance[kept], cost[kept])
    for column in found:
        column.flags.writeable = False
    return found


def _descended(
    plane: Floats, ray: Floats, ray_sigma: Floats, things: tuple[PlaneThing, ...]
) -> Floats:
    """Planes (C, 3) at rest, by Levenberg-Marquardt on all together; sigmas follow the planes."""
    plane = plane.copy()
    damping = np.full(len(plane), 1e-3)
    rows = rows_on_planes(plane, ray, ray_sigma, things)
    active = np.flatnonzero(np.isfinite(rows.value).all(axis=1))
    rows = rows.take(active)
    for iteration in range(ITERATIONS):
        if iteration in THINNED:
            best = _best_of_near(plane[active], np.sum((rows.value / rows.sigma) ** 2, axis=1))
            active, rows = active[best], rows.take(best)
        if not len(active):
            break
        information, gradient, cost = _normal_equations(rows)
        diagonal = np.einsum("cii->ci", information)
        ridge = damping[active, None] * diagonal + 1e-12 * diagonal.sum(axis=1, keepdims=True)
        step = -np.linalg.solve(information + np.eye(3) * ridge[:, None], gradient[..., None])
        trial = plane[active] + step[..., 0]
        there = rows_on_planes(trial, ray, ray_sigma, things)
        better = np.sum((there.value / rows.sigma) ** 2, axis=1) < cost  # NaN is not
        plane[active[better]] = trial[better]
        rows = PlaneRows(
            *(
                np.where(better.reshape(-1, *(1,) * (new.ndim - 1)), new, old)
                for new, old in zip(there, rows, strict=True)
            )
        )
        damping[active] = np.where(better, damping[active] / 8, damping[active] * 5)
        moved = np.abs(step[..., 0]).max(axis=1) > AT_REST * np.abs(plane[active]).max(axis=1)
        going = np.flatnonzero(moved & (damping[active] < 1e10))
        active, rows = active[going], rows.take(going)
    return plane


def _best_of_near(plane: Floats, cost: Floats) -> Ints:
    """Of planes within a hundredth of each other, that of least cost; indices."""
    size = np.linalg.norm(plane, axis=1)
    cell = np.round(np.column_stack([plane / size[:, None], np.log(size)]) / 0.01)
    order = np.argsort(cost, kind="stable")
    _, first = np.unique(cell[order], axis=0, return_index=True)
    return np.sort(order[first])


def _normal_equations(rows: PlaneRows) -> tuple[Floats, Floats, Floats]:
    """(C, 3, 3) normal matrices, (C, 3) gradients, (C,) costs."""
    value, jacobian = rows.value / rows.sigma, rows.by_plane / rows.sigma[..., None]
    turned = jacobian.swapaxes(1, 2)
    return turned @ jacobian, (turned @ value[..., None])[..., 0], np.sum(value**2, axis=1)


def _covariances(plane: Floats, information: Floats, cost: Floats) -> tuple[Floats, Bools]:
    """(C, 3, 3) inverses, no sigma above `UNKNOWN`, and (C,) whether none had been.

    Parameters
    ----------
    plane, information, cost
        (C, 3), (C, 3, 3), (C,): where the cost is NaN nothing is known.
    """
    size = np.linalg.norm(plane, axis=1)
    relative = information * (size**2)[:, None, None]
    relative[~np.isfinite(cost)] = 0.0
    value, vector = np.linalg.eigh(relative)
    turned = vector / np.maximum(value, UNKNOWN**-2)[:, None]
    return turned @ vector.swapaxes(1, 2) * (size**2)[:, None, None], value[:, 0] > UNKNOWN**-2
