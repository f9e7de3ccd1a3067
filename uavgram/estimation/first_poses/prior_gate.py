"""Gate for poses from lengths: their height and level against those of the telemetry."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from uavgram.estimation.first_poses.length_poses import LengthPoses
from uavgram.geometry.motion.rotation import exp_so3
from uavgram.model.arrays import Bools, Floats
from uavgram.model.survey import Ground

OUTSIDE_PROBABILITY = 0.001
"""Probability that a true pose is outside the gate."""

HEIGHT, TILT = 0, slice(1, 3)


class SeedComparison(NamedTuple):
    """Comparison of C candidate planes of one frame with its seed.

    Attributes
    ----------
    squared_distance
        (C,) squared Mahalanobis distances.
    shift
        (C, 3) shift of the seed to the weighted mean of seed and candidate: in height [m], and in
        two tilts [rad].
    """

    squared_distance: Floats
    shift: Floats


def compare_with_seed(
    center_world_m: Floats,
    world_from_camera: Floats,
    covariance: Floats,
    ground: Ground,
    poses: LengthPoses,
) -> SeedComparison:
    """Compare poses from lengths with the one from the telemetry.

    Three numbers are compared: the height above the ground, and the two differences in the
    direction of down in the camera; lengths do not determine the place along the ground and the
    heading.

    Parameters
    ----------
    center_world_m, world_from_camera, covariance
        (3,), (3, 3), (6, 6) of the seed, with the contribution of the telemetry's shared unknowns.
    ground
        Prior of the plane; its sigmas widen the gate.
    poses
        C converged candidates of that frame, with their own covariances.
    """
    down = -world_from_camera[2]
    size = np.linalg.norm(poses.plane, axis=1)
    normal = poses.plane / size[:, None]
    # Two directions in the camera, perpendicular to the seed's down.
    sideways = np.asarray(np.linalg.svd(down[None]).Vh[1:])
    seed_height = center_world_m[2] - ground.height_m
    turn = _turn(down, normal)
    difference = np.column_stack([1.0 / size - seed_height, turn @ sideways.T])
    # Seed: with R exp(a), down in the camera turns by -a, of which only the part across it counts.
    by_pose = np.zeros((3, 6))
    by_pose[HEIGHT, 2] = 1.0
    by_pose[TILT, 3:] = -sideways
    prior = by_pose @ covariance @ by_pose.T
    prior[HEIGHT, HEIGHT] += ground.height_sigma_m**2
    prior[TILT, TILT] += ground.slope_sigma_rad**2 * np.eye(2)
    # Candidate: m = n / h, so dh = -h^2 (n . dm), and n turns by h (n x dm).
    by_plane = np.empty((len(normal), 3, 3))
    by_plane[:, HEIGHT] = -normal / size[:, None] ** 2
    across = np.cross(normal[:, None], np.eye(3)[None]) / size[:, None, None]
    by_plane[:, TILT] = np.einsum("ti,cji->ctj", sideways, across)
    own = by_plane @ poses.covariance @ by_plane.swapaxes(1, 2)
    # Squared Mahalanobis distance d^T (P + C)^-1 d, and shift P (P + C)^-1 d to the weighted mean.
    weighted = np.linalg.solve(prior + own, difference[..., None])
    return SeedComparison(np.sum(difference * weighted[..., 0], axis=1), (prior @ weighted)[..., 0])


def find_allowed(squared_distance: Floats) -> Bools:
    """Mark the candidates (C,) inside the gate (chi-square with three degrees of freedom)."""
    return np.asarray(squared_distance <= float(chdtri(3, OUTSIDE_PROBABILITY)))


def move_seed_to_plane(
    center_world_m: Floats, world_from_camera: Floats, ground: Ground, plane: Floats
) -> tuple[Floats, Floats]:
    """Replace height and level of the seed by those of a candidate plane (3,).

    Parameters
    ----------
    center_world_m, world_from_camera
        (3,), (3, 3) of the seed.
    ground
        Prior of the plane, for its height.
    plane
        (3,) m = normal / height in the camera frame [1/m].
    """
    size = np.linalg.norm(plane)
    center = center_world_m.copy()
    center[2] = ground.height_m + 1.0 / size
    # R exp(a) has down of the candidate in the direction where R had that of the seed.
    turn = _turn(-world_from_camera[2], (plane / size)[None])
    return center, world_from_camera @ exp_so3(-turn)[0]


def _turn(start: Floats, ends: Floats) -> Floats:
    """Compute the shortest rotation vectors (C, 3) from a unit vector (3,) to others (C, 3)."""
    axis = np.cross(start, ends)
    sine = np.linalg.norm(axis, axis=1)
    angle = np.arctan2(sine, ends @ start)
    return np.asarray(
        axis * np.divide(angle, sine, out=np.ones_like(sine), where=sine > 0)[:, None]
    )
