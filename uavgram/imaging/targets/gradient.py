"""Sub-pixel corners from grey value gradients alone: the point that all edges lead to.

Foerstner's operator (Foerstner and Guelch 1987): the corner c minimises the sum of (g . (x - c))^2
over the window, with the gradient g in x. It assumes nothing about the edges' shape, and uses less
of the image than the fit of a saddle where the model of that fit holds.
"""

from __future__ import annotations

import cv2
import numpy as np

from uavgram.imaging.patches import compute_slopes
from uavgram.imaging.raster import Image
from uavgram.imaging.targets.saddle import Windows
from uavgram.model.arrays import Floats

ITERATIONS = 100
_CONVERGED_PX = 1e-3
_OPENCV_MARGIN_PX = 5  # cv2.cornerSubPix asks for images this much larger than its window


def measure_gradient_corners(
    image: Image, windows: Windows, start_px: Floats, noise: Floats
) -> tuple[Floats, Floats]:
    """Measure corners by their gradients.

    Parameters
    ----------
    image
        (height, width) grey.
    windows
        Windows of N corners, about `start_px`.
    start_px
        (N, 2) corners to a pixel.
    noise
        (N,) standard deviation of the grey values.

    Returns
    -------
    pixel_px : (N, 2)
        OpenCV's form of the operator (cv2.cornerSubPix); NaN outside the image.
    covariance_px2 : (N, 2, 2)
        White noise of the grey values propagated through gradients and operator.
    """
    if not len(start_px):
        return np.empty((0, 2)), np.empty((0, 2, 2))
    side = round(len(windows.offset_px) ** 0.5)
    half = side // 2
    corner = search_corners(image, start_px, half, ITERATIONS, _CONVERGED_PX)
    grey = windows.grey.reshape(-1, side, side)
    edge = (0, 0), (1, 1), (1, 1), (0, 0)  # no gradients at the edge
    gradient = np.pad(np.stack(compute_slopes(grey), axis=-1), edge)
    offset = windows.offset_px.reshape(side, side, 2)
    away = offset - (corner - windows.center_px)[:, None, None]
    bell = np.exp(-(away**2).sum(axis=-1) / half**2)  # OpenCV's weights
    normal = np.einsum("nvu,nvui,nvuj->nij", bell, gradient, gradient)
    normal += (1e-9 * np.trace(normal, axis1=1, axis2=2) + 1e-12)[:, None, None] * np.eye(2)
    return corner, _covariance(gradient, away, bell, normal, noise)


def _covariance(
    gradient: Floats, away: Floats, bell: Floats, normal: Floats, noise: Floats
) -> Floats:
    """Compute covariances (N, 2, 2): first-order effect of each grey value, times the noise."""
    # d pull = bell (dg (g . away) + g (dg . away)) per pixel, with dg the change of its gradient
    miss = (gradient * away).sum(axis=-1)
    by_gradient = gradient[..., :, None] * away[..., None, :]
    by_gradient += miss[..., None, None] * np.eye(2)
    by_gradient *= bell[..., None, None]
    # g is half the difference of the two neighbours: each grey value enters two gradients
    by_grey = np.zeros(by_gradient.shape[:-1])
    by_grey[:, :, 1:] += 0.5 * by_gradient[:, :, :-1, :, 0]
    by_grey[:, :, :-1] -= 0.5 * by_gradient[:, :, 1:, :, 0]
    by_grey[:, 1:] += 0.5 * by_gradient[:, :-1, :, :, 1]
    by_grey[:, :-1] -= 0.5 * by_gradient[:, 1:, :, :, 1]
    inner = np.einsum("nvui,nvuj->nij", by_grey, by_grey) * (noise**2)[:, None, None]
    inverse = np.linalg.inv(normal)
    return np.asarray(inverse @ inner @ inverse, np.float64)


def search_corners(
    image: Image, start_px: Floats, half_px: int, iterations: int, converged_px: float
) -> Floats:
    """Search corners (N, 2) near start values; NaN where the search is impossible.

    cv2.cornerSubPix raises an error for all corners where a single one starts outside the image or
    is not finite, and where the window does not fit into the image.

    Parameters
    ----------
    image
        (height, width) grey.
    start_px
        (N, 2) start values.
    half_px
        The window has 2 half_px + 1 pixels each way.
    iterations, converged_px
        Limits of the iteration.
    """
    height, width = image.shape
    corner = np.full(start_px.shape, np.nan)
    # in OpenCV's single precision: 639.99999999 becomes 640, which is outside
    start = start_px.astype(np.float32)
    inside = ((start >= 0) & (start < [width, height])).all(axis=1)  # False for NaN
    if not inside.any() or min(height, width) < 2 * half_px + _OPENCV_MARGIN_PX:
        return corner
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, iterations, converged_px)
    points = np.ascontiguousarray(start[inside]).reshape(-1, 1, 2)
    found = cv2.cornerSubPix(image, points, (half_px, half_px), (-1, -1), criteria)
    corner[inside] = np.asarray(found, np.float64).reshape(-1, 2)
    return corner
