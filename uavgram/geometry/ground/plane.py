"""Ground surface: where rays meet its plane, its relief, and the plane of most points.

The plane is ``up = plane[0] + plane[1] (east - pivot[0]) + plane[2] (north - pivot[1])``: its
height at the pivot [m] and its slopes to the east and to the north; a point may stand a known
height above it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from uavgram.model.arrays import Floats


class _Meeting(NamedTuple):
    point: Floats
    distance: Floats  # along the ray, in units of the ray
    descent: Floats  # ray . normal, negative


def intersect_ground(
    center_world: Floats,
    ray_world: Floats,
    plane: Floats,
    pivot: Floats,
    height_above: ArrayLike = 0.0,
) -> Floats:
    """Points in which rays meet the ground plane.

    Parameters
    ----------
    center_world
        (..., 3) where the rays start [m, east north up].
    ray_world
        (..., 3) their directions, of any length.
    plane
        (3,) height at the pivot [m], slope to the east, slope to the north.
    pivot
        (2,) east and north of the point about which the slopes turn [m].
    height_above
        (...) heights of the points above the plane, along up [m].

    Returns
    -------
    (..., 3)
        World points [m]; NaN where the ray does not go down to the plane: level with it, upwards,
        or starting below it.
    """
    return _meet(center_world, ray_world, plane, pivot, height_above).point


def intersect_ground_with_jacobian(
    center_world: Floats,
    ray_world: Floats,
    plane: Floats,
    pivot: Floats,
    height_above: ArrayLike = 0.0,
) -> tuple[Floats, Floats, Floats, Floats]:
    """Points in which rays meet the ground plane, and their derivatives.

    Parameters
    ----------
    center_world, ray_world, plane, pivot, height_above
        As for `intersect_ground`.

    Returns
    -------
    point : (..., 3)
    d_center : (..., 3, 3)
        By the start of the ray.
    d_ray : (..., 3, 3)
        By the direction of the ray.
    d_plane : (..., 3, 3)
        By (height, slope east, slope north). All NaN where the point is.
    """
    point, distance, descent = _meet(center_world, ray_world, plane, pivot, height_above)
    # n . (X - Q) = 0 with X = C + s v: a shift d of the start moves X by (I - v n^T / (v . n)) d,
    # a change d of the ray by s times that.
    slide = np.asarray(ray_world, np.float64) / descent[..., None]
    d_center = np.eye(3) - slide[..., :, None] * _normal(plane)
    d_ray = distance[..., None, None] * d_center
    by_plane = np.empty_like(point)
    by_plane[..., 0] = np.where(np.isnan(distance), np.nan, 1.0)
    by_plane[..., 1:] = point[..., :2] - np.asarray(pivot, np.float64)
    d_plane = slide[..., :, None] * by_plane[..., None, :]
    return point, d_center, d_ray, d_plane


def _meet(
    center_world: Floats,
    ray_world: Floats,
    plane: Floats,
    pivot: Floats,
    height_above: ArrayLike,
) -> _Meeting:
    center = np.asarray(center_world, np.float64)
    ray = np.asarray(ray_world, np.float64)
    plane = np.asarray(plane, np.float64)
    lateral = center[..., :2] - np.asarray(pivot, np.float64)
    clearance = center[..., 2] - plane[0] - lateral @ plane[1:] - np.asarray(height_above)
    descent = ray @ _normal(plane)
    clearance, descent = np.broadcast_arrays(clearance, descent)
    descent = np.where((descent < 0) & (clearance > 0), descent, np.nan)
    with np.errstate(over="ignore"):  # a ray level but for its last digit meets at infinity
        distance = -clearance / descent
    descent = np.where(np.isfinite(distance), descent, np.nan)
    distance = np.where(np.isfinite(distance), distance, np.nan)
    return _Meeting(center + distance[..., None] * ray, distance, descent)


def _normal(plane: Floats) -> Floats:
    """Upward normal (not of unit length) of the plane."""
    return np.array([-plane[1], -plane[2], 1.0])


DRAWS = 400
"""Planes through three points that are tried: where 40 % of the points lie on one plane, all draws
miss it with a probability of 3e-12."""

FAR = 3.0
"""Sigmas beyond which a point does not lie on a plane: how far does not matter any more."""

STEEPEST = 0.5
"""Slope that no ground has."""

THIN = 0.02
"""Twice the area of three points, over the square of the extent, below which they make no plane."""

REFINEMENTS = 10


def plane_of_most(place_m: Floats, height_m: Floats, sigma_m: Floats) -> Floats | None:
    """Heights (n,), at all points, of the plane that most points lie on; None where there is none.

    Parameters
    ----------
    place_m
        (n, 2) east and north.
    height_m, sigma_m
        (n,) heights and by how much each may lie off the plane.

    References
    ----------
    Torr and Zisserman 2000, "MLESAC: a new robust estimator", sec. 3 (the sum of squares, cut off,
    as the measure of a draw).
    """
    extent = float(np.ptp(place_m, axis=0).max(initial=0.0))
    if len(place_m) < 4 or extent == 0.0:
        return None
    design = np.column_stack([np.ones(len(place_m)), (place_m - place_m.mean(axis=0)) / extent])
    drawn = _through_three(design, height_m)
    drawn = drawn[np.abs(drawn[:, 1:]).max(axis=1, initial=0.0) < STEEPEST * extent]
    if not len(drawn):
        return None
    off = ((height_m - drawn @ design.T) / sigma_m) ** 2
    plane = drawn[np.minimum(off, FAR**2).sum(axis=1).argmin()]
    for _ in range(REFINEMENTS):
        weight = (np.abs(height_m - design @ plane) < FAR * sigma_m) / sigma_m
        plane = np.linalg.lstsq(design * weight[:, None], height_m * weight, rcond=None)[0]
    return np.asarray(design @ plane)


def _through_three(design: Floats, height_m: Floats) -> Floats:
    """(m, 3) planes through three points drawn at random, always the same ones."""
    order = np.random.default_rng(0).random((DRAWS, len(design))).argpartition(2, axis=1)
    three = order[:, :3]
    three = three[np.abs(np.linalg.det(design[three])) > THIN]
    return np.asarray(np.linalg.solve(design[three], height_m[three][..., None])[..., 0])


JITTER = 1e-9
"""Added to the knots' covariance, so that knots close together do no harm."""


class Basis(NamedTuple):
    """B functions at n places: (n, B) values and (n, B, 2) derivatives to east and north [1/m].

    A function's coefficient is a height in metres.
    """

    value: Floats
    gradient: Floats


def quadratic_basis(east_north_m: Floats, middle_m: Floats, scale_m: float) -> Basis:
    """Squares and product of the distances east and north: a crown, a hollow, a saddle.

    Parameters
    ----------
    east_north_m
        (n, 2) places.
    middle_m
        (2,) where all three are zero, and level.
    scale_m
        Distance from the middle at which the squares are one.
    """
    east, north = ((east_north_m - middle_m) / scale_m).T
    none = np.zeros(len(east))
    value = np.stack([east**2, 2.0 * east * north, north**2], axis=1)
    by_east = np.stack([2.0 * east, 2.0 * north, none], axis=1)
    by_north = np.stack([none, 2.0 * east, 2.0 * north], axis=1)
    return Basis(value, np.stack([by_east, by_north], axis=2) / scale_m)


def correlated_basis(east_north_m: Floats, knots_m: Floats, range_m: float) -> Basis:
    """Functions whose independent coefficients make heights that go together within a range.

    With coefficients of unit variance the heights at the knots have the covariance
    exp(-d^2 / (2 range^2)) of their distances d; between knots, its interpolation.

    Parameters
    ----------
    east_north_m
        (n, 2) places.
    knots_m
        (B, 2) places of the knots.
    range_m
        Distance over which heights go together.

    References
    ----------
    Quinonero-Candela and Rasmussen 2005, "A unifying view of sparse approximate Gaussian process
    regression", eq. 17: the subset of regressors k(x, Z) k(Z, Z)^-1 k(Z, x).
    """
    lower = np.linalg.cholesky(_kernel(knots_m, knots_m, range_m) + JITTER * np.eye(len(knots_m)))
    kernel = _kernel(east_north_m, knots_m, range_m)
    apart = (knots_m[None] - east_north_m[:, None]) / range_m**2
    stacked = np.concatenate([kernel[..., None], kernel[..., None] * apart], axis=2)
    flat = np.moveaxis(stacked, 1, 0).reshape(len(knots_m), -1)
    solved = scipy.linalg.solve_triangular(lower, flat, lower=True, check_finite=False)
    basis = np.moveaxis(solved.reshape(len(knots_m), len(east_north_m), 3), 0, 1)
    return Basis(basis[..., 0], basis[..., 1:])


def spread_knots(east_north_m: Floats, most: int) -> Floats:
    """(B, 2) of the places, at most `most`, each as far as can be from those before it.

    Parameters
    ----------
    east_north_m
        (n, 2) places.
    most
        Number of knots.

    References
    ----------
    Gonzalez 1985, "Clustering to minimize the maximum intercluster distance": the farthest next.
    """
    middle = east_north_m.mean(axis=0)
    first = int(np.argmin(np.sum((east_north_m - middle) ** 2, axis=1)))
    chosen = [first]
    distance = np.linalg.norm(east_north_m - east_north_m[first], axis=1)
    while len(chosen) < min(most, len(east_north_m)) and distance.max() > 0:
        chosen.append(int(distance.argmax()))
        new = np.linalg.norm(east_north_m - east_north_m[chosen[-1]], axis=1)
        distance = np.minimum(distance, new)
    return np.asarray(east_north_m[chosen])


def _kernel(a: Floats, b: Floats, range_m: float) -> Floats:
    square = np.sum((a[:, None] - b[None]) ** 2, axis=2)
    return np.asarray(np.exp(-0.5 * square / range_m**2))
