"""Planes seen by one camera: lengths on the ground plane, poses over it, and from homographies.

The plane is m . X = 1 in the camera frame, m = n / h with the unit normal n towards the ground and
the height h of the camera above it. A ray v (z = 1) meets it at X = v / (m . v): three unknowns, no
angles.

The three components are on the first axis. The kernels broadcast over all further axes, which
belong to the problem (lines; scenes x candidates x lines).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.geometry.motion.rotation import nearest_rotation
from uavgram.model.arrays import Floats

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
