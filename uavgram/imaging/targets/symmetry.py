"""The centre about which a picture looks the same after half a turn, to hundredths of a pixel.

Chequers, crosses and discs all are their own image after half a turn, and stay so in any affine
view. So the centre is where the differences I(c + d) - I(c - d) are least: no shape, no size and
no brightness has to be known.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from uavgram.imaging.raster import Image
from uavgram.model.arrays import Bools, Floats

_ROUNDS = 15
_CONVERGED_PX = 1e-3
_LEAST_NOISE = 0.3  # of rounding to whole grey values: 1 / sqrt(12)
_MOST_CORRELATION = 0.9


class Centre(NamedTuple):
    """A centre (2,) [px], its covariance (2, 2) [px^2] and the likeness of both halves, -1 to 1.

    `slope` [grey values/px] is the root mean square of that of both halves together, in the
    direction in which it is least.
    """

    pixel_px: Floats
    covariance_px2: Floats
    likeness: float
    slope: float


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
    for _ in range(_ROUNDS):
        around = _window(photo, center, half + 1)
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
    value = _window(photo, center_px, radius_px)
    if value is None:
        return -1.0
    v, u = np.mgrid[-radius_px : radius_px + 1, -radius_px : radius_px + 1]
    return _likeness(value, u**2 + v**2 <= radius_px**2)


def _covariance(change: Floats, odd: Floats, weight: Bools) -> Floats:
    """Of the centre, by the differences of both halves.

    The sums go over both halves, so every difference is in them twice: with the variance q of the
    differences it is 2 q N^-1. What runs on from pixel to pixel (JPEG, texture of what lies
    around, what interpolation smoothed) counts for fewer.
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


def _window(photo: Image, center_px: Floats, half: int) -> Floats | None:
    """(2 half + 1, 2 half + 1) values about a place; None where they are not all in the photo."""
    corner = np.floor(center_px).astype(int) - half - 4
    beyond = corner + 2 * half + 10
    if (corner < 0).any() or (beyond > photo.shape[1::-1]).any():
        return None
    part = photo[corner[1] : beyond[1], corner[0] : beyond[0]].astype(np.float32)
    at = (center_px - corner)[:, None] + np.arange(-half, half + 1)
    u, v = np.meshgrid(*at.astype(np.float32))
    return np.asarray(cv2.remap(part, u, v, cv2.INTER_CUBIC), np.float64)
