"""Projection between world and pixels for a rolling shutter: each row has a pose of its own."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.geometry.camera.projection import back_project, project
from uavgram.geometry.motion.camera_motion import compute_row_share, rotate_vector
from uavgram.geometry.motion.rotation import hat
from uavgram.model.arrays import Floats, Ints
from uavgram.model.camera import Calibration
from uavgram.model.result.result import Result

ROW_ITERATIONS = 2
"""Number of fixed-point steps from the row in a pinhole's middle pose to the exposed row.

Distortion of 50 pixels and a sweep of 10 in a photo of 1800 rows leave 0.3 px after one step and
0.002 px after two.
"""


class RowPoses(NamedTuple):
    """Poses of middle rows, and the motion of the camera while one photo is read.

    Attributes
    ----------
    center, rotation
        (..., 3), (..., 3, 3) world from camera.
    sweep
        (..., 6) from first row to last: δcentre in world [m], δθ in camera [rad].
    """

    center: Floats
    rotation: Floats
    sweep: Floats

    def at(self, share: Floats) -> tuple[Floats, Floats]:
        """Compute centres and turns in camera axes (..., 3) of rows by their exposure times."""
        moved = share[..., None] * self.sweep
        return self.center + moved[..., :3], moved[..., 3:]


def row_poses(result: Result, rows: Ints | int) -> RowPoses:
    """Return the adjusted poses of frames of a result."""
    frames = result.frames
    poses = frames.refined
    return RowPoses(poses.center_world_m[rows], poses.world_from_camera[rows], frames.sweep[rows])


def project_rows(
    camera: Calibration,
    parameters: Floats,
    poses: RowPoses,
    world_m: Floats,
    steps: int = ROW_ITERATIONS,
) -> Floats:
    """Project points to (..., 2) pixels, each by the pose of its own row; NaN where impossible.

    Parameters
    ----------
    camera
        Lens model and height of the image.
    parameters
        Parameters of the lens, which may be better known than the calibration's.
    poses
        One for all points, or one for each.
    world_m
        (..., 3) points.
    steps
        Number of fixed-point steps; 1 neglects the effect of distortion on the row: some 0.3 px,
        good enough for pictures.
    """
    in_middle = _rotate_into_camera(poses.rotation, world_m - poses.center)
    if not np.any(poses.sweep):
        return project(camera.model, parameters, in_middle)
    with np.errstate(divide="ignore", invalid="ignore"):
        # Start value: the row in the pinhole of the middle pose; then iterate row -> pose -> row.
        row = parameters[1] * in_middle[..., 1] / in_middle[..., 2] + parameters[3]
    for _ in range(steps):
        share = np.nan_to_num(compute_row_share(row, camera.height_px)).clip(-1.0, 1.0)
        pixel = project(camera.model, parameters, _transfer_to_row(poses, in_middle, share))
        row = pixel[..., 1]
    return pixel


def _transfer_to_row(poses: RowPoses, in_middle: Floats, share: Floats) -> Floats:
    """Convert points (..., 3) from the camera of the middle row to the camera of their row.

    exp(-a w) (y - a R^T v) by Rodrigues' formula, with one small product for each power of w: there
    may be millions of points.
    """
    turn = poses.sweep[..., 3:]
    angle = np.linalg.norm(turn, axis=-1) * share
    back = hat(turn)
    point = in_middle - share[..., None] * _rotate_into_camera(poses.rotation, poses.sweep[..., :3])
    # First and second power of -w x, with Rodrigues' coefficients.
    once = _rotate_into_camera(back, point)  # -w x y
    twice = _rotate_into_camera(back, once)
    once *= (share * np.sinc(angle / np.pi))[..., None]
    twice *= (0.5 * (share * np.sinc(angle / (2 * np.pi))) ** 2)[..., None]
    point += once
    point += twice
    return np.asarray(point)


def sight_lines(
    camera: Calibration, parameters: Floats, poses: RowPoses, pixel_px: Floats
) -> tuple[Floats, Floats]:
    """Compute origins (..., 3) and world directions of the lines of sight of pixels.

    Parameters
    ----------
    camera
        Lens model and height of the image.
    parameters
        Parameters of the lens, which may be better known than the calibration's.
    poses
        One for all pixels, or one for each.
    pixel_px
        (..., 2).
    """
    ray = back_project(camera.model, parameters, pixel_px)
    center, turn = poses.at(compute_row_share(pixel_px[..., 1], camera.height_px))
    ray = rotate_vector(turn, ray) if np.any(poses.sweep) else ray
    return center, np.asarray((poses.rotation @ ray[..., None])[..., 0])


def _rotate_into_camera(rotation: Floats, from_center: Floats) -> Floats:
    """Rotate vectors (..., 3) from the centre into camera axes."""
    if rotation.ndim == 2:
        return np.asarray(from_center @ rotation)
    return np.asarray((np.swapaxes(rotation, -1, -2) @ from_center[..., None])[..., 0])
