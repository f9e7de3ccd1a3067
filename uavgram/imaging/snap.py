"""Refinement of a click to the exact place of a corner or a round target, with its sigma.

The sigma propagates the noise of the grey values through the estimate. It measures the picture's
precision, not whether the place is on the intended object.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

from uavgram.imaging.photos.preview import Pixels
from uavgram.imaging.raster import Image
from uavgram.imaging.targets.gradient import measure_gradient_corners
from uavgram.imaging.targets.saddle import cut_windows
from uavgram.model.arrays import Floats

CORNER_HALF_PX = 6
"""Half the window in which edges are used."""

CIRCLE_HALF_PX = 48
"""Half the window that must contain a round target completely."""

MOST_SIGMA_PX = 0.5
"""Largest accepted sigma: a place known less well is no better than the click."""

SMALLEST_SIGMA_PX = 0.03
"""Least sigma that uneven blur, JPEG and sharpening allow."""

_LEAST_NOISE = 0.3  # of rounding to whole grey values: 1 / sqrt(12)
_LEAST_CONTRAST = 6.0  # in standard deviations of the noise
_LEAST_ROUND = 0.75
_FLATTEST = 0.3  # ratio of axes of a circle seen at 17 degrees above the ground
_LEAST_AREA_PX = 12


@dataclass(frozen=True)
class Snapped:
    """Place (u, v) [px], its sigma in the worse direction [px], and the kind of object there."""

    u_px: float
    v_px: float
    sigma_px: float
    what: Literal["corner", "target"]


def snap_corner(photo: Pixels, u_px: float, v_px: float) -> Snapped | str:
    """Find the point where edges meet near a pixel, or give the reason why there is none.

    Parameters
    ----------
    photo
        (height, width, 3) BGR.
    u_px, v_px
        Pixel of the click.
    """
    half = 2 * CORNER_HALF_PX + 2
    cut = _cut_around(photo, u_px, v_px, half)
    if cut is None:
        return "too close to the edge of the photo"
    grey, first = cut
    start = np.array([[u_px, v_px]]) - first
    wide = np.eye(2)[None] * 4.0 * half
    windows = cut_windows(grey, start, wide, CORNER_HALF_PX, 1.0)
    noise = np.array([max(_estimate_noise(grey), _LEAST_NOISE)])
    low, high = np.percentile(windows.grey[0], [5, 95])
    if high - low < _LEAST_CONTRAST * noise[0]:
        return "no corner here: the picture is nearly of one brightness"
    corner, covariance = measure_gradient_corners(grey, windows, start, noise)
    if np.abs(corner - start).max() > CORNER_HALF_PX - 1.0:
        return "no corner within reach: click closer to it"
    sigma = float(np.sqrt(np.linalg.eigvalsh(covariance[0])[-1]))
    otherwise = "no corner here: edges run in one direction only"
    return _judged(corner[0] + first, sigma, "corner", otherwise)


def snap_circle(photo: Pixels, u_px: float, v_px: float) -> Snapped | str:
    """Find the centre of gravity of the round target under a pixel, or give the reason why not.

    In an oblique view the centre of the image of a circle is not the image of its centre; for small
    targets the difference is far below a pixel.

    Parameters
    ----------
    photo
        (height, width, 3) BGR.
    u_px, v_px
        Pixel of the click.
    """
    cut = _cut_around(photo, u_px, v_px, CIRCLE_HALF_PX)
    if cut is None:
        return "too close to the edge of the photo"
    grey, first = cut
    at = np.round(np.array([u_px, v_px]) - first).astype(int)
    blob = _blob(grey, at)
    if isinstance(blob, str):
        return blob
    inside = cv2.dilate(blob, np.ones((5, 5), np.uint8)).astype(bool)
    around = cv2.dilate(blob, np.ones((9, 9), np.uint8)).astype(bool) & ~inside
    values = grey.astype(np.float64)
    ground, top = np.median(values[around]), np.median(values[blob.astype(bool)])
    noise = max(_estimate_noise(grey), _LEAST_NOISE)
    if abs(top - ground) < _LEAST_CONTRAST * noise:
        return "the target hardly differs from its surroundings"
    # Centre of gravity, with the coverage of each pixel by the target as weight.
    share = np.where(inside, (values - ground) / (top - ground), 0.0)
    v, u = np.mgrid[: grey.shape[0], : grey.shape[1]]
    place = np.stack([u, v], axis=-1).astype(np.float64)
    total = share.sum()
    center = np.einsum("vu,vui->i", share, place) / total
    # Variance propagation: each grey value moves the centre by (x - c) / (contrast * total).
    arm = place[inside] - center
    covariance = arm.T @ arm * (noise / ((top - ground) * total)) ** 2
    sigma = float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
    return _judged(center + first, sigma, "target", "the target is too faint")


def _cut_around(photo: Pixels, u_px: float, v_px: float, half: int) -> tuple[Image, Floats] | None:
    """Cut grey surroundings of a pixel; return them and the pixel of their first corner."""
    height, width = photo.shape[:2]
    u, v = round(u_px), round(v_px)
    left, top = max(u - half, 0), max(v - half, 0)
    part = photo[top : min(v + half + 1, height), left : min(u + half + 1, width)]
    least = 2 * CORNER_HALF_PX + 5
    if min(part.shape[:2]) < least:
        return None
    grey = np.asarray(cv2.cvtColor(part, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
    return grey, np.array([left, top], dtype=np.float64)


def _estimate_noise(grey: Image) -> float:
    """Estimate the standard deviation of white noise by a Laplacian that cancels straight edges.

    Immerkaer 1996, "Fast noise variance estimation"; the median instead of the mean excludes
    corners. The root of the sum of squares of the mask's weights is 6.
    """
    mask = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float64)
    response = cv2.filter2D(grey.astype(np.float64), -1, mask)[1:-1, 1:-1]
    return float(np.median(np.abs(response)) / 0.6745 / 6.0)


def _blob(grey: Image, at: np.ndarray[tuple[int], np.dtype[np.int64]]) -> Image | str:
    """Segment the round patch of one brightness under a pixel, or give the reason why not."""
    _, bright = cv2.threshold(grey, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    if not bright[at[1], at[0]]:
        bright = cv2.bitwise_not(bright)
    _, part, stats, _ = cv2.connectedComponentsWithStats(bright, connectivity=4)
    own = part[at[1], at[0]]
    left, top, width, height, area = stats[own]
    if left == 0 or top == 0 or left + width == grey.shape[1] or top + height == grey.shape[0]:
        return "no closed target under the pointer"
    if area < _LEAST_AREA_PX:
        return "the target is too small"
    blob = np.asarray(part == own, dtype=np.uint8)
    outline = max(cv2.findContours(blob, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0], key=len)
    (_, _), axes, _ = cv2.fitEllipse(outline) if len(outline) >= 5 else ((0, 0), (1, 1), 0)
    ellipse = np.pi / 4 * axes[0] * axes[1]
    filled = cv2.contourArea(outline)
    if min(axes) <= _FLATTEST * max(axes) or not _LEAST_ROUND < filled / ellipse < 1 / _LEAST_ROUND:
        return "the patch under the pointer is not round"
    return np.asarray(cv2.drawContours(blob, [outline], -1, [1], cv2.FILLED), dtype=np.uint8)


def _judged(
    place: Floats, sigma: float, what: Literal["corner", "target"], otherwise: str
) -> Snapped | str:
    if not (np.isfinite(place).all() and sigma <= MOST_SIGMA_PX):
        return otherwise
    return Snapped(float(place[0]), float(place[1]), max(sigma, SMALLEST_SIGMA_PX), what)
