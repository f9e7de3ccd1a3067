"""Lengths on the ground plane seen by one camera, for poses from known lengths alone.

The plane is m . X = 1 in the camera frame, m = n / h with the unit normal n towards the ground and
the height h of the camera above it. A ray v (z = 1) meets it at X = v / (m . v): three unknowns, no
angles.

The three components are on the first axis. The kernels broadcast over all further axes, which
belong to the problem (lines; scenes x candidates x lines).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

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
