"""Reduced copies of a large photo, and conversion of their pixels to the original."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np

from uavgram.imaging.raster import Image
from uavgram.model.arrays import Floats


def reduced_copies(image: Image, widths_px: tuple[int, ...]) -> Iterator[tuple[int, Image]]:
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


def to_full_size(pixel_px: Floats, factor: int) -> Floats:
    """Convert pixels (..., 2) to the original.

    (0, 0) is the centre of the top-left pixel in both.
    """
    return np.asarray((pixel_px + 0.5) * factor - 0.5, np.float64)
