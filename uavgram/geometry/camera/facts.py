"""What a calibration means in words that a person can check: angles, millimetres, pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from uavgram.geometry.camera.back_projection import back_project, share_without_rays
from uavgram.geometry.camera.lens import largest_radius
from uavgram.model.arrays import NAN_IS_NONE, Floats, FrozenArrays
from uavgram.model.camera.calibration import Calibration

FRAME_35MM_DIAGONAL_MM = math.hypot(36.0, 24.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class CameraFacts(FrozenArrays):
    """Figures that follow from a calibration.

    Attributes
    ----------
    field_of_view_rad
        (3,) across the width, the height and the diagonal, each through the image's centre; NaN
        where the lens model has no rays.
    equivalent_mm
        Focal length over a 35 mm frame's diagonal (CIPA DC-008).
    centre_offset_px, centre_sigma_px
        (2,) principal point from the image's centre, and its sigma.
    corner_distortion_px
        (4,) how far distortion moves the image's corners, outward positive; NaN where the lens
        model has no rays.
    fold_rad
        Angle from the optical axis at which the lens model folds back; pi / 2 if nowhere.
    share_without_rays
        Part of the image that the lens model cannot invert.
    correlation
        (P, P); zero where a parameter has no error.
    """

    field_of_view_rad: Annotated[Floats, 3, NAN_IS_NONE]
    equivalent_mm: float
    centre_offset_px: Annotated[Floats, 2]
    centre_sigma_px: Annotated[Floats, 2]
    corner_distortion_px: Annotated[Floats, 4, NAN_IS_NONE]
    fold_rad: float
    share_without_rays: float
    correlation: Annotated[Floats, "n", "n"]


def camera_facts(calibration: Calibration) -> CameraFacts:
    """Work out what a calibration means."""
    size = np.array([calibration.width_px, calibration.height_px], dtype=np.float64)
    parameters = calibration.parameters
    sigma = np.sqrt(calibration.covariance.diagonal())
    radius = largest_radius(calibration.model, parameters)
    return CameraFacts(
        field_of_view_rad=_field_of_view(calibration, size),
        equivalent_mm=float(
            parameters[:2].mean() / np.hypot(*size) * FRAME_35MM_DIAGONAL_MM,
        ),
        centre_offset_px=parameters[2:4] - (size - 1) / 2,
        centre_sigma_px=sigma[2:4],
        corner_distortion_px=_corner_distortion(calibration, size),
        fold_rad=math.atan(radius),
        share_without_rays=share_without_rays(
            calibration.model, parameters, calibration.width_px, calibration.height_px
        ),
        correlation=calibration.correlation,
    )


def _field_of_view(calibration: Calibration, size: Floats) -> Floats:
    """(3,) angles between the rays of opposite edges of the image."""
    middle = (size - 1) / 2
    half = np.array([[size[0], 0.0], [0.0, size[1]], size]) / 2
    rays = [
        back_project(calibration.model, calibration.parameters, middle + side * half)
        for side in (-1, 1)
    ]
    # atan2 keeps its digits at small angles, arccos does not.
    across = np.linalg.norm(np.cross(rays[0], rays[1]), axis=1)
    return np.asarray(np.arctan2(across, np.sum(rays[0] * rays[1], axis=1)))


def _corner_distortion(calibration: Calibration, size: Floats) -> Floats:
    """(4,) distance from the principal point, with distortion minus without."""
    corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * size - 0.5
    focal, centre = calibration.parameters[:2], calibration.parameters[2:4]
    ray = back_project(calibration.model, calibration.parameters, corner)
    pinhole = np.linalg.norm(focal * ray[:, :2], axis=1)
    return np.asarray(np.linalg.norm(corner - centre, axis=1) - pinhole)
