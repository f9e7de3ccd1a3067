"""Ground surface: its intersection with rays, its relief, and a robust plane through points.

The plane is ``up = plane[0] + plane[1] (east - pivot[0]) + plane[2] (north - pivot[1])``: its
height at the pivot [m] and its slopes to the east and to the north. A point may have a known height
above it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from uavgram.model.arrays import Floats


class _Intersection(NamedTuple):
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
    """Intersect rays with the ground plane.

    Parameters
    ----------
    center_world
        (..., 3) starts of the rays [m, east north up].
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
        World points [m]; NaN where the ray does not go down to the plane: parallel to it, upwards,
        or starting below it.
    """
    return _intersect(center_world, ray_world, plane, pivot, height_above).point


def intersect_ground_with_jacobian(
    center_world: Floats,
    ray_world: Floats,
    plane: Floats,
    pivot: Floats,
    height_above: ArrayLike = 0.0,
) -> tuple[Floats, Floats, Floats, Floats]:
    """Intersect rays with the ground plane, with derivatives.

    Parameters
    ----------
    center_world, ray_world, plane, pivot, height_above
        As for `intersect_ground`.

    Returns
    -------
    point : (..., 3)
    d_center : (..., 3, 3)
        Derivative with respect to the start of the ray.
    d_ray : (..., 3, 3)
        Derivative with respect to the direction of the ray.
    d_plane : (..., 3, 3)
        Derivative with respect to (height, slope east, slope north). All NaN where the point is.
    """
    point, distance, descent = _intersect(center_world, ray_world, plane, pivot, height_above)
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


def _intersect(
    center_world: Floats,
    ray_world: Floats,
    plane: Floats,
    pivot: Floats,
    height_above: ArrayLike,
) -> _Intersection:
    center = np.asarray(center_world, np.float64)
    ray = np.asarray(ray_world, np.float64)
    plane = np.asarray(plane, np.float64)
    lateral = center[..., :2] - np.asarray(pivot, np.float64)
    clearance = center[..., 2] - plane[0] - lateral @ plane[1:] - np.asarray(height_above)
    descent = ray @ _normal(plane)
    clearance, descent = np.broadcast_arrays(clearance, descent)
    descent = np.where((descent < 0) & (clearance > 0), descent, np.nan)
    with np.errstate(
        over="ignore"
    ):  # a ray parallel to the plane but for rounding meets it at infinity
        distance = -clearance / descent
    descent = np.where(np.isfinite(distance), descent, np.nan)
    distance = np.where(np.isfinite(distance), distance, np.nan)
    return _Intersection(center + distance[..., None] * ray, distance, descent)


def _normal(plane: Floats) -> Floats:
    """Compute the upward normal (not of unit length) of the plane."""
    return np.array([-plane[1], -plane[2], 1.0])


SAMPLES = 400
"""Number of random planes through three points.

Where 40 % of the points are on one plane, all draws miss it with a probability of 3e-12.
"""

OUTLIER_SIGMAS = 3.0
"""Distance [sigma] from the plane beyond which the cost of a point no longer grows."""

MAX_SLOPE = 0.5
"""Largest slope accepted for the ground."""

MIN_TRIANGLE_AREA = 0.02
"""Least determinant of three points for a plane: twice their area over the squared extent."""

MAX_ITERATIONS = 10


def fit_robust_plane(place_m: Floats, height_m: Floats, sigma_m: Floats) -> Floats | None:
    """Fit the plane that most points are on (MLESAC); return its heights at all points.

    Parameters
    ----------
    place_m
        (n, 2) east and north.
    height_m, sigma_m
        (n,) heights and the standard deviations of their distances from the plane.

    Returns
    -------
    (n,) heights of the plane; None where there is no plane.

    References
    ----------
    Torr and Zisserman 2000, "MLESAC: a new robust estimator", sec. 3 (truncated sum of squares as
    the cost of a draw).
    """
    extent = float(np.ptp(place_m, axis=0).max(initial=0.0))
    if len(place_m) < 4 or extent == 0.0:
        return None
    design = np.column_stack([np.ones(len(place_m)), (place_m - place_m.mean(axis=0)) / extent])
    drawn = _through_three(design, height_m)
    drawn = drawn[np.abs(drawn[:, 1:]).max(axis=1, initial=0.0) < MAX_SLOPE * extent]
    if not len(drawn):
        return None
    # Choose the draw with the least truncated sum of squares.
    off = ((height_m - drawn @ design.T) / sigma_m) ** 2
    plane = drawn[np.minimum(off, OUTLIER_SIGMAS**2).sum(axis=1).argmin()]
    # Refine by least squares over the points within FAR sigmas.
    for _ in range(MAX_ITERATIONS):
        weight = (np.abs(height_m - design @ plane) < OUTLIER_SIGMAS * sigma_m) / sigma_m
        plane = np.linalg.lstsq(design * weight[:, None], height_m * weight, rcond=None)[0]
    return np.asarray(design @ plane)


def _through_three(design: Floats, height_m: Floats) -> Floats:
    """Compute the (m, 3) planes through three points drawn at random, with a fixed seed."""
    order = np.random.default_rng(0).random((SAMPLES, len(design))).argpartition(2, axis=1)
    three = order[:, :3]
    three = three[np.abs(np.linalg.det(design[three])) > MIN_TRIANGLE_AREA]
    return np.asarray(np.linalg.solve(design[three], height_m[three][..., None])[..., 0])


JITTER = 1e-9
"""Variance added to the knots' covariance, so that it stays regular with knots close together."""


class Basis(NamedTuple):
    """Values (n, B) of B functions at n places, and derivatives (n, B, 2) to east and north [1/m].

    The coefficient of a function is a height in metres.
    """

    value: Floats
    gradient: Floats


def quadratic_basis(east_north_m: Floats, middle_m: Floats, scale_m: float) -> Basis:
    """Evaluate squares and product of the distances east and north: crown, hollow, saddle.

    Parameters
    ----------
    east_north_m
        (n, 2) places.
    middle_m
        (2,) place where all three are zero, with zero slope.
    scale_m
        Distance from the middle at which the squares are one.
    """
    east, north = ((east_north_m - middle_m) / scale_m).T
    none = np.zeros(len(east))
    value = np.stack([east**2, 2.0 * east * north, north**2], axis=1)
    by_east = np.stack([2.0 * east, 2.0 * north, none], axis=1)
    by_north = np.stack([none, 2.0 * east, 2.0 * north], axis=1)
    return Basis(value, np.stack([by_east, by_north], axis=2) / scale_m)


def knots_root(knots_m: Floats, range_m: float) -> Floats:
    """Compute L^-1 (B, B), where L L^T is the covariance of the heights at the knots.

    Parameters
    ----------
    knots_m, range_m
        As for `correlated_basis`.
    """
    covariance = _kernel(_apart(knots_m, knots_m), range_m) + JITTER * np.eye(len(knots_m))
    lower = np.linalg.cholesky(covariance)
    return np.asarray(
        scipy.linalg.solve_triangular(lower, np.eye(len(lower)), lower=True, check_finite=False)
    )


def correlated_basis(east_north_m: Floats, knots_m: Floats, range_m: float, root: Floats) -> Basis:
    """Evaluate functions whose independent coefficients give heights correlated within a range.

    With coefficients of unit variance the heights at the knots have the covariance exp(-d^2 / (2
    range^2)) of their distances d; between knots it is interpolated.

    Parameters
    ----------
    east_north_m
        (n, 2) places.
    knots_m
        (B, 2) places of the knots.
    range_m
        Correlation distance of the heights.
    root
        (B, B) from `knots_root`: the same at all places.

    References
    ----------
    Quinonero-Candela and Rasmussen 2005, "A unifying view of sparse approximate Gaussian process
    regression", eq. 17: the subset of regressors k(x, Z) k(Z, Z)^-1 k(Z, x).
    """
    # Whiten the kernel by the root of the knots' covariance; d k / dx = k (z - x) / range^2.
    apart = _apart(east_north_m, knots_m)
    kernel = _kernel(apart, range_m)
    by_place = -(kernel / range_m**2) * apart
    return Basis(kernel @ root.T, np.moveaxis(by_place @ root.T, 0, -1))


def choose_knots(east_north_m: Floats, most: int) -> Floats:
    """Choose at most `most` of the places as knots (B, 2), each the farthest from those before it.

    Parameters
    ----------
    east_north_m
        (n, 2) places.
    most
        Largest number of knots.

    References
    ----------
    Gonzalez 1985, "Clustering to minimize the maximum intercluster distance": farthest-point
    selection.
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


def _apart(a: Floats, b: Floats) -> Floats:
    """(2, n, m) from each of m places to each of n, east and north."""
    return np.asarray(a.T[:, :, None] - b.T[:, None, :])


def _kernel(apart: Floats, range_m: float) -> Floats:
    east, north = apart
    return np.asarray(np.exp((east * east + north * north) * (-0.5 / range_m**2)))
