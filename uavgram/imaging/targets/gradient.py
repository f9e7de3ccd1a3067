"""Sub-pixel corners from grey value gradients alone: the point that all edges lead to.

Foerstner's operator (Foerstner and Guelch 1987): the corner c minimises the sum of
(g . (x - c))^2 over the window, g the gradient in x. It assumes nothing of the edges' shape, and
uses less of the image than the fit of a saddle where that fit's model holds.
"""

from __future__ import annotations

import numpy as np

from uavgram.imaging.raster import Image
from uavgram.imaging.targets.saddle import Windows
from uavgram.imaging.targets.sub_pixel import search_corners
from uavgram.model.arrays import Floats

ITERATIONS = 100
_CONVERGED_PX = 1e-3


def gradient_corners(
    image: Image, windows: Windows, start_px: Floats, noise: Floats
) -> tuple[Floats, Floats]:
    """Corners by their gradients.

    Parameters
    ----------
    image
        (height, width) grey.
    windows
        Of N corners, about `start_px`.
    start_px
        (N, 2) corners to a pixel.
    noise
        (N,) standard deviation of the grey values.

    Returns
    -------
    pixel_px : (N, 2)
        OpenCV's form of the operator (cv2.cornerSubPix); NaN outside the image.
    covariance_px2 : (N, 2, 2)
        White noise of the grey values carried through gradients and operator.
    """
    if not len(start_px):
        return np.empty((0, 2)), np.empty((0, 2, 2))
    side = round(len(windows.offset_px) ** 0.5)
    half = side // 2
    corner = search_corners(image, start_px, half, ITERATIONS, _CONVERGED_PX)
    grey = windows.grey.reshape(-1, side, side)
    gradient = np.stack(np.gradient(grey, axis=(2, 1)), axis=-1)
    gradient[:, [0, -1]] = gradient[:, :, [0, -1]] = 0.0  # one-sided differences are no gradients
    offset = windows.offset_px.reshape(side, side, 2)
    away = offset - (corner - windows.center_px)[:, None, None]
    bell = np.exp(-(away**2).sum(axis=-1) / half**2)  # OpenCV's weights
    normal = np.einsum("nvu,nvui,nvuj->nij", bell, gradient, gradient)
    normal += (1e-9 * np.trace(normal, axis1=1, axis2=2) + 1e-12)[:, None, None] * np.eye(2)
    return corner, _covariance(gradient, away, bell, normal, noise)


def _covariance(
    gradient: Floats, away: Floats, bell: Floats, normal: Floats, noise: Floats
) -> Floats:
    """(N, 2, 2): first-order change of the corner by each grey value, times their noise."""
    # d pull = bell (dg (g . away) + g (dg . away)) per pixel, dg the change of its gradient
    miss = (gradient * away).sum(axis=-1)
    by_gradient = gradient[..., :, None] * away[..., None, :]
    by_gradient += miss[..., None, None] * np.eye(2)
    by_gradient *= bell[..., None, None]
    # g is the half difference of the two neighbours: each grey value enters two gradients
    by_grey = np.zeros(by_gradient.shape[:-1])
    by_grey[:, :, 1:] += 0.5 * by_gradient[:, :, :-1, :, 0]
    by_grey[:, :, :-1] -= 0.5 * by_gradient[:, :, 1:, :, 0]
    by_grey[:, 1:] += 0.5 * by_gradient[:, :-1, :, :, 1]
    by_grey[:, :-1] -= 0.5 * by_gradient[:, 1:, :, :, 1]
    inner = np.einsum("nvui,nvuj->nij", by_grey, by_grey) * (noise**2)[:, None, None]
    inverse = np.linalg.inv(normal)
    return np.asarray(inverse @ inner @ inverse, np.float64)
