"""Sub-pixel corners of a chessboard: a blurred saddle fitted to the grey values around each.

Two straight edges cross in the corner, blurred by a Gaussian; the grey value is

    m + gu u + gv v + a erf(s1 / sqrt(2) b) erf(s2 / sqrt(2) b) + e (G(s1 / b) + G(s2 / b))

with s1, s2 the distances from the edges and G the bell curve of height 1. The last term is the
print's (or the sensor's) bleeding: white that grows, black that shrinks, alike on both sides of
the corner. The position is symmetric about the corner in every one of these terms but the two
slopes, so bleeding and blur do not shift it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import erf

from uavgram.imaging.raster import Image
from uavgram.model.arrays import Floats

_U, _V, _ANGLE1, _ANGLE2, _BLUR, _CONTRAST, _MEAN, _SLOPE_U, _SLOPE_V, _BLEED = range(10)
PARAMETERS = 10
ITERATIONS = 15
FIRST_BLUR_PX = 2.0  # wider than most blurs: a start that is a pixel off still feels its edges
SMALLEST_BLUR_PX = 0.3  # a pixel's own aperture
_CONVERGED_PX = 1e-3  # steps shrink fast: the next one would be far smaller
_MOST_CORRELATION = 0.9


@dataclass(frozen=True, eq=False)
class SaddleFit:
    """Corners with what their surroundings say.

    Attributes
    ----------
    pixel_px
        (N, 2).
    covariance_px2
        (N, 2, 2): variance of the residuals times the inverse of the grey values' normal matrix,
        in which the corner's block is the structure tensor (Foerstner and Guelch 1987, A fast
        operator for detection and precise location of distinct points, section 3). Residuals
        that run from pixel to pixel (JPEG, halos of sharpening) count for fewer than they are.
    noise
        (N,) standard deviation of the residuals [grey values].
    misfit
        (N,) part of it that runs on from pixel to pixel: what no white noise explains.
    contrast
        (N,) half the step from black to white; negative where the quadrants between the first
        and the second axis are black.
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
        Used is what lies within so many squares of the corner, counted along the axes.
    """
    center = np.round(start_px)
    v, u = np.mgrid[-half_px : half_px + 1, -half_px : half_px + 1].reshape(2, -1)
    height, width = image.shape
    column, row = center[:, :1].astype(int) + u, center[:, 1:].astype(int) + v
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    grey = image[row.clip(0, height - 1), column.clip(0, width - 1)].astype(np.float64)
    offset = np.stack([u, v], axis=1).astype(np.float64)
    away = offset - (start_px - center)[:, None]
    squares = away @ np.linalg.inv(axes_px)  # offset = squares @ axes
    used = ((squares**2).sum(axis=2) <= reach**2) & inside
    return Windows(center, offset, grey, used.astype(np.float64))


def fit_saddles(windows: Windows, start_px: Floats, axes_px: Floats) -> SaddleFit:
    """Fit a saddle to each window by Levenberg's and Marquardt's method.

    Parameters
    ----------
    windows
        Of N corners.
    start_px, axes_px
        As for `cut_windows`.
    """
    state = _first_state(windows, start_px, axes_px)
    cost = _cost(windows, state)
    damping = np.full(len(state), 1e-2)
    active = np.arange(len(state))
    largest_blur = 0.5 * windows.offset_px.max()
    for _ in range(ITERATIONS):
        part = _part(windows, active)
        value, jacobian = _saddle(part.offset_px, state[active])
        step = _step(part, value, jacobian, damping[active])
        trial = state[active] + step
        trial[:, _BLUR] = trial[:, _BLUR].clip(SMALLEST_BLUR_PX, largest_blur)
        after = _cost(part, trial)
        better = after < cost[active]
        damping[active] *= np.where(better, 0.1, 10.0)
        accepted = active[better]
        state[accepted], cost[accepted] = trial[better], after[better]
        small = np.abs(step[:, :2]).max(axis=1) < _CONVERGED_PX
        active = active[~(small | (damping[active] > 1e8))]
        if not len(active):
            break
    return _result(windows, state, cost)


def _part(windows: Windows, index: np.ndarray[tuple[int], np.dtype[np.int64]]) -> Windows:
    if len(index) == len(windows.grey):
        return windows
    return Windows(
        windows.center_px[index], windows.offset_px, windows.grey[index], windows.weight[index]
    )


def _first_state(windows: Windows, start_px: Floats, axes_px: Floats) -> Floats:
    state = np.zeros((len(start_px), PARAMETERS))
    state[:, [_U, _V]] = start_px - windows.center_px
    state[:, [_ANGLE1, _ANGLE2]] = np.arctan2(axes_px[..., 1], axes_px[..., 0])
    state[:, _BLUR] = FIRST_BLUR_PX
    state[:, _CONTRAST] = 1.0
    total = np.maximum(windows.weight.sum(axis=1), 1.0)
    mean = (windows.weight * windows.grey).sum(axis=1) / total
    shape = _saddle(windows.offset_px, state, derivatives=False)[0] * windows.weight
    share = np.maximum((shape**2).sum(axis=1), 1e-9)
    state[:, _CONTRAST] = ((windows.grey - mean[:, None]) * shape).sum(axis=1) / share
    state[:, _MEAN] = mean
    return state


def _saddle(offset_px: Floats, state: Floats, *, derivatives: bool = True) -> tuple[Floats, Floats]:
    """Grey values (N, K) and their derivatives (N, K, 10), or an empty array in their place."""
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
    if not derivatives:
        return value, np.empty(0)
    steep = contrast * np.sqrt(2.0 / np.pi) / blur
    by1 = bell1 * (steep * step2 - bleed * across1 / blur**2)
    by2 = bell2 * (steep * step1 - bleed * across2 / blur**2)
    jacobian = np.empty((*value.shape, PARAMETERS))
    jacobian[..., _U] = by1 * edges[0][1] + by2 * edges[1][1] - state[:, _SLOPE_U, None]
    jacobian[..., _V] = -by1 * edges[0][0] - by2 * edges[1][0] - state[:, _SLOPE_V, None]
    jacobian[..., _ANGLE1], jacobian[..., _ANGLE2] = -by1 * along1, -by2 * along2
    # a length scale: everything depends on across / blur alone
    jacobian[..., _BLUR] = -(by1 * across1 + by2 * across2) / blur
    jacobian[..., _CONTRAST], jacobian[..., _MEAN] = product, 1.0
    jacobian[..., _SLOPE_U], jacobian[..., _SLOPE_V], jacobian[..., _BLEED] = u, v, bells
    return value, jacobian


def _cost(windows: Windows, state: Floats) -> Floats:
    value = _saddle(windows.offset_px, state, derivatives=False)[0]
    cost: Floats = (windows.weight * (windows.grey - value) ** 2).sum(axis=1)
    return cost


def _normal(windows: Windows, jacobian: Floats, damping: Floats) -> tuple[Floats, Floats]:
    """Weighted Jacobian transposed, and the normal matrix with its damped diagonal."""
    weighted = np.swapaxes(jacobian * windows.weight[..., None], 1, 2)
    normal = weighted @ jacobian
    diagonal = np.arange(PARAMETERS)
    scale = normal[:, diagonal, diagonal]
    # the floor keeps a window that says nothing (all weights 0) from stopping the others
    floor = 1e-9 * scale.max(axis=1, keepdims=True) + 1e-12
    normal[:, diagonal, diagonal] += damping[:, None] * scale + floor
    return weighted, normal


def _step(windows: Windows, value: Floats, jacobian: Floats, damping: Floats) -> Floats:
    weighted, normal = _normal(windows, jacobian, damping)
    gradient = weighted @ (windows.grey - value)[..., None]
    return np.asarray(np.linalg.solve(normal, gradient)[..., 0], np.float64)


def _result(windows: Windows, state: Floats, cost: Floats) -> SaddleFit:
    value, jacobian = _saddle(windows.offset_px, state)
    normal = _normal(windows, jacobian, np.zeros(len(state)))[1]
    freedom = np.maximum(windows.weight.sum(axis=1) - PARAMETERS, 1.0)
    variance = cost / freedom
    correlation = _correlation(windows, windows.grey - value)
    # of a process that forgets by a factor per pixel, along u and along v: the sum of all its
    # correlations, by which the variance of a mean grows
    growth = ((1.0 + correlation) / (1.0 - correlation)).prod(axis=0)
    covariance = (variance * growth)[:, None, None] * np.linalg.inv(normal)[:, :2, :2]
    return SaddleFit(
        pixel_px=windows.center_px + state[:, [_U, _V]],
        covariance_px2=covariance,
        noise=np.sqrt(variance),
        misfit=np.sqrt(variance * correlation.mean(axis=0)),
        contrast=state[:, _CONTRAST],
        blur_px=state[:, _BLUR],
    )


def _correlation(windows: Windows, residual: Floats) -> Floats:
    """(2, N) correlation of neighbours along u and v, from 0 to 0.9."""
    side = round(len(windows.offset_px) ** 0.5)
    weight = windows.weight.reshape(-1, side, side)
    square = residual.reshape(-1, side, side) * weight
    pairs = (
        (square[:, :, 1:] * square[:, :, :-1], weight[:, :, 1:] * weight[:, :, :-1]),
        (square[:, 1:] * square[:, :-1], weight[:, 1:] * weight[:, :-1]),
    )
    total = np.maximum((square**2).sum(axis=(1, 2)), 1e-12)
    count = np.maximum(weight.sum(axis=(1, 2)), 1.0)
    found = [
        product.sum(axis=(1, 2)) / total * count / np.maximum(both.sum(axis=(1, 2)), 1.0)
        for product, both in pairs
    ]
    return np.asarray(np.clip(np.stack(found), 0.0, _MOST_CORRELATION), np.float64)
