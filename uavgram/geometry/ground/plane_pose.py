"""The ground plane seen by one camera: kernels of a pose from lengths alone.

The plane is m . X = 1 in the camera frame, m = n / h with the unit normal n towards the ground and
the height h above it. A ray v (z = 1) meets it at X = v / (m . v): three unknowns, no angles.

The three components stand along the first axis: whatever the shape of a problem behind it (lines;
scenes x candidates x lines), the kernels broadcast over it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Floats

_HORIZON = 1e-12
"""Smallest m . v over the length of m: nearer to the horizon a ray meets no ground."""


class PlaneLengths(NamedTuple):
    """Lengths on a plane, and what their derivatives are made of.

    Attributes
    ----------
    length
        NaN where an end lies behind the camera or at the horizon, or both on one ray.
    plane
        m (3, ...).
    ground
        (3, 2, ...) where the rays of start and end meet the plane, camera frame [m].
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
    """Lengths of lines on planes.

    Parameters
    ----------
    plane
        (3, ...) m [1/m].
    ends
        (3, 2, ...) undistorted rays of start and end, z = 1. The axes behind are broadcast.
    """
    depth = np.add.reduce(plane[:, None] * ends, axis=0)
    # NaN where there is no length: it passes through all that follows.
    depth[depth <= _HORIZON * np.sqrt(np.add.reduce(plane * plane, axis=0))] = np.nan
    inverse_depth = 1.0 / depth
    ground = inverse_depth * ends
    along = ground[:, 0] - ground[:, 1]
    square = np.add.reduce(along * along, axis=0)
    square[square == 0] = np.nan
    length = np.sqrt(square)
    return PlaneLengths(length, plane, ground, inverse_depth, along / length)


def reach_of(lengths: PlaneLengths) -> Floats:
    """(2, ...) components of both ground points along their line [m]: of all derivatives."""
    return np.asarray(np.add.reduce(lengths.towards_start[:, None] * lengths.ground, axis=0))


def by_plane(lengths: PlaneLengths, reach: Floats) -> Floats:
    """(3, ...) derivatives of the lengths by m: a ground point X moves by -X (X . dm)."""
    moved = reach * lengths.ground
    return np.asarray(moved[:, 1] - moved[:, 0])


def by_ends(lengths: PlaneLengths, reach: Floats) -> Floats:
    """(2, 2, ...) derivatives of the lengths by undistorted x and y (first axis) of both ends.

    A ground point X moves by (dv - X (m . dv)) / (m . v).
    """
    moved = lengths.towards_start[:2, None] - reach * lengths.plane[:2, None]
    moved *= lengths.inverse_depth
    np.negative(moved[:, 1], out=moved[:, 1])
    return np.asarray(moved)


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
