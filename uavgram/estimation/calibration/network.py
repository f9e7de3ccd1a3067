"""Tilts, rolls and coverage of the photos, and systematic errors in the residuals."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc, fdtrc

from uavgram.estimation.calibration.adjustment import Fit
from uavgram.estimation.calibration.problem import State
from uavgram.model.arrays import Floats, Ints

CELL_COUNTS = (8, 6)
"""Columns and rows of the cells in which empty parts of the image are searched."""


class Tilts(NamedTuple):
    """Directions from which the board was seen.

    Attributes
    ----------
    tilt_rad
        (M,) angle between the board's normal and the optical axis.
    spread_rad
        (2,) root mean square of the tilts about their mean along the image's direction in which
        they vary most, and across it.
    weak_rad
        Direction in the image along which they vary least, in [-pi/2, pi/2).
    """

    tilt_rad: Floats
    spread_rad: Floats
    weak_rad: float


def compute_tilts(state: State) -> Tilts:
    """Compute tilts of the boards in the camera's frame.

    Rolling the camera by a quarter turn rotates the direction of a tilt with it. If tilts vary
    along one direction only, the principal point along the other one is determined by the
    perspective of few photos.
    """
    normal = state.camera_from_board[:, :, 2]
    # The same board may be seen with its normal towards or away from the camera.
    normal = normal * np.where(normal[:, 2:] < 0, -1.0, 1.0)
    lateral = np.hypot(normal[:, 0], normal[:, 1])
    tilt = np.arctan2(lateral, normal[:, 2])
    vector = normal[:, :2] * (tilt / np.maximum(lateral, 1e-12))[:, None]
    # Principal axes of the tilt vectors.
    centred = vector - vector.mean(axis=0)
    values, axes = np.linalg.eigh(centred.T @ centred / len(vector))
    weak = float(np.arctan2(axes[1, 0], axes[0, 0]))
    return Tilts(
        tilt,
        np.sqrt(np.maximum(values[::-1], 0.0)),
        (weak + np.pi / 2) % np.pi - np.pi / 2,
    )


class Coverage(NamedTuple):
    """Distribution of the corners over the image.

    Attributes
    ----------
    corners
        (R, C) number of corners in each cell of the image.
    largest_share
        Largest distance of a corner from the middle of the image, over that of the image's corner.
    """

    corners: Ints
    largest_share: float

    @property
    def share(self) -> float:
        """Share of the cells with a corner."""
        return float(np.mean(self.corners > 0))


def compute_coverage(
    pixel_px: Floats, size_px: tuple[int, int], cells: tuple[int, int] = CELL_COUNTS
) -> Coverage:
    """Count corners (N, 2) by cell of the image.

    Parameters
    ----------
    pixel_px
        (N, 2) corners of all photos.
    size_px
        Width and height of the image.
    cells
        Columns and rows of cells.
    """
    columns, rows = cells
    size = np.array(size_px, np.float64)
    u, v = ((pixel_px + 0.5) / size).T
    count = np.histogram2d(v, u, bins=(rows, columns), range=((0, 1), (0, 1)))[0]
    radius = np.linalg.norm(pixel_px - (size - 1) / 2, axis=1).max(initial=0.0)
    return Coverage(count.astype(np.int64), float(radius / np.linalg.norm(size / 2)))


class Trend(NamedTuple):
    """Additional unknowns of each photo, estimated from the residuals.

    Attributes
    ----------
    value
        (M, e) estimates; 0 if a photo does not determine them.
    chi2
        Sum over photos of the reductions of the sum of squares, in units of the variance factor.
    degrees
        Degrees of freedom: e for each photo.
    """

    value: Floats
    chi2: float
    degrees: int


def compute_trend(fit: Fit, extra: Floats) -> Trend:
    """Test additional unknowns of each photo by a score test (Rao 1948).

    Parameters
    ----------
    fit
        Adjustment without them; its border is assumed known.
    extra
        (M, n, 2, e) derivatives of the pixels by them [px per unit].
    """
    photos, n = fit.corners.weight.shape
    rows = (extra * fit.corners.weight[:, :, None, None]).reshape(photos, 2 * n, -1)
    pose = fit.linear.pose
    # Project the pose out of the derivatives.
    follow = fit.normals.pose_inverse @ (np.swapaxes(pose, 1, 2) @ rows)
    free = rows - pose @ follow
    normal = np.swapaxes(free, 1, 2) @ free
    size = np.einsum("mii->mi", normal)
    whole = np.sum(rows**2, axis=1)
    good = (size > 1e-9 * np.maximum(whole, np.finfo(float).tiny)).all(axis=1)
    normal[~good] = np.eye(normal.shape[1])
    gradient = np.einsum("mri,mr->mi", free, fit.linear.residual)
    value = np.where(good[:, None], -np.linalg.solve(normal, gradient[..., None])[..., 0], 0.0)
    factor = fit.cost / max(fit.degrees_of_freedom, 1)
    squares = float(-np.sum(value * np.where(good[:, None], gradient, 0.0)))
    return Trend(value, squares / factor, int(good.sum()) * extra.shape[3])


class RollingShutter(NamedTuple):
    """Drift of rows against each other, different in each photo.

    Attributes
    ----------
    drift_px
        Root mean square over photos of the drift from the first row to the last one.
    ratio
        Ratio of the residuals explained by such drifts to those explained by bends.
    probability
        Probability of such a ratio by chance.
    """

    drift_px: float
    ratio: float
    probability: float


def detect_rolling_shutter(fit: Fit, size_px: tuple[int, int]) -> RollingShutter:
    """Compare a drift by row in each photo with bends of second order.

    A camera that moves while its rows are read one after the other shears and stretches each photo
    differently, to first order; a bent board or a wrong lens model bends it, to second order. The
    parts of either that the poses compensate are not counted.
    """
    u, v = np.moveaxis(fit.corners.pixel_px / np.array(size_px) - 0.5, -1, 0)
    by_row = compute_trend(fit, _along_both(v))
    bends = [compute_trend(fit, _along_both(bend)) for bend in (u * u, u * v, v * v)]
    degrees = max(sum(bend.degrees for bend in bends), 1)
    usual = max(sum(bend.chi2 for bend in bends) / degrees, 1.0)
    own = max(by_row.degrees, 1)
    ratio = by_row.chi2 / own / usual
    drift = float(np.sqrt(np.mean(np.sum(by_row.value**2, axis=1))))
    return RollingShutter(drift, ratio, float(fdtrc(own, degrees, ratio)))


def _along_both(shape: Floats) -> Floats:
    """Return (M, n, 2, 2) derivatives of pixels by a pattern (M, n) along u, and by one along v."""
    extra = np.zeros((*shape.shape, 2, 2))
    extra[..., 0, 0] = extra[..., 1, 1] = shape
    return extra


class FocusDrift(NamedTuple):
    """Differences of the focal length between photos.

    Attributes
    ----------
    relative
        (M,) each photo's own focal length over the common one, minus 1.
    probability
        Probability of such differences by chance.
    """

    relative: Floats
    probability: float


def detect_focus_drift(fit: Fit, photo_factor: float) -> FocusDrift:
    """Estimate a separate focal length for each photo, to detect autofocus, zoom or two cameras.

    Parameters
    ----------
    fit
        Adjustment with one focal length.
    photo_factor
        Factor by which the photos scatter more than by their corners' noise, for other reasons.
    """
    principal = fit.state.parameters[2:4]
    extra = (fit.corners.pixel_px - principal)[..., None]
    found = compute_trend(fit, extra)
    chance = chdtrc(found.degrees, found.chi2 / photo_factor) if found.degrees else np.nan
    return FocusDrift(found.value[:, 0], float(chance))


class ResidualMap(NamedTuple):
    """Mean residual vectors (predicted minus observed) over the image; R rows of C cells.

    Attributes
    ----------
    mean_px
        (R, C, 2); NaN if there is no corner.
    corners
        (R, C) number of corners.
    probability
        (R, C) of so long a mean vector by chance; 1 if there is no corner.
    """

    mean_px: Floats
    corners: Ints
    probability: Floats


def map_residuals(fit: Fit, size_px: tuple[int, int], cells: tuple[int, int]) -> ResidualMap:
    """Compute mean residuals by cell of the image.

    Parameters
    ----------
    fit, size_px
        Adjustment; width and height of the image.
    cells
        Columns and rows.
    """
    columns, rows = cells
    factor = fit.corner_cost / max(fit.corner_redundancy, 1.0)
    there = fit.corners.weight > 0
    pixel, weight = fit.corners.pixel_px[there], fit.corners.weight[there]
    residual = fit.linear.residual.reshape(*there.shape, 2)[there]
    cell = np.clip((pixel + 0.5) / size_px * cells, 0, np.array(cells) - 1).astype(np.int64)
    index = cell[:, 1] * columns + cell[:, 0]
    count = np.bincount(index, minlength=rows * columns)
    mean = _count_by_cell(index, residual / weight[:, None], count)
    whitened = _count_by_cell(index, residual, count)
    # A mean of n whitened residuals has the variance 1 / n: chi-square with two degrees.
    squared = np.nansum(whitened**2, axis=1) * count / factor
    probability = np.where(count > 0, chdtrc(2, squared), 1.0)
    return ResidualMap(
        mean.reshape(rows, columns, 2),
        count.reshape(rows, columns),
        probability.reshape(rows, columns),
    )


def _count_by_cell(index: Ints, value: Floats, count: Ints) -> Floats:
    total = np.stack([np.bincount(index, v, minlength=len(count)) for v in value.T], axis=1)
    return np.asarray(
        np.divide(total, count[:, None], out=np.full(total.shape, np.nan), where=count[:, None] > 0)
    )
