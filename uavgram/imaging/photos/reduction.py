"""Reduction of pictures: means of the covered pixels, halves with opacity, copies for a search."""

from __future__ import annotations

import math
from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from uavgram.imaging.raster import Image
from uavgram.model.arrays import Floats

Pixels = NDArray[np.uint8]


def shrink(pixels: Pixels, longest_px: int, *, across_only: bool = False) -> Pixels:
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
        pixels = halve(pixels)
    halvings = int(math.log2(_reduction(pixels, size)))
    larger = size[0] << halvings, size[1] << halvings
    pixels = np.asarray(cv2.resize(pixels, larger, interpolation=cv2.INTER_LINEAR), np.uint8)
    for _ in range(halvings):
        pixels = halve(pixels)
    return pixels


def _reduction(pixels: Pixels, size: tuple[int, int]) -> float:
    """Compute how many pixels become one, along the side where they are fewer."""
    return float(min(pixels.shape[1] / size[0], pixels.shape[0] / size[1]))


def halve(pixels: Pixels) -> Pixels:
    """Compute means of 2 x 2 pixels, odd edges repeated."""
    rows, columns = pixels.shape[0] // 2, pixels.shape[1] // 2
    halved = np.empty(
        (-(-pixels.shape[0] // 2), -(-pixels.shape[1] // 2), *pixels.shape[2:]), np.uint8
    )
    _fill_halved(pixels[: 2 * rows, : 2 * columns], halved[:rows, :columns])
    if len(halved) > rows:
        _fill_halved(pad_to_even(pixels[-1:]), halved[-1:])
    if halved.shape[1] > columns:
        _fill_halved(pad_to_even(pixels[:, -1:]), halved[:, -1:])
    return halved


def _fill_halved(even: Pixels, halved: Pixels) -> None:
    """Fill a picture with means of 2 x 2 pixels of another one."""
    if halved.size:
        # INTER_AREA at exactly one half gives this mean, rounded.
        cv2.resize(even, halved.shape[1::-1], dst=halved, interpolation=cv2.INTER_AREA)


def pad_to_even(pixels: Pixels) -> Pixels:
    """Repeat the last row or column where the height or the width is odd."""
    down, right = pixels.shape[0] % 2, pixels.shape[1] % 2
    if not (down or right):
        return pixels
    return np.asarray(cv2.copyMakeBorder(pixels, 0, down, 0, right, cv2.BORDER_REPLICATE), np.uint8)


FULL_OPACITY = 255


def halve_with_opacity(rgba: Pixels) -> Pixels:
    """Average two by two pixels into one, weighted by their opacity.

    Parameters
    ----------
    rgba
        (H, W, 4) colour, not multiplied by opacity, and opacity.

    Returns
    -------
    (ceil(H / 2), ceil(W / 2), 4), opacity the plain mean. The last row and column are not averaged
    with others where H or W is odd.
    """
    rgba = pad_to_even(rgba)
    means = halve(rgba)
    height, width = means.shape[:2]
    opacity = means[..., 3]
    rim = np.nonzero(
        (opacity > 0) & (opacity < FULL_OPACITY)
    )  # few pixels: only the edge is partly opaque
    if rim[0].size:
        four = rgba.reshape(height, 2, width, 2, 4)[rim[0], :, rim[1]].reshape(-1, 4, 4)
        weight = four[..., 3:].astype(np.float64)
        means[..., :3][rim] = np.rint((four[..., :3] * weight).sum(1) / weight.sum(1))
    return means


def make_reduced_copies(image: Image, widths_px: tuple[int, ...]) -> Iterator[tuple[int, Image]]:
    """Make copies from small to large, each with its original pixels per pixel.

    Parameters
    ----------
    image
        (height, width) grey.
    widths_px
        Least longer sides of the copies: photos are reduced by whole factors, which is fast. The
        photo itself replaces the first copy that needs no reduction, and ends the series.
    """
    height, width = image.shape
    for wanted in widths_px:
        factor = max(height, width) // wanted
        if factor < 2:
            yield 1, image
            return
        size = (width // factor, height // factor)
        whole = image[: size[1] * factor, : size[0] * factor]
        yield factor, np.asarray(cv2.resize(whole, size, interpolation=cv2.INTER_AREA), np.uint8)


def scale_to_original(pixel_px: Floats, factor: int) -> Floats:
    """Convert pixels (..., 2) to the original.

    (0, 0) is the centre of the top-left pixel in both.
    """
    return np.asarray((pixel_px + 0.5) * factor - 0.5, np.float64)
