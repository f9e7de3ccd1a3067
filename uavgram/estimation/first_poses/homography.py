"""First pose of a frame from four or more points of a plane whose coordinates are known."""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Floats

FLAT = 1e-9
"""Ratio of the second smallest to the largest singular value below which the points are in line."""


def resect_from_plane(point_m: Floats, ray: Floats) -> tuple[Floats, Floats] | None:
    """Pose of a camera from points on the plane z = 0.

    Parameters
    ----------
    point_m
        (N, 2) plane coordinates, N >= 4, not all but one in line.
    ray
        (N, 3) undistorted rays in the camera frame, z = 1.

    Returns
    -------
    center_m : (3,)
        In the axes of the plane.
    plane_from_camera : (3, 3)
    None
        Where the points do not determine it.

    Notes
    -----
    Direct linear transformation of the homography with normalised coordinates (Hartley and
    Zisserman 2004, algorithm 4.2), and its factorisation by orthonormality (Zhang 2000, sec. 3.1).
    """
    mean = point_m.mean(axis=0)
    size = np.sqrt(np.mean(np.sum((point_m - mean) ** 2, axis=1)))
    if size == 0:
        return None
    x, y = ((point_m - mean) / size).T
    u, v = ray[:, 0], ray[:, 1]
    zero, one = np.zeros_like(x), np.ones_like(x)
    rows = np.concatenate(
        [
            np.stack([x, y, one, zero, zero, zero, -u * x, -u * y, -u], axis=1),
            np.stack([zero, zero, zero, x, y, one, -v * x, -v * y, -v], axis=1),
        ]
    )
    _, singular, vectors = np.linalg.svd(rows)
    if singular[-2 if len(singular) == 9 else -1] < FLAT * singular[0]:
        return None
    return _pose_from_homography(vectors[-1].reshape(3, 3), mean, size)


def _pose_from_homography(homography: Floats, mean: Floats, size: float) -> tuple[Floats, Floats]:
    """Camera pose from (plane coordinates, normalised) -> ray; the ground lies in front."""
    scale = np.sqrt(np.linalg.norm(homography[:, 0]) * np.linalg.norm(homography[:, 1]))
    homography = homography / scale
    if homography[2, 2] < 0:  # the points' centre lies in front of the camera
        homography = -homography
    first, second, translation = homography.T
    rough = np.stack([first, second, np.cross(first, second)], axis=1)
    left, _, right = np.linalg.svd(rough)
    camera_from_plane = left @ np.diag([1, 1, np.linalg.det(left @ right)]) @ right
    center = -camera_from_plane.T @ translation * size
    return center + np.array([*mean, 0.0]), camera_from_plane.T
