"""The same camera for photos that were resized or cropped: parameters and covariance.

Pixels are counted from the centre of the top-left one, so a resized image keeps its edges, not its
pixel centres: u' + 1/2 = s (u + 1/2).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.camera.calibration import Calibration


def scaled(calibration: Calibration, width_px: int, height_px: int) -> Calibration:
    """Calibration of the same image at another resolution.

    Width and height may be scaled by (slightly) different factors, as rounding to whole pixels
    does.

    Parameters
    ----------
    calibration
        Of the image as it was calibrated.
    width_px, height_px
        Size of the image at the other resolution.
    """
    factor = np.array([width_px / calibration.width_px, height_px / calibration.height_px])
    slope = np.ones(len(calibration.parameters))
    slope[:2], slope[2:4] = factor, factor
    shift = np.zeros(len(slope))
    shift[2:4] = (factor - 1) / 2  # s (c + 1/2) - 1/2 = s c + (s - 1) / 2
    return _linear(calibration, slope, shift, (width_px, height_px))


def cropped(
    calibration: Calibration, left_px: int, top_px: int, width_px: int, height_px: int
) -> Calibration:
    """Calibration of a part of the image.

    Parameters
    ----------
    calibration
        Of the whole.
    left_px, top_px
        Pixel of the whole that becomes (0, 0).
    width_px, height_px
        Size of the part.

    Raises
    ------
    ValueError
        The part does not lie inside the image.
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
    """Parameters' = slope * parameters + shift, element by element: J = diag(slope)."""
    return replace(
        calibration,
        width_px=size_px[0],
        height_px=size_px[1],
        parameters=slope * calibration.parameters + shift,
        covariance=slope[:, None] * calibration.covariance * slope,
    )
