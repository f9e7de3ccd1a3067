"""The ground plane seen by one camera: kernels of a pose from lengths alone.

The plane is m . X = 1 in the camera frame, m = n / h with the unit normal n towards the ground and
the height h above it. A ray v (z = 1) meets it at X = v / (m . v): three unknowns, no angles.
"""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Floats


def lengths_on_plane(plane: Floats, start_ray: Floats, end_ray: Floats) -> tuple[Floats, Floats]:
    """Lengths between points on a plane, and their derivatives by the plane.

    Parameters
    ----------
    plane
        (S, 3) vectors m [1/m], one per candidate.
    start_ray, end_ray
        (L, 3) rays of the lines' ends in the camera frame, z = 1.

    Returns
    -------
    length : (S, L)
        NaN where an end lies behind the camera or at the horizon, or both on one ray.
    jacobian : (S, L, 3)
        By m: u . (-Xa (Xa . dm) + Xb (Xb . dm)), u the unit vector from end to start.
    """
    start = _point(plane, start_ray)
    end = _point(plane, end_ray)
    along = start - end
    length = np.linalg.norm(along, axis=-1)
    length = np.where(length > 0, length, np.nan)  # without a direction there is no derivative
    unit = along / length[..., None]
    jacobian = np.sum(unit * end, -1, keepdims=True) * end
    jacobian -= np.sum(unit * start, -1, keepdims=True) * start
    return length, jacobian


def _point(plane: Floats, ray: Floats) -> Floats:
    depth = plane @ ray.T
    depth = np.where(depth > 1e-12, depth, np.nan)
    return ray / depth[..., None]


def pose_above_plane(plane: Floats) -> tuple[Floats, Floats]:
    """World pose of a camera over the plane z = 0, standing over x = y = 0, image up = north.

    Parameters
    ----------
    plane
        (3,) vector m.

    Returns
    -------
    center_world : (3,)
    world_from_camera : (3, 3)
        Rows are the world's east, north, up in camera axes.

    Notes
    -----
    The horizontal part of the image's up direction (-y) points north; for a camera that looks
    at the horizon it vanishes, and the optical axis takes its place.
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
