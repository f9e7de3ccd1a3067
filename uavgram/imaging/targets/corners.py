"""Sub-pixel corners of a board: blurred saddles fitted to the grey values, and their gradients.

For the saddle, two straight edges cross in the corner, blurred by a Gaussian; the grey value is

    m + gu u + gv v + a erf(s1 / sqrt(2) b) erf(s2 / sqrt(2) b) + e (G(s1 / b) + G(s2 / b))

with s1, s2 the distances from the edges and G the bell curve of height 1. The last term is the
print's (or the sensor's) bleeding: white that grows, black that shrinks, alike on both sides of the
corner. Every one of these terms except the two slopes is symmetric about the corner, so bleeding
and blur do not shift it.

The gradients' corner is that of Foerstner's operator (Foerstner and Guelch 1987): the corner c
minimises the sum of (g . (x - c))^2 over the window, with the gradient g in x. It assumes nothing
about the edges' shape, and uses less of the image than the fit of a saddle where the model of that
fit holds.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from scipy.special import erf

from uavgram.imaging.patches import (
    compute_slopes,
    compute_variance_growth,
    estimate_neighbour_correlation,
    fit_windows,
    make_grid,
)
from uavgram.imaging.raster import Image
from uavgram.model.arrays import Bools, Floats, Ints

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


# Errors besides blur and noise: the printer, edges bent by the lens, pixels' own shapes. Rendered
# boards without any noise are found to 0.005 px.
SIGMA_FLOOR_PX = 0.01
HALF_PX, LARGEST_HALF_PX, SMALLEST_HALF_PX = 11, 30, 3
BLURS_IN_HALF = 4.0
MAX_MOVE = 0.3  # of a square, from the result of the coarse search
LARGEST_SIGMA_PX = 1.0
OFF_MIDDLE_PX = 1.5
MAX_NOISE = 0.5  # of half the step from black to white


@dataclass(frozen=True, kw_only=True, eq=False)
class Sighting:
    """Corners of a board in one photo, by two operators.

    Attributes
    ----------
    corner
        (n,) indices into ``Board.corner_board_m``.
    pixel_px, sigma_px
        (n, 2), (n,) by the fit of a saddle; standard deviation of each coordinate.
    gradient_px, gradient_sigma_px
        The same by gradients alone.
    misfit
        Median over the corners of the residuals that neither the saddle nor white noise explains,
        in parts of the step from black to white.
    found_size
        Columns and rows of inner corners that seem to be there; None: no board at all.
    is_other_board
        Whether they cannot be (a part of) the requested board.
    """

    corner: Ints = field(default_factory=lambda: np.empty(0, np.int64))
    pixel_px: Floats = field(default_factory=lambda: np.empty((0, 2)))
    sigma_px: Floats = field(default_factory=lambda: np.empty(0))
    gradient_px: Floats = field(default_factory=lambda: np.empty((0, 2)))
    gradient_sigma_px: Floats = field(default_factory=lambda: np.empty(0))
    misfit: float = 0.0
    found_size: tuple[int, int] | None = None
    is_other_board: bool = False


def grid_axes(grid_px: Floats) -> Floats:
    """Compute steps (R, C, 2, 2) along a row and along a column at each corner of a grid (R, C, 2).

    They are the mean of the steps to both neighbours; where there are none, the grid's mean step.
    """
    padded = np.pad(grid_px, ((1, 1), (1, 1), (0, 0)), constant_values=np.nan)
    middle = padded[1:-1, 1:-1]
    along_row = np.stack([padded[1:-1, 2:] - middle, middle - padded[1:-1, :-2]])
    along_column = np.stack([padded[2:, 1:-1] - middle, middle - padded[:-2, 1:-1]])
    axes = np.stack([average_known(along_row), average_known(along_column)], axis=2)
    whole = average_known(axes.reshape(-1, 2, 2))
    return np.where(np.isfinite(axes), axes, whole)


def average_known(values: Floats) -> Floats:
    """Average along the first axis without NaN; NaN where there is no other value."""
    known = np.isfinite(values)
    count = known.sum(axis=0)
    total = np.where(known, values, 0.0).sum(axis=0)
    mean: Floats = np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0)
    return mean


def measure_corners(
    image: Image, grid_px: Floats, reach: float, found_size: tuple[int, int]
) -> Sighting:
    """Measure the corners of a board in the full photo.

    Parameters
    ----------
    image
        (height, width) grey.
    grid_px
        (rows, columns, 2) places from the coarse search, NaN where not found. Row and column as in
        the board.
    reach
        Squares around a corner without other print.
    found_size
        Columns and rows that were found.
    """
    index = np.flatnonzero(np.isfinite(grid_px[..., 0]))
    start = grid_px.reshape(-1, 2)[index]
    axes = grid_axes(grid_px).reshape(-1, 2, 2)[index]
    spacing = np.linalg.norm(axes, axis=2)
    half = _half(reach * spacing, HALF_PX)
    fit = _fit(image, start, axes, half, reach)
    wanted = _half(reach * spacing, BLURS_IN_HALF * float(np.median(fit.blur_px)))
    if wanted > half:
        half, fit = wanted, _fit(image, start, axes, wanted, reach)
    keep = _is_corner(fit, start, spacing.min(axis=1))
    height, width = image.shape
    # a corner beyond the edge is only extrapolated from the image before it
    keep &= ((fit.pixel_px >= 0) & (fit.pixel_px <= [width - 1, height - 1])).all(axis=1)
    # the operator's window is square: its corners must not reach other print either
    half = _half(np.sqrt(0.5) * reach * spacing.min(keepdims=True), half)
    windows = cut_windows(image, fit.pixel_px[keep], axes[keep], half, reach)
    by_gradient = measure_gradient_corners(image, windows, fit.pixel_px[keep], fit.noise[keep])
    misfit = fit.misfit[keep] / np.maximum(2.0 * np.abs(fit.contrast[keep]), 1e-9)
    return Sighting(
        corner=index[keep],
        pixel_px=fit.pixel_px[keep],
        sigma_px=_sigma(fit.covariance_px2[keep]),
        gradient_px=by_gradient[0],
        gradient_sigma_px=_sigma(by_gradient[1]),
        misfit=float(np.median(misfit)) if keep.any() else 0.0,
        found_size=found_size,
    )


def _half(reach_px: Floats, most: float) -> int:
    """Compute half a window: as much as most corners have room for, up to `most` pixels."""
    room = float(np.median(reach_px.max(axis=1)))
    return int(np.clip(round(min(room, most)), SMALLEST_HALF_PX, LARGEST_HALF_PX))


def _fit(image: Image, start: Floats, axes: Floats, half: int, reach: float) -> SaddleFit:
    """Fit the corners, and fit again about the results where these are off the windows' middles."""
    windows = cut_windows(image, start, axes, half, reach)
    first = fit_saddles(windows, start, axes)
    moved = np.linalg.norm(first.pixel_px - start, axis=1)
    usable = moved < MAX_MOVE * np.linalg.norm(axes, axis=2).min(axis=1)
    if not (moved[usable] > OFF_MIDDLE_PX).any():
        return first
    better = np.where(usable[:, None], first.pixel_px, start)
    return fit_saddles(cut_windows(image, better, axes, half, reach), better, axes)


def _is_corner(fit: SaddleFit, start: Floats, spacing: Floats) -> Bools:
    keep = np.linalg.norm(fit.pixel_px - start, axis=1) < MAX_MOVE * spacing
    keep &= fit.noise < MAX_NOISE * np.abs(fit.contrast)
    keep &= np.abs(fit.contrast) > 0.2 * np.median(np.abs(fit.contrast))
    keep &= _sigma(fit.covariance_px2) < LARGEST_SIGMA_PX
    return np.asarray(keep, np.bool_)


def _sigma(covariance_px2: Floats) -> Floats:
    """Compute standard deviations (n,) of a coordinate: root of the mean variance, with floor."""
    variance = 0.5 * np.trace(covariance_px2, axis1=1, axis2=2)
    return np.asarray(np.sqrt(variance + SIGMA_FLOOR_PX**2), np.float64)
