"""Visibility in a photo: marks inside its edge, plates of sufficient size, the horizon."""

from __future__ import annotations

import numpy as np

from uavgram.geometry.camera.projection import back_project
from uavgram.model.arrays import Bools, Floats
from uavgram.model.camera import Calibration
from uavgram.model.naming import MIN_SIDE_PX, PLATE_CORNERS

EDGE_PX = 12.0
"""Distance from the photo's edge within which marks are not picked."""

MIN_SINE_BELOW_HORIZON = 0.05
"""Smallest sine of the angle below the horizon at which measuring is possible: 3 degrees."""


def is_inside(camera: Calibration, pixel_px: Floats, room_px: Floats | float = 0.0) -> Bools:
    """Return a mask of pixels (..., 2) that are at least `EDGE_PX` inside a photo's edge.

    Parameters
    ----------
    camera
        Camera of the photos.
    pixel_px
        NaN for points that are not visible.
    room_px
        (..., 2) additional distance from the edge.
    """
    low = EDGE_PX + room_px
    high = np.array([camera.width_px, camera.height_px]) - 1.0 - EDGE_PX - room_px
    with np.errstate(invalid="ignore"):
        return np.asarray(np.all((pixel_px > low) & (pixel_px < high), axis=-1))


def find_large_plates(corner_px: Floats) -> Bools:
    """Return a mask of corners (F, 4N) of plates that are large enough in a photo to be found.

    `corner_px` is (F, 4N, 2), plate by plate.
    """
    corner = corner_px.reshape(len(corner_px), -1, PLATE_CORNERS, 2)
    side = np.linalg.norm(np.roll(corner, -1, axis=2) - corner, axis=-1)
    with np.errstate(invalid="ignore"):
        return np.repeat(side.min(axis=2) >= MIN_SIDE_PX, PLATE_CORNERS, axis=1)


def compute_corner_rays(camera: Calibration, intrinsics: Floats, rotation: Floats) -> Floats:
    """Return unit vectors (F, 4, 3) in the world of a photo's corners.

    Parameters
    ----------
    camera, intrinsics
        Size and lens model; its parameters.
    rotation
        (F, 3, 3) of the camera in the world.
    """
    w, h = camera.width_px - 1.0, camera.height_px - 1.0
    corner = np.array([[0.0, 0.0], [w, 0.0], [0.0, h], [w, h]])
    ray = back_project(camera.model, intrinsics, corner)
    ray = ray / np.linalg.norm(ray, axis=1, keepdims=True)
    return np.asarray(np.einsum("fij,kj->fki", rotation, ray))


def shows_horizon(ray: Floats, slope: Floats) -> Bools:
    """Return a mask of photos (F,) with a corner that looks along the ground, or upwards.

    Parameters
    ----------
    ray
        (F, 4, 3) of the corners, in the world; NaN beyond the lens model.
    slope
        (2,) of the ground to the east and to the north.
    """
    above = ray @ [*-slope, 1.0]
    return np.asarray((np.isnan(above) | (above > -MIN_SINE_BELOW_HORIZON)).any(axis=1))
