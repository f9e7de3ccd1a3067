"""First poses of frames from the lengths of lines on the ground, without any other knowledge.

Three lengths have several exact solutions in about half of all scenes, a triangle nearly always;
so the hemisphere of plane normals is searched, all candidates of all frames are refined together,
and every distinct minimum is kept.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from uavgram.geometry.ground.plane_pose import by_plane, lengths_on_plane, reach_of
from uavgram.model.arrays import Bools, Floats, Ints

TILT_STEP_DEG = 7.5
MAX_TILT_DEG = 85.0
NEIGHBOURS = 8
"""Of a normal of the grid: those that a minimum has to undercut."""

FEW = 4
"""Lines up to which every normal of the grid is a start."""

LOWEST = 40
"""Normals of lowest cost that are starts beside the local minima over the grid."""

ITERATIONS = 60
AT_REST = 1e-9
"""Relative step below which a candidate stands still."""

PLAUSIBLE = 1e-4
"""Probability below which a minimum no longer counts as an explanation of the lengths."""

BLOCK = 200_000
"""Lines times candidates at a time: the temporaries stay in the processor's cache."""


class PlaneCandidate(NamedTuple):
    """A local minimum: the plane m (3,), and its weighted sum of squared residuals."""

    plane: Floats
    cost: float


class _Candidates(NamedTuple):
    """Planes (C, 3), the scene (C,) of each, its cost (C,), and its normal matrix (C, 3, 3)."""

    plane: Floats
    scene: Ints
    cost: Floats
    information: Floats


@cache
def normal_grid() -> Floats:
    """Unit vectors (S, 3) towards the ground, about evenly spread over the visible hemisphere."""
    normals = [np.array([[0.0, 0.0, 1.0]])]
    for tilt in np.deg2rad(np.arange(TILT_STEP_DEG, MAX_TILT_DEG + 1e-9, TILT_STEP_DEG)):
        count = max(6, round(2 * np.pi * np.sin(tilt) / np.deg2rad(TILT_STEP_DEG)))
        azimuth = 2 * np.pi * np.arange(count) / count
        ring = [np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth)]
        normals.append(np.stack([*ring, np.full(count, np.cos(tilt))], axis=-1))
    grid = np.concatenate(normals)
    grid.flags.writeable = False
    return grid


@cache
def _neighbours() -> Ints:
    """(NEIGHBOURS, S) nearest others of each normal of the grid."""
    near = np.argsort(-normal_grid() @ normal_grid().T, axis=1, kind="stable")
    return np.ascontiguousarray(near[:, 1 : NEIGHBOURS + 1].T)


def search_planes(
    start_ray: Floats, end_ray: Floats, length_m: Floats, sigma_m: Floats
) -> list[tuple[PlaneCandidate, ...]]:
    """All distinct planes that explain the lengths of each of many frames, best first.

    Parameters
    ----------
    start_ray, end_ray
        (B, L, 3) undistorted rays of the lines' ends, z = 1, camera frame.
    length_m, sigma_m
        (B, L) lengths, and the sigma of each with that of its two picks; an infinite sigma says
        that a frame has no such line (its rays and length are any numbers).

    Returns
    -------
    list of tuple of PlaneCandidate
        Per frame: the best one always, and every other minimum that the lengths allow; empty where
        no plane of the hemisphere lies in front of all rays, or fewer than three lines are there.
    """
    weight = 1.0 / sigma_m
    there = weight > 0
    count = there.sum(axis=1)
    # A line that is not there becomes a copy of the first one that is, without weight.
    stand_in = np.where(there, np.arange(there.shape[1]), there.argmax(axis=1)[:, None])
    take = stand_in[..., None]
    start_ray = np.take_along_axis(start_ray, take, axis=1)
    end_ray = np.take_along_axis(end_ray, take, axis=1)
    length_m = np.take_along_axis(length_m, stand_in, axis=1)
    found: list[tuple[PlaneCandidate, ...]] = []
    step = max(1, BLOCK // (len(normal_grid()) * max(1, there.shape[1])))
    for first in range(0, len(length_m), step):
        part = slice(first, first + step)
        ends = _ends(start_ray[part], end_ray[part])
        observed = length_m[part] * weight[part], weight[part]
        starts = _starts(ends, observed, count[part])
        minima = _refine(starts, ends, observed)
        found += _distinct(minima, count[part])
    return found


def _ends(start_ray: Floats, end_ray: Floats) -> Floats:
    """(3, 2, B, L) of rays (B, L, 3)."""
    return np.ascontiguousarray(np.stack([start_ray, end_ray]).transpose(3, 0, 1, 2))


def _starts(ends: Floats, observed: tuple[Floats, Floats], count: Ints) -> _Candidates:
    """First planes: every normal of the grid for few lines, the promising ones for more.

    The height over a normal follows in closed form: lengths are proportional to it. With it, the
    cost over the hemisphere has the same minima as that over all planes: where the grid has a
    local minimum, a start. Few lines may have several minima within one step of the grid; then
    it is the direction from which a start comes that leads to the one or the other.
    """
    normal = normal_grid()
    unit = lengths_on_plane(np.ascontiguousarray(normal.T)[:, None, :, None], ends[:, :, :, None])
    wanted, weight = observed[0][:, None], observed[1][:, None]
    scaled = unit.length * weight
    square, mixed = np.sum(scaled * scaled, axis=-1), np.sum(scaled * wanted, axis=-1)
    height = mixed / square
    cost = np.sum(wanted * wanted, axis=-1) - mixed * height
    usable = np.isfinite(cost) & (count >= 3)[:, None]
    cost = np.where(usable, cost, np.inf)
    lowest: Bools = np.ones(cost.shape, bool)
    for near in _neighbours():
        lowest &= cost <= cost[:, near]
    lowest |= cost <= np.partition(cost, LOWEST, axis=1)[:, [LOWEST]]
    scene, place = np.nonzero(usable & (lowest | (count <= FEW)[:, None]))
    plane = normal[place] / height[scene, place, None]
    return _Candidates(plane, scene, cost[scene, place], np.zeros((len(scene), 3, 3)))


def _evaluate(
    plane: Floats, ends: Floats, observed: tuple[Floats, Floats]
) -> tuple[Floats, Floats, Floats]:
    """Cost (C,), gradient (C, 3), normal matrix (C, 3, 3) of planes (C, 3), ends (3, 2, C, L)."""
    wanted, weight = observed
    lengths = lengths_on_plane(np.ascontiguousarray(plane.T)[:, :, None], ends)
    residual = lengths.length * weight - wanted
    jacobian = np.moveaxis(by_plane(lengths, reach_of(lengths)) * weight, 0, 1)
    cost = np.sum(residual * residual, axis=1)
    gradient = np.matmul(jacobian, residual[..., None])[..., 0]
    return (
        np.where(np.isfinite(cost), cost, np.inf),
        gradient,
        np.matmul(jacobian, np.swapaxes(jacobian, 1, 2)),
    )


def _refine(starts: _Candidates, ends: Floats, observed: tuple[Floats, Floats]) -> _Candidates:
    """Levenberg-Marquardt on all candidates together; those at rest drop out."""
    plane, scene = starts.plane.copy(), starts.scene
    own_ends = ends[:, :, scene]
    own_observed = observed[0][scene], observed[1][scene]
    cost, gradient, normal = _evaluate(plane, own_ends, own_observed)
    damping = np.full(len(plane), 1e-3)
    active = np.flatnonzero(np.isfinite(cost))
    eye = np.eye(3)
    for _ in range(ITERATIONS):
        if not len(active):
            break
        diagonal = np.einsum("sii->si", normal[active])
        # The trace keeps a candidate solvable whose lengths are blind to a direction of m.
        ridge = damping[active, None] * diagonal + 1e-12 * diagonal.sum(axis=1, keepdims=True)
        damped = normal[active] + eye * ridge[:, None, :]
        step = -np.linalg.solve(damped, gradient[active][..., None])[..., 0]
        trial = plane[active] + step
        trial_observed = own_observed[0][active], own_observed[1][active]
        new = _evaluate(trial, own_ends[:, :, active], trial_observed)
        better = new[0] < cost[active]
        rows = active[better]
        small = np.abs(step).max(axis=1) <= AT_REST * np.abs(plane[active]).max(axis=1)
        plane[rows] = trial[better]
        cost[rows], gradient[rows], normal[rows] = (part[better] for part in new)
        damping[active] = np.where(better, damping[active] / 8, damping[active] * 5)
        # A step so small that it makes nothing better is rounding: the candidate is at rest.
        active = active[~small & (damping[active] < 1e10)]
    return _Candidates(plane, scene, cost, normal)


def _distinct(minima: _Candidates, count: Ints) -> list[tuple[PlaneCandidate, ...]]:
    """Per scene: minima that differ by more than one sigma, best first, if the lengths allow."""
    order = np.lexsort((minima.cost, minima.scene))
    bounds = np.searchsorted(minima.scene[order], np.arange(len(count) + 1))
    limit = np.asarray(chdtri(np.maximum(count - 3, 1), PLAUSIBLE))
    found = []
    for scene in range(len(count)):
        rows = order[bounds[scene] : bounds[scene + 1]]
        rows = rows[np.isfinite(minima.cost[rows])]
        if len(rows):
            rows = rows[minima.cost[rows] <= minima.cost[rows[0]] + limit[scene]]
        found.append(tuple(_apart(minima, rows)))
    return found


def _apart(minima: _Candidates, rows: Ints) -> list[PlaneCandidate]:
    """Of candidates in the order of their costs, those that no better one stands within a sigma."""
    kept: list[PlaneCandidate] = []
    while len(rows):
        best = rows[0]
        kept.append(PlaneCandidate(minima.plane[best], float(minima.cost[best])))
        apart = minima.plane[rows] - minima.plane[best]
        distance = np.einsum("ki,ij,kj->k", apart, minima.information[best], apart)
        rows = rows[distance > 1.0]
    return kept
