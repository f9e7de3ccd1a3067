"""OpenCV's corner search by gradients, for corners wherever they lie: also at the edge."""

from __future__ import annotations

import cv2
import numpy as np

from uavgram.imaging.raster import Image
from uavgram.model.arrays import Floats

_OPENCV_MARGIN_PX = 5  # cv2.cornerSubPix asks for images this much larger than its window


def search_corners(
    image: Image, start_px: Floats, half_px: int, iterations: int, converged_px: float
) -> Floats:
    """(N, 2) corners near first places; NaN where there is no image to search in.

    cv2.cornerSubPix ends in an error, and finds none of the corners, where a single one starts
    outside the image or is not finite, and where the window does not fit into the image.

    Parameters
    ----------
    image
        (height, width) grey.
    start_px
        (N, 2) first places.
    half_px
        The window has 2 half_px + 1 pixels each way.
    iterations, converged_px
        When to stop.
    """
    height, width = image.shape
    corner = np.full(start_px.shape, np.nan)
    # in the precision that OpenCV sees: 639.99999999 is 640, and outside
    start = start_px.astype(np.float32)
    inside = ((start >= 0) & (start < [width, height])).all(axis=1)  # False for NaN
    if not inside.any() or min(height, width) < 2 * half_px + _OPENCV_MARGIN_PX:
        return corner
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, iterations, converged_px)
    points = np.ascontiguousarray(start[inside]).reshape(-1, 1, 2)
    found = cv2.cornerSubPix(image, points, (half_px, half_px), (-1, -1), criteria)
    corner[inside] = np.asarray(found, np.float64).reshape(-1, 2)
    return corner
