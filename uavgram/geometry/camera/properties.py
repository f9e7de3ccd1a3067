"""Properties of a camera: angles of view, focal length from EXIF, calibration at another size.

Pixels are counted from the centre of the top-left one. Resizing an image therefore keeps its edges,
not its pixel centres: u' + 1/2 = s (u + 1/2).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from uavgram.geometry.camera.lens import largest_radius
from uavgram.geometry.camera.projection import back_project, share_without_rays
from uavgram.model.arrays import NAN_IS_NONE, Floats, FrozenArrays
from uavgram.model.camera import Calibration, CameraTags

_SAME_SHAPE = 0.01  # of width / height: beyond it the image is an unknown crop
_SAME_STEP = 0.05  # relative difference of both resolutions: pixels are square
_SENSORS_MM = (1.0, 100.0)  # of the long side: other values mean a wrong unit

_LARGEST_SHAPE = 1.51  # wider than 3:2: a strip of some sensor


def focal_plane_px(tags: CameraTags) -> tuple[float, float]:
    """Compute the focal length in pixels from EXIF's focal plane resolution.

    The resolution counts pixels of the photo as it was taken (CIPA DC-008): a copy of another size
    has another focal length, by the ratio of the sizes. Where EXIF does not state the size of the
    original, this photo is assumed to be the original.

    Returns
    -------
    Focal length [px], and its relative uncertainty from the difference of the two axes. NaN, NaN
    where EXIF has no such resolution, an impossible one, or one for another shape.
    """
    unknown = math.nan, math.nan
    across, down = tags.focal_plane_per_mm
    long, short = sorted((tags.width_px, tags.height_px), reverse=True)
    first, second = sorted(_original(tags), reverse=True)
    if not all(map(math.isfinite, (across, down, tags.focal_mm))) or tags.digital_zoom > 1:
        return unknown
    apart = abs(across / down - 1)
    is_whole = abs(long / short / (first / second) - 1) <= _SAME_SHAPE
    per_mm = math.sqrt(across * down)
    if apart > _SAME_STEP or not is_whole or not _SENSORS_MM[0] <= first / per_mm <= _SENSORS_MM[1]:
        return unknown
    return tags.focal_mm * per_mm * long / first, apart / 2


def _original(tags: CameraTags) -> tuple[float, float]:
    width, height = tags.original_px
    if math.isfinite(width) and math.isfinite(height):
        return width, height
    return float(tags.width_px), float(tags.height_px)


def equivalent_focal_px(tags: CameraTags, equivalent_mm: float) -> float:
    """Compute the focal length in pixels from its 35 mm equivalent.

    The equivalent refers to the diagonal of the 35 mm frame (CIPA DC-008, FocalLengthIn35mmFilm). A
    photo wider than 3:2 is taken as a strip of a 4:3 sensor of the same width, as it is in both
    such cameras that were examined.
    """
    width, height = sorted((tags.width_px, tags.height_px), reverse=True)
    diagonal_px = math.hypot(width, width * 3 / 4 if is_strip(tags) else height)
    return equivalent_mm / FRAME_35MM_DIAGONAL_MM * diagonal_px


def is_strip(tags: CameraTags) -> bool:
    """Return whether the photo is too wide to be a whole frame of a sensor."""
    width, height = sorted((tags.width_px, tags.height_px), reverse=True)
    return width / height > _LARGEST_SHAPE


def scale_calibration(calibration: Calibration, width_px: int, height_px: int) -> Calibration:
    """Scale a calibration to the same image at another resolution.

    Width and height may be scaled by (slightly) different factors, as happens when sizes are
    rounded to whole pixels.

    Parameters
    ----------
    calibration
        Calibration of the image at its original size.
    width_px, height_px
        Size of the image at the other resolution.
    """
    factor = np.array([width_px / calibration.width_px, height_px / calibration.height_px])
    slope = np.ones(len(calibration.parameters))
    slope[:2], slope[2:4] = factor, factor
    shift = np.zeros(len(slope))
    shift[2:4] = (factor - 1) / 2  # s (c + 1/2) - 1/2 = s c + (s - 1) / 2
    return _linear(calibration, slope, shift, (width_px, height_px))


def crop_calibration(
    calibration: Calibration, left_px: int, top_px: int, width_px: int, height_px: int
) -> Calibration:
    """Convert a calibration to that of a part of the image.

    Parameters
    ----------
    calibration
        Calibration of the whole image.
    left_px, top_px
        Pixel of the whole image that becomes (0, 0).
    width_px, height_px
        Size of the part.

    Raises
    ------
    ValueError
        The part is not inside the image.
    """
    right, bottom = left_px + width_px, top_px + height_px
    if min(left_px, top_px) < 0 or right > calibration.width_px or bottom > calibration.height_px:
        raise ValueError(
            f"the part from ({left_px}, {top_px}) of {width_px} x {height_px} px does not lie "
            f"inside {calibration.width_px} x {calibration.height_px} px"
        )
    shift = np.zeros(len(calibration.parameters))
    shift[2:4] = -left_px, -top_px
    return _linear(calibration, np.ones(len(shift)), shift, (width_px, height_px))


def _linear(
    calibration: Calibration, slope: Floats, shift: Floats, size_px: tuple[int, int]
) -> Calibration:
    """Map the parameters to slope * parameters + shift by element: J = diag(slope)."""
    return replace(
        calibration,
        width_px=size_px[0],
        height_px=size_px[1],
        parameters=slope * calibration.parameters + shift,
        covariance=slope[:, None] * calibration.covariance * slope,
    )


FRAME_35MM_DIAGONAL_MM = math.hypot(36.0, 24.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class CameraProperties(FrozenArrays):
    """Properties derived from a calibration.

    Attributes
    ----------
    field_of_view_rad
        (3,) angles of view across the width, the height and the diagonal, each through the image's
        centre; NaN where the lens model has no rays.
    equivalent_mm
        Focal length referred to the diagonal of a 35 mm frame (CIPA DC-008).
    centre_offset_px, centre_sigma_px
        (2,) principal point from the image's centre, and its sigma.
    corner_distortion_px
        (4,) displacement of the image's corners by distortion, outward positive; NaN where the lens
        model has no rays.
    fold_rad
        Angle from the optical axis at which the lens model folds back; pi / 2 if nowhere.
    share_without_rays
        Share of the image that the lens model cannot invert.
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


def compute_camera_properties(calibration: Calibration) -> CameraProperties:
    """Compute the properties of a camera from its calibration."""
    size = np.array([calibration.width_px, calibration.height_px], dtype=np.float64)
    parameters = calibration.parameters
    sigma = np.sqrt(calibration.covariance.diagonal())
    radius = largest_radius(calibration.model, parameters)
    return CameraProperties(
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
    """Compute the (3,) angles between the rays of opposite edges of the image."""
    middle = (size - 1) / 2
    half = np.array([[size[0], 0.0], [0.0, size[1]], size]) / 2
    rays = [
        back_project(calibration.model, calibration.parameters, middle + side * half)
        for side in (-1, 1)
    ]
    # atan2 is accurate at small angles, arccos is not.
    across = np.linalg.norm(np.cross(rays[0], rays[1]), axis=1)
    return np.asarray(np.arctan2(across, np.sum(rays[0] * rays[1], axis=1)))


def _corner_distortion(calibration: Calibration, size: Floats) -> Floats:
    """Compute the radial displacement of the (4,) image corners by distortion, outward positive.

    It is the distance from the principal point with distortion, less that without.
    """
    corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * size - 0.5
    focal, centre = calibration.parameters[:2], calibration.parameters[2:4]
    ray = back_project(calibration.model, calibration.parameters, corner)
    pinhole = np.linalg.norm(focal * ray[:, :2], axis=1)
    return np.asarray(np.linalg.norm(corner - centre, axis=1) - pinhole)
