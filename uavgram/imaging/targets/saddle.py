"""Sub-pixel corners of a chessboard: a blurred saddle fitted to the grey values around each.

Two straight edges cross in the corner, blurred by a Gaussian; the grey value is

    m + gu u + gv v + a erf(s1 / sqrt(2) b) erf(s2 / sqrt(2) b) + e (G(s1 / b) + G(s2 / b))

with s1, s2 the distances from the edges and G the bell curve of height 1. The last term is the
print's (or the sensor's) bleeding: white that grows, black that shrinks, alike on both sides of the
corner. Every one of these terms except the two slopes is symmetric about the corner, so bleeding
and blur do not shift it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import erf

from uavgram.imaging.patch_fit import (
    compute_variance_growth,
    estimate_neighbour_correlation,
    fit_windows,
)
from uavgram.imaging.patches import make_grid
from uavgram.imaging.raster import Image
from uavgram.model.arrays import Floats, Ints

_U, _V, _ANGLE1, _ANGLE2, _BLUR, _CONTRAST, _MEAN, _SLOPE_U, _SLOPE_V, _BLEED = range(10)
PARAMETERS = 10
FIRST_BLUR_PX = 2.0  # wider than most blurs, so that the fit converges from a pixel away
SMALLEST_BLUR_PX = 0.3  # a pixel's own aperture


@dataclass(frozen=True, eq=False)
class SaddleFit:
    """Fitted corners, with the noise and blur of their surroundings.

    Attributes
    ----------
    pixel_px
        (N, 2).
    covariance_px2
        (N, 2, 2): variance of the residuals times the inverse of the grey values' normal matrix, in
        which the corner's block is the structure tensor (Foerstner and Guelch 1987, A fast operator
        for detection and precise location of distinct points, section 3). Correlated residuals
        (JPEG, halos of sharpening) count for fewer than they are.
    noise
        (N,) standard deviation of the residuals [grey values].
    misfit
        (N,) the part of it that is correlated between pixels, unlike white noise.
    contrast
        (N,) half the step from black to white; negative where the quadrants between the first and
        the second axis are black.
    blur_px
        (N,) standard deviation of the blur.
    """

    pixel_px: Floats
    covariance_px2: Floats
    noise: Floats
    misfit: Floats
    contrast: Floats
    blur_px: Floats


@dataclass(frozen=True, eq=False)
class Windows:
    """Square windows around N corners.

    Attributes
    ----------
    center_px
        (N, 2) whole pixels.
    offset_px
        (K, 2) of a window's pixels from its centre.
    grey
        (N, K) values.
    weight
        (N, K) 1 inside the part that is used, else 0.
    """

    center_px: Floats
    offset_px: Floats
    grey: Floats
    weight: Floats


def cut_windows(
    image: Image | Floats, start_px: Floats, axes_px: Floats, half_px: int, reach: float
) -> Windows:
    """Cut the surroundings of corners out of a photo.

    Parameters
    ----------
    image
        (height, width) grey values.
    start_px
        (N, 2) corners, to a few pixels.
    axes_px
        (N, 2, 2) steps to the next corner along a row, and along a column.
    half_px
        The windows have 2 half_px + 1 pixels each way.
    reach
        Radius of the used pixels in squares, counted along the axes.
    """
    center = np.round(start_px)
    offset = make_grid(half_px)
    height, width = image.shape
    column, row = np.moveaxis((center[:, None] + offset).astype(int), 2, 0)
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    grey = image[row.clip(0, height - 1), column.clip(0, width - 1)].astype(np.float64)
    away = offset - (start_px - center)[:, None]
    squares = away @ np.linalg.inv(axes_px)  # offset = squares @ axes
    used = ((squares**2).sum(axis=2) <= reach**2) & inside
    return Windows(center, offset, grey, used.astype(np.float64))


def fit_saddles(windows: Windows, start_px: Floats, axes_px: Floats) -> SaddleFit:
    """Fit a saddle to each window.

    Parameters
    ----------
    windows
        Windows of N corners.
    start_px, axes_px
        As for `cut_windows`.
    """

    def model(state: Floats, index: Ints) -> tuple[Floats, Floats]:
        value, by = _saddle(windows.offset_px, state)
        weight = windows.weight[index]
        by *= weight[:, None]
        return (value - windows.grey[index]) * weight, by

    lower, upper = np.full(PARAMETERS, -np.inf), np.full(PARAMETERS, np.inf)
    lower[_BLUR], upper[_BLUR] = SMALLEST_BLUR_PX, 0.5 * windows.offset_px.max()
    fit = fit_windows(model, _first_state(windows, start_px, axes_px), bounds=(lower, upper))
    # Variance of the residuals from n - p degrees of freedom.
    variance = fit.cost / np.maximum(windows.weight.sum(axis=1) - PARAMETERS, 1.0)
    side = round(len(windows.offset_px) ** 0.5)
    square = (len(windows.grey), side, side)
    # Correlated residuals enlarge the covariance.
    correlation = estimate_neighbour_correlation(
        fit.residual.reshape(square), windows.weight.reshape(square)
    )
    return SaddleFit(
        pixel_px=windows.center_px + fit.state[:, [_U, _V]],
        covariance_px2=(variance * compute_variance_growth(correlation))[:, None, None]
        * fit.inverse[:, :2, :2],
        noise=np.sqrt(variance),
        misfit=np.sqrt(variance * correlation.mean(axis=0)),
        contrast=fit.state[:, _CONTRAST],
        blur_px=fit.state[:, _BLUR],
    )


def _first_state(windows: Windows, start_px: Floats, axes_px: Floats) -> Floats:
    state = np.zeros((len(start_px), PARAMETERS))
    state[:, [_U, _V]] = start_px - windows.center_px
    state[:, [_ANGLE1, _ANGLE2]] = np.arctan2(axes_px[..., 1], axes_px[..., 0])
    state[:, _BLUR] = FIRST_BLUR_PX
    state[:, _CONTRAST] = 1.0
    total = np.maximum(windows.weight.sum(axis=1), 1.0)
    mean = (windows.weight * windows.grey).sum(axis=1) / total
    # Least-squares contrast of the model at the start position.
    shape = _saddle(windows.offset_px, state)[0] * windows.weight
    share = np.maximum((shape**2).sum(axis=1), 1e-9)
    state[:, _CONTRAST] = ((windows.grey - mean[:, None]) * shape).sum(axis=1) / share
    state[:, _MEAN] = mean
    return state


def _saddle(offset_px: Floats, state: Floats) -> tuple[Floats, Floats]:
    """Compute grey values (N, K) and their derivatives (N, 10, K)."""
    u = offset_px[:, 0] - state[:, _U, None]
    v = offset_px[:, 1] - state[:, _V, None]
    blur, contrast, bleed = (state[:, i, None] for i in (_BLUR, _CONTRAST, _BLEED))
    edges = []
    for angle in (state[:, _ANGLE1, None], state[:, _ANGLE2, None]):
        cos, sin = np.cos(angle), np.sin(angle)
        across, along = cos * v - sin * u, cos * u + sin * v
        bell = np.exp(-0.5 * (across / blur) ** 2)
        edges.append((cos, sin, across, along, bell, erf(across / (np.sqrt(2.0) * blur))))
    (_, _, across1, along1, bell1, step1), (_, _, across2, along2, bell2, step2) = edges
    product, bells = step1 * step2, bell1 + bell2
    value = state[:, _MEAN, None] + state[:, _SLOPE_U, None] * u + state[:, _SLOPE_V, None] * v
    value = value + contrast * product + bleed * bells
    # Derivatives by the distances from the two edges; then the chain rule.
    steep = contrast * np.sqrt(2.0 / np.pi) / blur
    by1 = bell1 * (steep * step2 - bleed * across1 / blur**2)
    by2 = bell2 * (steep * step1 - bleed * across2 / blur**2)
    jacobian = np.empty((len(value), PARAMETERS, value.shape[1]))
    jacobian[:, _U] = by1 * edges[0][1] + by2 * edges[1][1] - state[:, _SLOPE_U, None]
    jacobian[:, _V] = -by1 * edges[0][0] - by2 * edges[1][0] - state[:, _SLOPE_V, None]
    jacobian[:, _ANGLE1], jacobian[:, _ANGLE2] = -by1 * along1, -by2 * along2
    # the model depends on across / blur alone
    jacobian[:, _BLUR] = -(by1 * across1 + by2 * across2) / blur
    jacobian[:, _CONTRAST], jacobian[:, _MEAN] = product, 1.0
    jacobian[:, _SLOPE_U], jacobian[:, _SLOPE_V], jacobian[:, _BLEED] = u, v, bells
    return value, jacobian
