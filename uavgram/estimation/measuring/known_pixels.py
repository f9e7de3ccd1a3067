"""Where points with known coordinates appear in photos, and how well that is known."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.estimation.measuring.predicted_pixels import shown_in_photo
from uavgram.geometry.camera.projection import project_with_jacobian
from uavgram.geometry.motion.rotation import hat
from uavgram.model.arrays import Floats, Ints
from uavgram.model.camera.calibration import Calibration
from uavgram.model.flight.pose import Poses


class KnownPixels(NamedTuple):
    """N pairs of pose (N,) and point (N,), with the pixel (N, 2) and its covariance (N, 2, 2).

    Pixels in px, covariances in px^2; poses and points by their rows.
    """

    pose: Ints
    point: Ints
    pixel_px: Floats
    covariance_px2: Floats


def pixels_of_known_points(
    calibration: Calibration, poses: Poses, world_m: Floats, sigma_m: Floats
) -> KnownPixels:
    """Every known point in every photo that should show it.

    The covariance is that of the pose and of the known point, taken as independent of each other,
    and of the lens as exact: good enough to look there, which is all that it is for.

    Parameters
    ----------
    calibration
        Of the photos.
    poses
        (F,) poses.
    world_m, sigma_m
        (K, 3) points in the world, and their standard deviations.
    """
    pose, point = (
        grid.ravel()
        for grid in np.meshgrid(
            np.arange(len(poses.center_world_m)), np.arange(len(world_m)), indexing="ij"
        )
    )
    center, rotation = poses.center_world_m, poses.world_from_camera
    shown = shown_in_photo(
        calibration, calibration.parameters, world_m[point], center[pose], rotation[pose]
    )
    pose, point = pose[shown], point[shown]
    from_world = np.swapaxes(rotation, 1, 2)[pose]
    camera = np.einsum("nij,nj->ni", from_world, world_m[point] - center[pose])
    pixel, d_camera, _ = project_with_jacobian(calibration.model, calibration.parameters, camera)
    d_world = d_camera @ from_world
    d_pose = np.concatenate([-d_world, d_camera @ hat(camera)], axis=2)
    by_pose = d_pose @ poses.covariance[pose] @ np.swapaxes(d_pose, 1, 2)
    by_point = np.einsum("nij,nj,nkj->nik", d_world, sigma_m[point] ** 2, d_world)
    return KnownPixels(pose, point, pixel, by_pose + by_point)
