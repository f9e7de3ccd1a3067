"""The centre about which a picture looks the same after half a turn, to hundredths of a pixel.

Chequers, crosses and discs all are their own image after half a turn, and stay so in any affine
view. So the centre is where the differences I(c + d) - I(c - d) are least: no shape, no size and
no brightness has to be known.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline
from scipy.ndimage import spline_filter

from uavgram.imaging.raster import Image
from uavgram.model.arrays import Bools, Floats

OF_CAMERAS_PX = 0.03
"""What real cameras add to the noise: blur that is not the same on all sides, sharpening, colours
put together from their neighbours. Inner corners of OpenCV's chessboard photos scatter by 0.048 px,
where noise alone explains 0.038 px; in rendered photos it is less than 0.005 px."""

_ROUNDS = 15
_CONVERGED_PX = 1e-3
_LEAST_NOISE = 0.3  # of rounding to whole grey values: 1 / sqrt(12)
_MOST_CORRELATION = 0.9
_BELL = BSpline.basis_element(np.arange(-2.0, 3.0), extrapolate=False)
_RING = 4  # pixels beyond what is asked for: the spline's end is not felt there


class Centre(NamedTuple):
    """A centre (2,) [px], its covariance (2, 2) [px^2] and the likeness of both halves, -1 to 1.

    `slope` [grey values/px] is the root mean square of that of both halves together, in the
    direction in which it is least.
    """

    pixel_px: Floats
    covariance_px2: Floats
    likeness: float
    slope: float

    @property
    def sigma_px(self) -> float:
        """Of a coordinate, whatever the direction, in a real photo."""
        return float(np.hypot(np.sqrt(np.trace(self.covariance_px2) / 2.0), OF_CAMERAS_PX))

    @property
    def worst_sigma_px(self) -> float:
        """In the direction in which it is largest."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance_px2)[1]))


def centre_of_symmetry(photo: Image, start_px: Floats, axes_px: Floats) -> Centre | None:
    """The centre of symmetry near a place; None where there is none or it runs away.

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
    center = np.asarray(start_px, np.float64)
    surface = _Surface(photo, center, half + 1 + half // 2)
    for _ in range(_ROUNDS):
        around = surface.window(center, half + 1)
        if around is None or np.abs(center - start_px).max() > 0.5 * half:
            return None
        value = around[1:-1, 1:-1]
        slope = np.stack(
            [around[1:-1, 2:] - around[1:-1, :-2], around[2:, 1:-1] - around[:-2, 1:-1]]
        )
        odd = value - value[::-1, ::-1]
        # d/dc of I(c + d) - I(c - d); where both halves are alike, twice the slope
        change = 0.5 * (slope - slope[:, ::-1, ::-1])
        normal = np.einsum("ivu,jvu,vu->ij", change, change, weight)
        if np.linalg.eigvalsh(normal)[0] <= 0:
            return None
        step = -np.linalg.solve(normal, np.einsum("ivu,vu,vu->i", change, odd, weight))
        center = center + step.clip(-2.0, 2.0)
        if np.abs(step).max() < _CONVERGED_PX:
            break
    least = float(np.sqrt(np.linalg.eigvalsh(normal)[0] / weight.sum()))
    return Centre(center, _covariance(change, odd, weight), _likeness(value, weight), least)


def likeness_about(photo: Image, center_px: Floats, radius_px: int) -> float:
    """The likeness of both halves of a disc; -1 where the photo's edge cuts it.

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


def _covariance(change: Floats, odd: Floats, weight: Bools) -> Floats:
    """Of the centre, by the differences of both halves.

    The sums go over both halves, so every difference is in them twice: with the variance q of the
    differences it is 2 q N^-1. What runs on from pixel to pixel (JPEG, texture of what lies
    around) counts for fewer.
    """
    used = np.where(weight, odd, 0.0)
    count = weight.sum()
    variance = max(float((used**2).sum() / max(count - 4.0, 1.0)), 2 * _LEAST_NOISE**2)
    total = max(float((used**2).mean() * used.size / count), 1e-9)
    growth = 1.0
    for pair, both in (
        (used[:, 1:] * used[:, :-1], weight[:, 1:] & weight[:, :-1]),
        (used[1:] * used[:-1], weight[1:] & weight[:-1]),
    ):
        one = np.clip(pair.sum() / max(both.sum(), 1) / total, 0.0, _MOST_CORRELATION)
        growth *= (1.0 + one) / (1.0 - one)
    normal = np.einsum("ivu,jvu,vu->ij", change, change, weight)
    return np.asarray(2.0 * variance * growth * np.linalg.inv(normal))


def _likeness(value: Floats, weight: Bools) -> float:
    here, there = value[weight], value[::-1, ::-1][weight]
    spread = float(here.std() * there.std())
    return float(((here - here.mean()) * (there - there.mean())).mean() / max(spread, 1e-9))


class _Surface:
    """The grey values about a place as a smooth surface: the cubic spline through all pixels.

    The usual four-point interpolation of pictures (`cv2.remap`) does not look the same in a mirror,
    between pixels, and takes places to 1/32 px: it moved centres of sharp targets by 0.03 px, where
    this moves them by less than 0.001 px.

    Parameters
    ----------
    photo
        (height, width) grey values.
    middle_px
        (2,) about which it is cut out.
    half
        So far beyond it, at the least, that it may be asked for.
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
        """(2 half + 1, 2 half + 1) values about a place; None where they are not all in it."""
        at = (center_px - self._first)[:, None] + np.arange(-half, half + 1)
        if (at[:, 0] < 2).any() or (at[:, -1] > self._size - 3).any():
            return None
        across, down = (_weights(row, int(size)) for row, size in zip(at, self._size, strict=True))
        return np.asarray(down @ self._knots @ across.T)


def _weights(at: Floats, size: int) -> Floats:
    """(n, size) of each knot of a cubic spline in its values at n evenly spaced places."""
    share = at[0] - np.floor(at[0])
    four = _BELL(share - np.arange(-1, 3))
    first = np.arange(len(at))[:, None] + int(np.floor(at[0])) + np.arange(-1, 3)
    weights = np.zeros((len(at), size))
    np.put_along_axis(weights, first, np.nan_to_num(four)[None].repeat(len(at), axis=0), axis=1)
    return weights
