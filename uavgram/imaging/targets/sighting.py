"""Measurement of the corners of a board in one photo."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from uavgram.imaging.raster import Image
from uavgram.imaging.targets.gradient import measure_gradient_corners
from uavgram.imaging.targets.saddle import SaddleFit, cut_windows, fit_saddles
from uavgram.model.arrays import Bools, Floats, Ints

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
