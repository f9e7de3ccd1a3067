"""Find the same piece of ground in several photos."""

from __future__ import annotations

import numpy as np

from uavgram.geometry.ground.plane import intersect_ground
from uavgram.geometry.ground.row_projection import RowPoses, project_rows, sight_lines
from uavgram.model.arrays import Floats
from uavgram.model.camera import Calibration

STEP_PX = 8.0
"""Pixel step for the scale between two photos."""


def find_same_ground(
    calibration: Calibration,
    poses: RowPoses,
    plane: tuple[Floats, Floats],
    photo: int,
    pixel_px: tuple[float, float],
) -> tuple[Floats, Floats]:
    """Project the ground under a pixel of one photo to all photos.

    Parameters
    ----------
    calibration
        Calibration of the camera.
    poses
        (F,) poses of the photos.
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
        Number of pixels of each photo for one pixel of the first.
    """
    near = np.array(pixel_px) + STEP_PX * np.array([[0, 0], [1, 0], [0, 1]])
    lens = calibration.parameters
    here = RowPoses(*(part[photo] for part in poses))
    world = intersect_ground(*sight_lines(calibration, lens, here, near), *plane)
    pixel = project_rows(
        calibration, lens, RowPoses(*(part[:, None] for part in poses)), world[None]
    )
    along = (pixel[:, 1:] - pixel[:, :1]) / STEP_PX
    with np.errstate(invalid="ignore"):  # NaN where a photo does not see the ground
        return pixel[:, 0], np.sqrt(np.abs(np.linalg.det(along)))
