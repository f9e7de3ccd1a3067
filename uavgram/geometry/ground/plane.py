"""Where rays meet the ground plane.

The plane is ``up = plane[0] + plane[1] (east - pivot[0]) + plane[2] (north - pivot[1])``: its
height at the pivot [m] and its slopes to the east and to the north; a point may stand a known
height above it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
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
