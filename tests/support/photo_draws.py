"""One photo of a scene with known lengths, drawn many times; projections are OpenCV's."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from uavgram.estimation.first_poses.photo_problem import Photos, SharedErrors
from uavgram.model.arrays import Floats
from uavgram.model.camera import Calibration

CAMERA = np.array([2250.0, 2252.0, 2003.0, 1497.0, -0.06, 0.02, 3e-4, -2e-4, 0.0])
POSE_SIGMA = np.array([2.0, 2.0, 3.0, *np.deg2rad([2.0, 2.0, 4.0])])
PIXEL_SIGMA_PX, LENGTH_SIGMA_M = 0.8, 0.01
HEIGHT_M = 32.0


class Scene(NamedTuple):
    """What is shared, the draws, the true pose and the true ends."""

    shared: SharedErrors
    draws: Photos
    center: Floats
    rotation: Floats
    ends_m: Floats


def photo_scene(count: int, seed: int = 1, *, slope: bool = False, joined: bool = False) -> Scene:
    """Six lengths in one photo.

    Parameters
    ----------
    count
        Of the draws.
    seed
        Of scene and draws.
    slope
        Whether the ground slopes, and some ends stand above it.
    joined
        Whether lengths share their ends.
    """
    rng = np.random.default_rng(seed)
    line = np.arange(12).reshape(6, 2)
    if joined:
        line = np.array([[0, 1], [1, 2], [2, 3], [3, 0], [0, 2], [4, 1]])
    ends = int(line.max()) + 1
    ground = np.array([0.7, 0.05, -0.03]) if slope else np.zeros(3)
    above = rng.uniform(0.0, 1.0, ends) if slope else np.zeros(ends)
    place = rng.uniform([-14.0, -10.0], [14.0, 10.0], (ends, 2))
    world = np.column_stack([place, ground[0] + place @ ground[1:] + above])
    center = np.array([1.0, -6.0, HEIGHT_M])
    down = np.diag([1.0, -1.0, -1.0])
    rotation = down @ Rotation.from_rotvec(np.deg2rad([12.0, 3.0, 20.0])).as_matrix()
    pixel = seen_by_opencv(world, center, rotation)
    drawn = POSE_SIGMA * rng.standard_normal((count, 6))
    length = np.linalg.norm(world[line[:, 1]] - world[line[:, 0]], axis=1)
    camera = Calibration(
        name="camera",
        model="brown",
        width_px=4000,
        height_px=3000,
        parameters=CAMERA,
        covariance=np.zeros((9, 9)),
    )
    draws = Photos(
        pixel_px=pixel + PIXEL_SIGMA_PX * rng.standard_normal((count, ends, 2)),
        pixel_weight=np.full((count, ends), 1.0 / PIXEL_SIGMA_PX),
        height_m=np.tile(above, (count, 1)),
        ground=np.repeat(ground[None], count, axis=0),
        center=center + drawn[:, :3],
        # true = beforehand @ exp(error)
        rotation=rotation @ Rotation.from_rotvec(-drawn[:, 3:]).as_matrix(),
        information=np.tile(np.diag(POSE_SIGMA**-2), (count, 1, 1)),
        line=np.tile(line, (count, 1, 1)),
        toward=np.zeros((count, 0, 2)),
        placed=np.zeros((count, 0), np.int64),
        reading_m=length + LENGTH_SIGMA_M * rng.standard_normal((count, len(line))),
        reading_weight=np.full((count, len(line)), 1.0 / LENGTH_SIGMA_M),
    )
    return Scene(SharedErrors(camera), draws, center, rotation, world)


def seen_by_opencv(world: Floats, center: Floats, rotation: Floats) -> Floats:
    """(n, 2) pixels of (n, 3) points."""
    turn, _ = cv2.Rodrigues(rotation.T)
    matrix = np.array([[CAMERA[0], 0, CAMERA[2]], [0, CAMERA[1], CAMERA[3]], [0, 0, 1.0]])
    pixel, _ = cv2.projectPoints(world, turn, -rotation.T @ center, matrix, CAMERA[4:])
    return np.asarray(pixel[:, 0], dtype=np.float64)


def residuals(scene: Scene, draw: int, unknown: Floats) -> Floats:
    """Whitened residuals of one draw: unknown are centre, rotation vector and the ends' places.

    The rotation vector is that from the pose beforehand.
    """
    draws = scene.draws
    line = draws.line[draw]
    center, place = unknown[:3], unknown[6:].reshape(-1, 2)
    rotation = draws.rotation[draw] @ Rotation.from_rotvec(unknown[3:6]).as_matrix()
    ground = draws.ground[draw]
    up = ground[0] + place @ ground[1:] + draws.height_m[draw]
    world = np.column_stack([place, up])
    error = (seen_by_opencv(world, center, rotation) - draws.pixel_px[draw]) / PIXEL_SIGMA_PX
    length = np.linalg.norm(world[line[:, 1]] - world[line[:, 0]], axis=1)
    off = (length - draws.reading_m[draw]) / LENGTH_SIGMA_M
    apart = np.concatenate([center - draws.center[draw], unknown[3:6]]) / POSE_SIGMA
    return np.concatenate([error.ravel(), off, apart])


def start_of(scene: Scene, draw: int) -> Floats:
    """The truth as a vector of the unknowns of `residuals`."""
    before = scene.draws.rotation[draw]
    turn = Rotation.from_matrix(before.T @ scene.rotation).as_rotvec()
    return np.concatenate([scene.center, turn, scene.ends_m[:, :2].ravel()])
