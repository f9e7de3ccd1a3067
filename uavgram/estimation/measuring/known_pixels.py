"""Where points with known coordinates appear in photos, and how well that is known."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.estimation.measuring.predicted_pixels import in_photo
from uavgram.geometry.camera.projection import project_with_jacobian
from uavgram.geometry.ground.row_projection import RowPoses, project_rows
from uavgram.geometry.motion.rotation import exp_so3, hat
from uavgram.geometry.motion.row_poses import row_share
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
    calibration: Calibration, poses: Poses, sweep: Floats, known: tuple[Floats, Floats]
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
    sweep
        (F, 6) by which each camera moved while its photo was read; see `RowPoses`.
    known
        (K, 3) points in the world, and their standard deviations [m].
    """
    world_m, sigma_m = known
    pose, point = (
        grid.ravel()
        for grid in np.meshgrid(
            np.arange(len(poses.center_world_m)), np.arange(len(world_m)), indexing="ij"
        )
    )
    center, rotation = poses.center_world_m, poses.world_from_camera
    of_rows = RowPoses(center[pose], rotation[pose], sweep[pose])
    place = project_rows(calibration, calibration.parameters, of_rows, world_m[point])
    shown = np.flatnonzero(in_photo(calibration, place))
    pose, point = pose[shown], point[shown]
    of_row, turn = of_rows.at(row_share(place[:, 1], calibration.height_px))
    from_world = np.swapaxes(rotation[pose] @ exp_so3(turn[shown]), 1, 2)
    camera = np.einsum("nij,nj->ni", from_world, world_m[point] - of_row[shown])
    pixel, d_camera, _ = project_with_jacobian(calibration.model, calibration.parameters, camera)
    d_world = d_camera @ from_world
    d_pose = np.concatenate([-d_world, d_camera @ hat(camera)], axis=2)
    by_pose = d_pose @ poses.covariance[pose] @ np.swapaxes(d_pose, 1, 2)
    by_point = np.einsum("nij,nj,nkj->nik", d_world, sigma_m[point] ** 2, d_world)
    return KnownPixels(pose, point, pixel, by_pose + by_point)
