"""Features of a photo that can be found again in another, with descriptors.

OpenCV's SIFT at a reduced size. Measured on rendered streets with true poses, 2400 x 1800 px, half
size: epipolar distances of matches have a median of 0.08 px looking down and 0.16 px at 45 degrees
in 0.4 s a photo; pycolmap 4.2's SIFT (VLFeat) on the same reduced photos 0.13 and 0.28 px in 5.6 s.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from uavgram.errors import InputError
from uavgram.imaging.photos.decode import decode_photo, jpeg_size
from uavgram.imaging.raster import Image
from uavgram.model.arrays import Floats, Ints

WORKING_PX = 1600
"""Longer side of the pictures in which features are detected."""

KEPT = 2500
"""Number of features kept in a photo, spread over it."""

CELL_PX = 80
"""Edge of the cells of the working picture over which they are spread."""

CONTRAST = 0.02
"""SIFT's contrast threshold, half the usual one.

Dark photos and asphalt have features that are weak but good.
"""

_GREY = {
    1: cv2.IMREAD_GRAYSCALE,
    2: cv2.IMREAD_REDUCED_GRAYSCALE_2,
    4: cv2.IMREAD_REDUCED_GRAYSCALE_4,
    8: cv2.IMREAD_REDUCED_GRAYSCALE_8,
}


class Features(NamedTuple):
    """N features of a photo.

    Attributes
    ----------
    pixel_px
        (N, 2) in the original photo, (0, 0) = centre of the top-left pixel.
    size_px
        (N,) diameter of each feature, in original pixels.
    descriptor
        (N, 128) SIFT descriptors.
    """

    pixel_px: Floats
    size_px: Floats
    descriptor: NDArray[np.uint8]

    def take(self, rows: Ints) -> Features:
        """Select rows."""
        return Features(self.pixel_px[rows], self.size_px[rows], self.descriptor[rows])


def read_features(path: str | os.PathLike[str]) -> Features:
    """Detect features of a photo file; EXIF rotation is not applied.

    Raises
    ------
    InputError
        The file cannot be read, or is not a photo.
    """
    try:
        encoded = Path(path).read_bytes()
    except OSError as error:
        raise InputError(path, f"cannot be read: {error.strerror}") from error
    size = jpeg_size(encoded)
    longer = max(size) if size else 0
    reduction = max((r for r in _GREY if longer >= r * WORKING_PX), default=1)
    grey = decode_photo(path, encoded, _GREY[reduction])
    return find_features(grey, reduction)


def find_features(grey: Image, original_px: float = 1.0) -> Features:
    """Detect features of a decoded photo, spread over it.

    Parameters
    ----------
    grey
        (height, width).
    original_px
        Pixels of the original photo per pixel.
    """
    height, width = grey.shape
    shrink = min(1.0, WORKING_PX / max(height, width))
    small = max(1, round(width * shrink)), max(1, round(height * shrink))
    if shrink < 1.0:
        grey = np.asarray(cv2.resize(grey, small, interpolation=cv2.INTER_AREA), np.uint8)
    scale = np.array([width / small[0], height / small[1]]) * original_px
    sift = cv2.SIFT.create(
        contrastThreshold=CONTRAST,
        # otherwise all places are off by a quarter of a pixel, as two photos of opposite heading
        # show
        enable_precise_upscale=True,
    )
    points = sift.detect(grey)
    if not points:
        return Features(np.empty((0, 2)), np.empty(0), np.empty((0, 128), np.uint8))
    place = np.asarray(cv2.KeyPoint.convert(points), np.float64)
    rows = _spread(place, np.array([point.response for point in points], np.float64))
    # describe only the kept ones: this costs more than building the pyramid a second time
    points, described = sift.compute(grey, [points[k] for k in rows])
    # OpenCV's pixels also count from the centre of the top-left one
    place = np.array([point.pt for point in points], np.float64)
    size = np.array([point.size for point in points], np.float64)
    return Features((place + 0.5) * scale - 0.5, size * scale.mean(), described.astype(np.uint8))


def _spread(place: Floats, response: Floats) -> Ints:
    """Choose the rows of the strongest features of each cell, at most `KEPT` in all."""
    cell = np.floor(place / CELL_PX).astype(np.int64)
    key = cell[:, 0] * 100_000 + cell[:, 1]
    order = np.lexsort((-response, key))
    starts = np.flatnonzero(np.diff(key[order], prepend=-1))
    rank = np.arange(len(order)) - np.repeat(starts, np.diff(np.append(starts, len(order))))
    # rank by rank: the strongest of every cell, then the second of every cell
    taken = order[np.lexsort((-response[order], rank))[:KEPT]]
    return np.sort(taken)
