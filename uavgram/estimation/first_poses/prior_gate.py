"""Which poses from lengths alone the telemetry allows: its height and its level against theirs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from uavgram.estimation.first_poses.length_poses import LengthPoses
from uavgram.geometry.motion.rotation import exp_so3
from uavgram.model.arrays import Bools, Floats
from uavgram.model.survey.survey import Ground

OUTSIDE = 0.001
"""Probability with which a true pose falls outside the gate."""

HEIGHT, TILT = 0, slice(1, 3)


class SeedComparison(NamedTuple):
    """C candidate planes of one frame against its seed.

    Attributes
    ----------
    squared_distance
        (C,) squared Mahalanobis distances.
    shift
        (C, 3) how far each candidate pulls the seed to where both together put the pose, each with
        its weight: in height [m], and in two tilts [rad].
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
    """Compare poses that lengths allow with the one that the telemetry gives.

    Three numbers are compared: the height above the ground, and the two by which the direction of
    down in the camera differs; along the ground and in heading lengths say nothing.

    Parameters
    ----------
    center_world_m, world_from_camera, covariance
        (3,), (3, 3), (6, 6) of the seed, with all that the telemetry's shared unknowns add.
    ground
        The plane beforehand; its sigmas widen the gate.
    poses
        Of that frame, C candidates that came to rest, with their own covariances.
    """
    down = -world_from_camera[2]
    size = np.linalg.norm(poses.plane, axis=1)
    normal = poses.plane / size[:, None]
    # Two directions in the camera, at right angles to the seed's down.
    sideways = np.asarray(np.linalg.svd(down[None]).Vh[1:])
    seed_height = center_world_m[2] - ground.height_m
    turn = _turn(down, normal)
    difference = np.column_stack([1.0 / size - seed_height, turn @ sideways.T])
    # The seed: R exp(a) sees down turned by -a, and only the part across it counts.
    by_pose = np.zeros((3, 6))
    by_pose[HEIGHT, 2] = 1.0
    by_pose[TILT, 3:] = -sideways
    prior = by_pose @ covariance @ by_pose.T
    prior[HEIGHT, HEIGHT] += ground.height_sigma_m**2
    prior[TILT, TILT] += ground.slope_sigma_rad**2 * np.eye(2)
    # The candidate: m = n / h, so dh = -h^2 (n . dm), and n turns by h (n x dm).
    by_plane = np.empty((len(normal), 3, 3))
    by_plane[:, HEIGHT] = -normal / size[:, None] ** 2
    across = np.cross(normal[:, None], np.eye(3)[None]) / size[:, None, None]
    by_plane[:, TILT] = np.einsum("ti,cji->ctj", sideways, across)
    own = by_plane @ poses.covariance[:, :3, :3] @ by_plane.swapaxes(1, 2)
    weighted = np.linalg.solve(prior + own, difference[..., None])
    return SeedComparison(np.sum(difference * weighted[..., 0], axis=1), (prior @ weighted)[..., 0])


def allowed(squared_distance: Floats) -> Bools:
    """(C,) whether candidates lie inside the gate (chi-square of three)."""
    return np.asarray(squared_distance <= float(chdtri(3, OUTSIDE)))


def seed_on_plane(
    center_world_m: Floats, world_from_camera: Floats, ground: Ground, plane: Floats
) -> tuple[Floats, Floats]:
    """The seed with the height and the level of a candidate plane (3,); the rest as it was.

    Parameters
    ----------
    center_world_m, world_from_camera
        (3,), (3, 3) of the seed.
    ground
        The plane beforehand, for its height.
    plane
        (3,) m = normal / height in the camera frame [1/m].
    """
    size = np.linalg.norm(plane)
    center = center_world_m.copy()
    center[2] = ground.height_m + 1.0 / size
    # R exp(a) sees the candidate's down where R saw the seed's.
    turn = _turn(-world_from_camera[2], (plane / size)[None])
    return center, world_from_camera @ exp_so3(-turn)[0]


def _turn(start: Floats, ends: Floats) -> Floats:
    """Rotation vectors (C, 3) that bring a unit vector (3,) onto others (C, 3) the short way."""
    axis = np.cross(start, ends)
    sine = np.linalg.norm(axis, axis=1)
    angle = np.arctan2(sine, ends @ start)
    return np.asarray(
        axis * np.divide(angle, sine, out=np.ones_like(sine), where=sine > 0)[:, None]
    )
