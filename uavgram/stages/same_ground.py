"""The same piece of ground in several photos."""

from __future__ import annotations

import numpy as np

from uavgram.geometry.camera.back_projection import back_project
from uavgram.geometry.camera.projection import project
from uavgram.geometry.ground.plane import intersect_ground
from uavgram.model.arrays import Floats
from uavgram.model.camera.calibration import Calibration
from uavgram.model.flight.pose import Poses

STEP_PX = 8.0
"""By which the scale between two photos is found."""


def same_ground(
    calibration: Calibration,
    poses: Poses,
    plane: tuple[Floats, Floats],
    photo: int,
    pixel_px: tuple[float, float],
) -> tuple[Floats, Floats]:
    """Where the ground under a pixel of one photo lies in all photos.

    Parameters
    ----------
    calibration
        Of the camera.
    poses
        (F,) of the photos.
    plane
        Height [m] and slopes (3,) of the ground, and the pivot (2,) of the slopes [m].
    photo
        Row of the photo in `poses`.
    pixel_px
        The pixel in it.

    Returns
    -------
    pixel_px : (F, 2)
        Perhaps outside the photo; NaN where it does not see the ground.
    scale : (F,)
        How many pixels of that photo are one of the first there.
    """
    near = np.array(pixel_px) + STEP_PX * np.array([[0, 0], [1, 0], [0, 1]])
    ray = back_project(calibration.model, calibration.parameters, near)
    center, rotation = poses.center_world_m, poses.world_from_camera
    world = intersect_ground(center[photo], ray @ rotation[photo].T, *plane)
    camera = np.einsum("fji,fnj->fni", rotation, world[None] - center[:, None])
    pixel = project(calibration.model, calibration.parameters, camera)
    along = (pixel[:, 1:] - pixel[:, :1]) / STEP_PX
    with np.errstate(invalid="ignore"):  # NaN where a photo does not see the ground
        return pixel[:, 0], np.sqrt(np.abs(np.linalg.det(along)))
