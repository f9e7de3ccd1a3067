"""Figures in the ground plane: polygons and squares, error ellipses and ellipsoids."""

from __future__ import annotations

import math

import numpy as np

from uavgram.model.arrays import Bools, Floats

_CORNERS = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])


def squares_on_plane(center_m: Floats, slope: Floats, turn_rad: Floats, side_m: float) -> Floats:
    """Compute the (N, 4, 3) corners of squares, counterclockwise from above.

    Parameters
    ----------
    center_m
        (N, 3) their centres.
    slope
        (N, 2) or (2,) d up / d east and d up / d north of the ground there.
    turn_rad
        (N,) angle of the first side from east, counterclockwise.
    side_m
        Side length.
    """
    slope = np.broadcast_to(slope, (len(center_m), 2))
    flat = np.column_stack([np.cos(turn_rad), np.sin(turn_rad)])
    along = np.column_stack([flat, np.sum(slope * flat, axis=1)])
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    up = np.column_stack([-slope, np.ones(len(slope))])
    across = np.cross(up / np.linalg.norm(up, axis=1, keepdims=True), along)
    corner = side_m * (_CORNERS[:, :1] * along[:, None] + _CORNERS[:, 1:] * across[:, None])
    return np.asarray(center_m[:, None] + corner)


def signed_area(corner: Floats) -> float:
    """Compute the area of a polygon (V, 2), positive if counterclockwise (shoelace formula)."""
    x, y = corner.T
    return float(0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def orient_counterclockwise(corner: Floats) -> Floats:
    """Return the polygon (V, 2) in counterclockwise order, without a repeated last corner."""
    if len(corner) > 1 and np.array_equal(corner[0], corner[-1]):
        corner = corner[:-1]
    return corner[::-1] if signed_area(corner) < 0 else corner


def mark_points_inside(corner: Floats, point: Floats) -> Bools:
    """Mark the points (N, 2) inside a polygon (V, 2).

    A point is inside if a ray to the right crosses the outline an odd number of times (Shimrat
    1962, "Algorithm 112: position of point relative to polygon"). Points on the outline belong to
    one side or the other.
    """
    start, end = corner, np.roll(corner, -1, axis=0)
    y = point[:, 1, None]
    spans = (start[:, 1] > y) != (end[:, 1] > y)
    rise = np.where(end[:, 1] == start[:, 1], 1.0, end[:, 1] - start[:, 1])
    at = start[:, 0] + (y - start[:, 1]) * (end[:, 0] - start[:, 0]) / rise
    return np.asarray(np.count_nonzero(spans & (point[:, 0, None] < at), axis=1) % 2 == 1)


def mark_crossing_segments(corner: Floats, start: Floats, end: Floats) -> Bools:
    """Mark the segments (N, 2) to (N, 2) that are inside a polygon (V, 2) or cross its outline.

    Parameters
    ----------
    corner
        (V, 2) of the polygon.
    start, end
        (N, 2) of the segments.
    """
    a, b = corner, np.roll(corner, -1, axis=0)
    p, q = start[:, None], end[:, None]
    one = _turn(p, q, a) * _turn(p, q, b) <= 0
    other = _turn(a, b, p) * _turn(a, b, q) <= 0
    return np.asarray(
        (one & other).any(axis=1)
        | mark_points_inside(corner, start)
        | mark_points_inside(corner, end)
    )


def _turn(a: Floats, b: Floats, c: Floats) -> Floats:
    """Compute twice the signed area of triangles (..., 2)."""
    u, v = b - a, c - a
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])


def find_long_axis(corner: Floats) -> tuple[Floats, Floats, Floats]:
    """Compute the smallest rectangle around a polygon (V, 2), and the direction of its longer side.

    One side of the rectangle is on a side of the convex hull (Freeman and Shapira 1975). Here all
    lines between two corners are tried, which gives the same result for the few corners of an area.

    Returns
    -------
    middle : (2,)
    axis : (2,)
        Unit vector along the longer side.
    size : (2,)
        Length along the axis, and across.
    """
    first, second = np.triu_indices(len(corner), k=1)
    side = corner[second] - corner[first]
    length = np.linalg.norm(side, axis=1)
    side = side[length > 0] / length[length > 0, None]
    across = np.stack([-side[:, 1], side[:, 0]], axis=1)
    # Extent of the corners along and across each candidate direction.
    along = np.stack([corner @ side.T, corner @ across.T])  # (2, V, n)
    low, high = along.min(axis=1), along.max(axis=1)
    best = int(np.argmin(np.prod(high - low, axis=0)))
    axes = np.stack([side[best], across[best]])
    middle = (0.5 * (low + high)[:, best]) @ axes
    size = (high - low)[:, best]
    longer = int(size[1] > size[0])
    return middle, axes[longer], size[::-1] if longer else size


#: Half-axes of the 95 % error ellipse in standard deviations: the root of the chi-square quantile
#: with two degrees of freedom, -2 ln(1 - 0.95) in closed form; 2.4477.
ELLIPSE_95 = math.sqrt(-2 * math.log(0.05))

#: Half-axes of the 95 % error ellipsoid in standard deviations: the same with three degrees of
#: freedom; 2.7955.
ELLIPSOID_95 = math.sqrt(7.814727903251179)

# Part of the larger eigenvalue by which the smaller one may be negative through rounding.
_ROUNDING = 1e-9


def error_ellipse(covariance: Floats) -> tuple[Floats, Floats, Floats]:
    """Compute half-axes and direction of one-sigma error ellipses.

    Parameters
    ----------
    covariance
        (..., 2, 2) of (east, north) [m2]; symmetric.

    Returns
    -------
    semi_major, semi_minor : (...)
        Standard deviations along the axes [m]. NaN where the matrix is not a covariance; an
        eigenvalue that is negative by rounding counts as zero.
    azimuth_rad : (...)
        Direction of the major axis, clockwise from north, in [0, pi); 0 for a circle.
    """
    covariance = np.asarray(covariance, np.float64)
    east, north = covariance[..., 0, 0], covariance[..., 1, 1]
    both = 0.5 * (covariance[..., 0, 1] + covariance[..., 1, 0])
    # Eigenvalues of the symmetric 2x2 matrix in closed form: mean +- radius.
    mean = 0.5 * (east + north)
    radius = np.hypot(0.5 * (north - east), both)
    major, minor = mean + radius, mean - radius
    valid = (major >= 0) & (minor >= -_ROUNDING * major)
    # tan(2 azimuth) = 2 s_en / (s_nn - s_ee): Mikhail and Gracie (1981), with the angle from north
    azimuth = 0.5 * np.arctan2(2 * both, north - east)
    azimuth = np.where(azimuth < 0, azimuth + np.pi, azimuth)
    azimuth = np.where(azimuth < np.pi, azimuth, 0.0)  # -tiny + pi rounds to pi
    semi_major = np.sqrt(np.where(valid, major, np.nan))
    semi_minor = np.sqrt(np.where(valid, np.maximum(minor, 0.0), np.nan))
    return semi_major, semi_minor, np.asarray(np.where(valid, azimuth, np.nan))


def error_ellipsoid(covariance: Floats) -> tuple[Floats, Floats]:
    """Compute half-axes and directions of one-sigma error ellipsoids.

    Parameters
    ----------
    covariance
        (..., 3, 3) of (east, north, up) [m2]; symmetric.

    Returns
    -------
    half_axes : (..., 3)
        Standard deviations along the axes, the largest first [m].
    directions : (..., 3, 3)
        Unit vectors along the axes as columns, a right-handed frame: a rotation.
    """
    variance, axes = np.linalg.eigh(covariance)
    directions = axes[..., ::-1].copy()
    directions[..., 2] *= np.sign(np.linalg.det(directions))[..., None]
    return np.sqrt(np.maximum(variance[..., ::-1], 0.0)), directions
