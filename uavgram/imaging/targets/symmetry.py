"""Centre about which a picture is symmetric under a half turn, to hundredths of a pixel.

Chequers, crosses and discs are unchanged by a half turn, in any affine view. So the centre is where
the differences I(c + d) - I(c - d) are least; neither shape, size nor brightness need be known.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from scipy.ndimage import spline_filter

from uavgram.imaging.patch_fit import (
    Fit,
    compute_variance_growth,
    estimate_neighbour_correlation,
    fit_windows,
)
from uavgram.imaging.patches import compute_slopes
from uavgram.imaging.raster import Image
from uavgram.model.arrays import Bools, Floats, Ints

MODEL_SIGMA_PX = 0.03
"""Error of real cameras in addition to noise: uneven blur, sharpening, demosaicing.

Inner corners of OpenCV's chessboard photos scatter by 0.048 px, where noise alone explains 0.038
px; in rendered photos the error is less than 0.005 px.
"""

_LEAST_NOISE = 0.3  # of rounding to whole grey values: 1 / sqrt(12)
_RING = 4  # pixels beyond the requested ones: the effect of the spline's end has decayed there


class SymmetryCentre(NamedTuple):
    """Centre (2,) [px], its covariance (2, 2) [px^2] and the correlation of both halves, -1 to 1.

    `slope` [grey values/px] is the root mean square slope common to both halves, in the direction
    in which it is least.
    """

    pixel_px: Floats
    covariance_px2: Floats
    likeness: float
    slope: float

    @property
    def sigma_px(self) -> float:
        """Sigma of a coordinate in any direction, in a real photo."""
        return float(np.hypot(np.sqrt(np.trace(self.covariance_px2) / 2.0), MODEL_SIGMA_PX))

    @property
    def worst_sigma_px(self) -> float:
        """Sigma in the direction in which it is largest."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance_px2)[1]))


def find_centre_of_symmetry(
    photo: Image, start_px: Floats, axes_px: Floats
) -> SymmetryCentre | None:
    """Find the centre of symmetry near a place; None where there is none or the search diverges.

    Parameters
    ----------
    photo
        (height, width) grey values.
    start_px
        (2,) to about a pixel.
    axes_px
        (2, 2) half axes of the ellipse in which the picture is symmetric, as columns.
    """
    half = int(np.ceil(np.abs(axes_px).sum(axis=1).max())) + 1
    v, u = np.mgrid[-half : half + 1, -half : half + 1].astype(np.float64)
    inside = ((np.linalg.inv(axes_px) @ np.stack([u.ravel(), v.ravel()])) ** 2).sum(axis=0) <= 1.0
    weight = inside.reshape(u.shape)
    start = np.array(start_px, np.float64)[None]
    surface = _Surface(photo, start[0], half + 1 + half // 2)

    def model(center: Floats, _: Ints) -> tuple[Floats, Floats]:
        around = surface.window(center[0], half + 1)
        if around is None:
            return np.full((1, inside.size), np.nan), np.zeros((1, 2, inside.size))
        odd = (around - around[::-1, ::-1])[1:-1, 1:-1]
        slope = np.stack(compute_slopes(around[None]), axis=1)
        # d/dc of I(c + d) - I(c - d): twice the slope where both halves are alike
        change = (slope - slope[..., ::-1, ::-1]) * weight
        return (odd * weight).reshape(1, -1), change.reshape(1, 2, -1)

    # no damping: differences over two pixels are not the exact derivatives of the residuals
    fit = fit_windows(model, start, damping=0.0)
    center = fit.state[0]
    value = surface.window(center, half)
    if value is None or not np.isfinite(fit.cost[0]):
        return None
    least = float(np.linalg.eigvalsh(fit.normal[0])[0])
    if least <= 0 or np.abs(center - start).max() > 0.5 * half:
        return None
    slope = float(np.sqrt(least / weight.sum()))
    return SymmetryCentre(center, _covariance(fit, weight), _likeness(value, weight), slope)


def compute_symmetry(photo: Image, center_px: Floats, radius_px: int) -> float:
    """Correlate both halves of a disc; -1 where the photo's edge cuts it.

    Parameters
    ----------
    photo
        (height, width) grey values.
    center_px
        (2,) its middle.
    radius_px
        Its radius.
    """
    value = _Surface(photo, center_px, radius_px).window(center_px, radius_px)
    if value is None:
        return -1.0
    v, u = np.mgrid[-radius_px : radius_px + 1, -radius_px : radius_px + 1]
    return _likeness(value, u**2 + v**2 <= radius_px**2)


def _covariance(fit: Fit, weight: Bools) -> Floats:
    """Compute the covariance of the centre from the differences of both halves.

    The sums go over both halves, so every difference occurs twice: with the variance q of the
    differences the covariance is 2 q N^-1. Correlated differences (JPEG, texture of the
    surroundings) count for fewer.
    """
    variance = max(fit.cost[0] / max(weight.sum() - 4.0, 1.0), 2 * _LEAST_NOISE**2)
    odd = fit.residual.reshape(1, *weight.shape)
    more = compute_variance_growth(estimate_neighbour_correlation(odd, weight.astype(np.float64)))
    return np.asarray(2.0 * variance * more * fit.inverse[0])


def _likeness(value: Floats, weight: Bools) -> float:
    here, there = value[weight], value[::-1, ::-1][weight]
    spread = float(here.std() * there.std())
    return float(((here - here.mean()) * (there - there.mean())).mean() / max(spread, 1e-9))


class _Surface:
    """Grey values about a place as a smooth surface: the cubic spline through all pixels.

    The usual four-point interpolation of pictures (`cv2.remap`) is not symmetric between pixels,
    and rounds places to 1/32 px: it moved centres of sharp targets by 0.03 px, where this spline
    moves them by less than 0.001 px.

    Parameters
    ----------
    photo
        (height, width) grey values.
    middle_px
        (2,) middle of the part that is cut out.
    half
        Least distance from the middle that can be evaluated.
    """

    def __init__(self, photo: Image, middle_px: Floats, half: int) -> None:
        size = np.array(photo.shape[1::-1])
        first = np.round(middle_px).astype(int) - half - _RING
        self._first = np.maximum(first, 0)
        u, v = self._first
        beyond = np.minimum(first + 2 * (half + _RING) + 1, size)
        part = photo[v : max(beyond[1], v), u : max(beyond[0], u)].astype(np.float64)
        self._size = np.array(part.shape[1::-1])
        self._knots = spline_filter(part, order=3, mode="mirror") if part.size else part

    def window(self, center_px: Floats, half: int) -> Floats | None:
        """Evaluate (2 half + 1, 2 half + 1) values about a place; None where some are outside."""
        first = center_px - self._first - half
        if not ((first >= 2) & (first + 2 * half <= self._size - 3)).all():
            return None
        u, v = np.floor(first).astype(int).tolist()
        side = 2 * half + 1
        knots = self._knots[v - 1 : v + side + 2, u - 1 : u + side + 2]
        across, down = (_knot_weights(float(share)) for share in first - [u, v])
        values = cv2.sepFilter2D(knots, -1, across, down, anchor=(0, 0))
        return np.asarray(values[:side, :side])


def _knot_weights(share: float) -> Floats:
    """Compute weights (4,) of the knots about a place in a cubic spline.

    The place is a share of a step beyond the second knot.
    """
    rest = 1.0 - share
    inner = [4.0 - 6.0 * s**2 + 3.0 * s**3 for s in (share, rest)]
    return np.array([rest**3, *inner, share**3]) / 6.0
