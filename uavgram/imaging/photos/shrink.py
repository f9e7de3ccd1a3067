"""Reduction of pictures: each pixel is a mean of the pixels it covers."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[np.uint8]


def shrunk(pixels: Pixels, longest_px: int, *, across_only: bool = False) -> Pixels:
    """Reduce a picture so that its longer side is at most `longest_px`.

    The same array is returned where it already is.

    Parameters
    ----------
    pixels
        (height, width) or (height, width, channels).
    longest_px
        Limit of the longer side.
    across_only
        Whether the limit applies to the width alone.

    Notes
    -----
    OpenCV's mean over areas takes four times as long as its bilinear mean, and twenty times as long
    as that of exactly 2 x 2 pixels. So a picture is halved as often as possible; the remaining
    reduction, by less than one half, is bilinear: all covered pixels contribute to each new pixel,
    though not by their area alone.
    """
    height, width = pixels.shape[:2]
    share = longest_px / (width if across_only else max(height, width, 1))
    if share >= 1.0:
        return pixels
    size = max(1, round(share * width)), max(1, round(share * height))
    while _reduction(pixels, size) >= 2.0 and not (pixels.shape[0] % 2 or pixels.shape[1] % 2):
        pixels = half(pixels)
    halvings = int(math.log2(_reduction(pixels, size)))
    larger = size[0] << halvings, size[1] << halvings
    pixels = np.asarray(cv2.resize(pixels, larger, interpolation=cv2.INTER_LINEAR), np.uint8)
    for _ in range(halvings):
        pixels = half(pixels)
    return pixels


def _reduction(pixels: Pixels, size: tuple[int, int]) -> float:
    """Compute how many pixels become one, along the side where they are fewer."""
    return float(min(pixels.shape[1] / size[0], pixels.shape[0] / size[1]))


def half(pixels: Pixels) -> Pixels:
    """Compute means of 2 x 2 pixels, odd edges repeated."""
    rows, columns = pixels.shape[0] // 2, pixels.shape[1] // 2
    halved = np.empty(
        (-(-pixels.shape[0] // 2), -(-pixels.shape[1] // 2), *pixels.shape[2:]), np.uint8
    )
    _halve(pixels[: 2 * rows, : 2 * columns], halved[:rows, :columns])
    if len(halved) > rows:
        _halve(evened(pixels[-1:]), halved[-1:])
    if halved.shape[1] > columns:
        _halve(evened(pixels[:, -1:]), halved[:, -1:])
    return halved


def _halve(even: Pixels, halved: Pixels) -> None:
    """Fill a picture with means of 2 x 2 pixels of another one."""
    if halved.size:
        # INTER_AREA at exactly one half gives this mean, rounded.
        cv2.resize(even, halved.shape[1::-1], dst=halved, interpolation=cv2.INTER_AREA)


def evened(pixels: Pixels) -> Pixels:
    """Repeat the last row or column where the height or the width is odd."""
    down, right = pixels.shape[0] % 2, pixels.shape[1] % 2
    if not (down or right):
        return pixels
    return np.asarray(cv2.copyMakeBorder(pixels, 0, down, 0, right, cv2.BORDER_REPLICATE), np.uint8)
