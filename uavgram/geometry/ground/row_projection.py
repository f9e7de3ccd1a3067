"""From the world to pixels and back, where every row of a photo has a pose of its own."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.geometry.camera.back_projection import back_project
from uavgram.geometry.camera.projection import project
from uavgram.geometry.motion.camera_motion import row_share, turned_vector
from uavgram.geometry.motion.rotation import hat
from uavgram.model.arrays import Floats, Ints
from uavgram.model.camera.calibration import Calibration
from uavgram.model.result.result import Result

STEPS = 2
"""From a point's row in a pinhole's middle pose to its own. Distortion of 50 pixels and a sweep of
10 in a photo of 1800 rows leave 0.3 px after one step and 0.002 px after two."""


class RowPoses(NamedTuple):
    """Poses of middle rows, and how the camera moves while one photo is read.

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
        """Centres (..., 3), and turns (..., 3) in camera axes, of rows by their `row_share`."""
        moved = share[..., None] * self.sweep
        return self.center + moved[..., :3], moved[..., 3:]


def row_poses(result: Result, rows: Ints | int) -> RowPoses:
    """Adjusted poses of frames of a result."""
    frames = result.frames
    poses = frames.refined
    return RowPoses(poses.center_world_m[rows], poses.world_from_camera[rows], frames.sweep[rows])


def project_rows(
    camera: Calibration, parameters: Floats, poses: RowPoses, world_m: Floats, steps: int = STEPS
) -> Floats:
    """(..., 2) pixels of points, each by the pose of its own row; NaN where there is none.

    Parameters
    ----------
    camera
        Lens model and height of the image.
    parameters
        Of the lens, where they are better known than the calibration's.
    poses
        One for all points, or one for each.
    world_m
        (..., 3) points.
    steps
        1 leaves what the lens's distortion does to the row: some 0.3 px, for pictures.
    """
    in_middle = _seen(poses.rotation, world_m - poses.center)
    if not np.any(poses.sweep):
        return project(camera.model, parameters, in_middle)
    with np.errstate(divide="ignore", invalid="ignore"):
        row = parameters[1] * in_middle[..., 1] / in_middle[..., 2] + parameters[3]
    for _ in range(steps):
        share = np.nan_to_num(row_share(row, camera.height_px)).clip(-1.0, 1.0)
        pixel = project(camera.model, parameters, _moved_back(poses, in_middle, share))
        row = pixel[..., 1]
    return pixel


def _moved_back(poses: RowPoses, in_middle: Floats, share: Floats) -> Floats:
    """(..., 3) points in the camera of their row, from those in the camera of the middle row.

    exp(-a w) (y - a R^T v) by Rodrigues' formula, with one small product for each power of w:
    there may be millions of points.
    """
    turn = poses.sweep[..., 3:]
    angle = np.linalg.norm(turn, axis=-1) * share
    back = hat(turn)
    point = in_middle - share[..., None] * _seen(poses.rotation, poses.sweep[..., :3])
    once = _seen(back, point)  # -w x y
    twice = _seen(back, once)
    once *= (share * np.sinc(angle / np.pi))[..., None]
    twice *= (0.5 * (share * np.sinc(angle / (2 * np.pi))) ** 2)[..., None]
    point += once
    point += twice
    return np.asarray(point)


def sight_lines(
    camera: Calibration, parameters: Floats, poses: RowPoses, pixel_px: Floats
) -> tuple[Floats, Floats]:
    """Where the lines of sight of pixels begin, (..., 3), and their directions in the world.

    Parameters
    ----------
    camera
        Lens model and height of the image.
    parameters
        Of the lens, where they are better known than the calibration's.
    poses
        One for all pixels, or one for each.
    pixel_px
        (..., 2).
    """
    ray = back_project(camera.model, parameters, pixel_px)
    center, turn = poses.at(row_share(pixel_px[..., 1], camera.height_px))
    ray = turned_vector(turn, ray) if np.any(poses.sweep) else ray
    return center, np.asarray((poses.rotation @ ray[..., None])[..., 0])


def _seen(rotation: Floats, from_center: Floats) -> Floats:
    """(..., 3) in camera axes."""
    if rotation.ndim == 2:
        return np.asarray(from_center @ rotation)
    return np.asarray((np.swapaxes(rotation, -1, -2) @ from_center[..., None])[..., 0])
