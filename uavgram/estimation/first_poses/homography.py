"""Initial pose of a frame from four or more known points of a plane."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.first_poses.pose_problem import make_ray_problem
from uavgram.estimation.solver.batched import minimise_each
from uavgram.geometry.ground.plane import factor_homographies, make_homography_rows, mirror_plane
from uavgram.model.arrays import Floats

Pose = tuple[Floats, Floats]
"""Centre (3,) in the axes of the plane [m], and rotation (3, 3), plane from camera."""

MAX_ITERATIONS = 20
"""Number of iterations."""

MIN_SINGULAR_RATIO = 1e-9
"""Ratio of the second smallest to the largest singular value below which the points are in line."""


def resect_from_plane(point_m: Floats, ray: Floats) -> tuple[Floats, Floats] | None:
    """Estimate the pose of a camera from points on the plane z = 0.

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
        If the points do not determine it.

    Notes
    -----
    Direct linear transformation of the homography with normalised coordinates (Hartley and
    Zisserman 2004, algorithm 4.2), and its factorisation by orthonormality (Zhang 2000, sec. 3.1).
    """
    mean = point_m.mean(axis=0)
    size = np.sqrt(np.mean(np.sum((point_m - mean) ** 2, axis=1)))
    if size == 0:
        return None
    rows = make_homography_rows((point_m - mean) / size, ray[:, :2])
    _, singular, vectors = np.linalg.svd(rows)
    if singular[-2 if len(singular) == 9 else -1] < MIN_SINGULAR_RATIO * singular[0]:
        return None
    camera_from_plane, origin = factor_homographies(vectors[-1].reshape(3, 3))
    center = -camera_from_plane.T @ origin * size
    return center + np.array([*mean, 0.0]), camera_from_plane.T


def find_second_pose(pose: Pose, point_m: Floats) -> Pose:
    """Compute the second pose that shows points of the plane z = 0 (N, 2) nearly alike."""
    center, plane_from_camera = pose
    middle = np.array([*point_m.mean(axis=0), 0.0])
    sight = plane_from_camera.T @ (middle - center)
    turned = mirror_plane(plane_from_camera.T, sight).T
    return middle - turned @ sight, turned


def refine_pose(
    pose: Pose, world_m: Floats, ray: Floats, sigma: Floats
) -> tuple[float, Pose] | None:
    """Refine a pose to the best fit of the rays, and return its sum of squares with it.

    Parameters
    ----------
    pose
        Initial pose.
    world_m
        (N, 3) points on the plane z = 0 or near it.
    ray
        (N, 3) undistorted, z = 1.
    sigma
        (N,) of their x and y.

    Returns
    -------
    None
        If a point is not before the camera, or the camera not above the plane.
    """
    size = np.linalg.norm(ray, axis=1)[:, None]
    across = np.zeros((len(ray), 2, 3))  # from unit vectors to x and y at z = 1
    across[:, [0, 1], [0, 1]] = 1.0
    across[:, :, 2] = -ray[:, :2]
    across *= (size / sigma[:, None])[:, None]
    problem = make_ray_problem((ray / size)[None], across[None], world_m[None])
    ends = minimise_each(problem, (pose[0][None], pose[1][None]), MAX_ITERATIONS)
    (center, rotation), cost = ends.state, float(ends.cost[0])
    return (cost, (center[0], rotation[0])) if cost < np.inf and center[0, 2] > 0 else None
