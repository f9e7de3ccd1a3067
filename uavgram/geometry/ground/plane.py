"""Ground surface: intersection with rays, relief, robust planes, and planes seen by one camera.

In the world the plane is ``up = plane[0] + plane[1] (east - pivot[0]) + plane[2] (north -
pivot[1])``: its height at the pivot [m] and its slopes to the east and to the north. A point may
have a known height above it.

In the frame of one camera it is m . X = 1, m = n / h with the unit normal n towards the ground and
the height h of the camera above it. A ray v (z = 1) meets it at X = v / (m . v): three unknowns, no
angles. The three components are on the first axis; these functions broadcast over all further axes,
which belong to the problem (lines; scenes x candidates x lines).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from uavgram.geometry.motion.rotation import nearest_rotation
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


def evaluate_quadratic_basis(east_north_m: Floats, middle_m: Floats, scale_m: float) -> Basis:
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
        As for `evaluate_correlated_basis`.
    """
    covariance = _kernel(_apart(knots_m, knots_m), range_m) + JITTER * np.eye(len(knots_m))
    lower = np.linalg.cholesky(covariance)
    return np.asarray(
        scipy.linalg.solve_triangular(lower, np.eye(len(lower)), lower=True, check_finite=False)
    )


def evaluate_correlated_basis(
    east_north_m: Floats, knots_m: Floats, range_m: float, root: Floats
) -> Basis:
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


_HORIZON = 1e-12
"""Smallest m . v over the length of m: closer to the horizon a ray does not meet the ground."""


class PlaneLengths(NamedTuple):
    """Lengths on a plane, and the intermediate results for their derivatives.

    Attributes
    ----------
    length
        NaN where an end is behind the camera or at the horizon, or where both ends are on one ray.
    plane
        m (3, ...).
    ground
        (3, 2, ...) points where the rays of start and end meet the plane, camera frame [m].
    inverse_depth
        (2, ...) 1 / (m . v) of either ray v.
    towards_start
        (3, ...) unit vectors from end to start.
    """

    length: Floats
    plane: Floats
    ground: Floats
    inverse_depth: Floats
    towards_start: Floats


def lengths_on_plane(plane: Floats, ends: Floats) -> PlaneLengths:
    """Compute the lengths of lines on planes.

    Parameters
    ----------
    plane
        (3, ...) m [1/m].
    ends
        (3, 2, ...) undistorted rays of start and end, z = 1. Further axes are broadcast.
    """
    depth = np.add.reduce(plane[:, None] * ends, axis=0)
    # Mark undefined lengths by NaN, which propagates through the following steps.
    depth[depth <= _HORIZON * np.sqrt(np.add.reduce(plane * plane, axis=0))] = np.nan
    inverse_depth = 1.0 / depth
    ground = inverse_depth * ends
    along = ground[:, 0] - ground[:, 1]
    square = np.add.reduce(along * along, axis=0)
    square[square == 0] = np.nan
    length = np.sqrt(square)
    return PlaneLengths(length, plane, ground, inverse_depth, along / length)


def compute_end_components(lengths: PlaneLengths) -> Floats:
    """Compute the (2, ...) components of both ground points along their line [m].

    They are a factor of all derivatives of the length.
    """
    return np.asarray(np.add.reduce(lengths.towards_start[:, None] * lengths.ground, axis=0))


def differentiate_by_plane(lengths: PlaneLengths, reach: Floats) -> Floats:
    """Compute (3, ...) derivatives of the lengths by m: a ground point X moves by -X (X . dm)."""
    moved = reach * lengths.ground
    return np.asarray(moved[:, 1] - moved[:, 0])


def differentiate_by_ends(lengths: PlaneLengths, reach: Floats) -> Floats:
    """Compute derivatives of the lengths by the undistorted coordinates of both ends.

    The result is (2, 2, ...), with x and y on the first axis. A ground point X moves by (dv - X (m
    . dv)) / (m . v).
    """
    moved = lengths.towards_start[:2, None] - reach * lengths.plane[:2, None]
    moved *= lengths.inverse_depth
    np.negative(moved[:, 1], out=moved[:, 1])
    return np.asarray(moved)


def pose_above_plane(plane: Floats) -> tuple[Floats, Floats]:
    """Compute the world pose of a camera above x = y = 0 of the plane z = 0, image up to the north.

    Parameters
    ----------
    plane
        (3,) vector m.

    Returns
    -------
    center_world : (3,)
    world_from_camera : (3, 3)
        Its rows are the world's east, north, up in camera axes.

    Notes
    -----
    The horizontal part of the image's up direction (-y) points north; for a camera that looks at
    the horizon this part vanishes, and the optical axis is used instead.
    """
    height = 1.0 / np.linalg.norm(plane)
    up = -plane * height
    for direction in (np.array([0.0, -1.0, 0.0]), np.array([0.0, 0.0, 1.0])):
        north = direction - (direction @ up) * up
        size = np.linalg.norm(north)
        if size > 1e-6:
            break
    north /= size
    east = np.cross(north, up)
    return np.array([0.0, 0.0, height]), np.stack([east, north, up])


def make_homography_rows(plane: Floats, image: Floats, weight: Floats | float = 1.0) -> Floats:
    """Compute the (..., 2 n, 9) equations of homographies from points of a plane to an image.

    Direct linear transformation (Hartley and Zisserman 2004, algorithm 4.2): two equations per
    point, u (h3 . X) = h1 . X and v (h3 . X) = h2 . X.

    Parameters
    ----------
    plane, image
        (..., n, 2), (..., n, 2) coordinates, both normalised.
    weight
        (..., n, 1) of each point.
    """
    count = plane.shape[-2]
    point = np.concatenate([plane, np.ones((*plane.shape[:-1], 1))], axis=-1) * weight
    rows = np.zeros((*plane.shape[:-2], 2, count, 9))
    rows[..., 0, :, :3] = rows[..., 1, :, 3:6] = point
    rows[..., 0, :, 6:] = -image[..., :1] * point
    rows[..., 1, :, 6:] = -image[..., 1:] * point
    return rows.reshape(*plane.shape[:-2], 2 * count, 9)


def factor_homographies(homography: Floats) -> tuple[Floats, Floats]:
    """Compute poses from homographies of any scale that take a plane to rays.

    Parameters
    ----------
    homography
        (..., 3, 3) matrices that take (x, y, 1) on the plane to rays in the camera.

    Returns
    -------
    camera_from_plane : (..., 3, 3)
    origin : (..., 3)
        Origin of the plane in the camera's axes, before the camera.

    Notes
    -----
    H ~ [r1 r2 t]: scale to unit columns, complete by r3 = r1 x r2, orthonormalise (Zhang 2000, sec.
    3.1, appendix C).
    """
    size = np.linalg.norm(homography[..., :2], axis=-2)
    scale = np.sqrt(size[..., 0] * size[..., 1])
    sign = np.where(homography[..., 2, 2] < 0, -1.0, 1.0)
    scaled = homography * (sign / np.maximum(scale, 1e-300))[..., None, None]
    first, second, origin = np.moveaxis(scaled, -1, 0)
    rough = np.stack([first, second, np.cross(first, second)], axis=-1)
    return nearest_rotation(rough), origin


def mirror_plane(camera_from_plane: Floats, sight: Floats) -> Floats:
    """Compute the second rotation (..., 3, 3) of a plane that looks nearly alike.

    Its normal is mirrored about the line of sight (..., 3) to its middle (Schweighofer and Pinz
    2006, sec. 3; Collins and Bartoli 2014, sec. 5): a small or distant plane, of weak perspective,
    does not distinguish the two.
    """
    sight = sight / np.linalg.norm(sight, axis=-1, keepdims=True)
    # Rotation by 180 degrees in the plane, then by 180 degrees about the line of sight.
    about_sight = 2 * sight[..., :, None] * sight[..., None, :] - np.eye(3)
    return np.asarray(about_sight @ camera_from_plane @ np.diag([-1.0, -1.0, 1.0]))
