"""OpenCV's undistortion, iterated long enough: the argument moved between its versions."""

from __future__ import annotations

import cv2
import numpy as np

from uavgram.model.arrays import Floats

_LONG_ENOUGH = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 200, 1e-14)


def undistort(pixel: Floats, matrix: Floats, distortion: Floats) -> Floats:
    """(N, 1, 2) points on the plane z = 1 of (N, 1, 2) pixels."""
    if hasattr(cv2, "undistortPointsIter"):  # OpenCV 4
        rays = cv2.undistortPointsIter(pixel, matrix, distortion, None, None, _LONG_ENOUGH)
    else:
        rays = cv2.undistortPoints(pixel, matrix, distortion, criteria=_LONG_ENOUGH)
    return np.asarray(rays, np.float64)
