"""The ground plane seen by one camera: kernels of a pose from lengths alone.

The plane is m . X = 1 in the camera frame, m = n / h with the unit normal n towards the ground and
the height h above it. A ray v (z = 1) meets it at X = v / (m . v): three unknowns, no angles.

The three components stand along the first axis: whatever the shape of a problem behind it (lines;
scenes x candidates x lines), the kernels broadcast over it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Floats, Ints

_HORIZON = 1e-12
"""Smallest m . v over the length of m: nearer to the horizon a ray meets no ground."""


class RayPairs(NamedTuple):
    """Lines as a camera sees them.

    Attributes
    ----------
    ends
        (2, 3, ...) undistorted rays of start and end, z = 1.
    cross
        (3, ...) start x end, the normal of the plane through the camera and the line.
    cross_square
        (...) its squared length.
    """

    ends: Floats
    cross: Floats
    cross_square: Floats

    def take(self, rows: Ints | tuple[slice, None]) -> RayPairs:
        """The same index into the axes behind the components."""
        if isinstance(rows, tuple):
            at = (slice(None), *rows)
            return RayPairs(self.ends[:, *at], self.cross[at], self.cross_square[rows])
        return RayPairs(self.ends[:, :, rows], self.cross[:, rows], self.cross_square[rows])


def ray_pairs(ends: Floats) -> RayPairs:
    """Lines from the rays (2, 3, ...) of their ends, z = 1."""
    start = ends[0]
    along = ends[1] - start
    cross = np.empty_like(start)
    # start x end = start x (end - start): short lines keep their digits.
    np.negative(along[1], out=cross[0])
    cross[1] = along[0]
    np.multiply(start[0], along[1], out=cross[2])
    cross[2] -= start[1] * along[0]
    return RayPairs(ends, cross, np.add.reduce(cross * cross, axis=0))


class PlaneLengths(NamedTuple):
    """Lengths on a plane, and what their derivatives are made of.

    With the rays a, b and c = a x b, a / (m . a) - b / (m . b) = m x c / ((m . a) (m . b)), so
    length^2 = (|m|^2 |c|^2 - (m . c)^2) / ((m . a)^2 (m . b)^2).

    Attributes
    ----------
    length
        NaN where an end lies behind the camera or at the horizon, or both on one ray.
    plane, plane_square
        m (3, ...), and |m|^2.
    over_depth
        (2, ...) length / (m . a), length / (m . b).
    along
        m . c.
    over_square
        length / |m x c|^2.
    """

    length: Floats
    plane: Floats
    plane_square: Floats
    over_depth: Floats
    along: Floats
    over_square: Floats


def lengths_on_plane(plane: Floats, lines: RayPairs) -> PlaneLengths:
    """Lengths of lines on planes m (3, ...) [1/m]; the axes behind the first are broadcast."""
    plane_square = np.add.reduce(plane * plane, axis=0)
    along = np.add.reduce(plane * lines.cross, axis=0)
    square = lines.cross_square * plane_square - along * along
    depth = np.add.reduce(plane * lines.ends, axis=1)
    # NaN where there is no length: it passes through all that follows.
    depth[depth <= _HORIZON * np.sqrt(plane_square)] = np.nan
    square[square <= 0] = np.nan
    length = np.sqrt(square) / (depth[0] * depth[1])
    return PlaneLengths(length, plane, plane_square, length / depth, along, length / square)


def by_plane(lengths: PlaneLengths, lines: RayPairs) -> Floats:
    """(3, ...) derivatives of the lengths by m."""
    result = (lengths.over_square * lines.cross_square) * lengths.plane
    result -= (lengths.over_square * lengths.along) * lines.cross
    result -= np.add.reduce(lengths.over_depth[:, None] * lines.ends, axis=0)
    return np.asarray(result)


def by_ends(lengths: PlaneLengths, lines: RayPairs) -> Floats:
    """(2, 2, ...) derivatives of the lengths by the undistorted x and y of start and end."""
    of_cross = (lengths.over_square * lengths.plane_square) * lines.cross
    of_cross -= (lengths.over_square * lengths.along) * lengths.plane
    e0, e1, e2 = of_cross
    # c = a x b moves by da x b + a x db, and e . (da x b) = da . (b x e).
    other = lines.ends[::-1, :2] * e2
    across = np.empty_like(other)
    np.subtract(other[:, 1], e1, out=across[:, 0])
    np.subtract(e0, other[:, 0], out=across[:, 1])
    np.negative(across[1], out=across[1])
    across -= lengths.over_depth[:, None] * lengths.plane[:2]
    return np.asarray(across)


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
