"""Comparison of two photo files that may show the same exposure."""

from __future__ import annotations

import cv2
import numpy as np

from uavgram.imaging.photos.decode import read_reduced

_REDUCTION = 8
_ROUNDING = 1.0
"""Grey levels by which pictures without content may differ through compression alone."""


def shows_the_same(one: str, other: str) -> bool:
    """Return whether two photos of one size differ by less than a shift of a few pixels does.

    Parameters
    ----------
    one, other
        Their files, in any format that OpenCV reads.

    Raises
    ------
    InputError
        A file cannot be read, or is not a photo.
    """
    first, second = (read_reduced(path, lambda _: _REDUCTION)[0] for path in (one, other))
    size = min(first.shape[1::-1], second.shape[1::-1])  # only JPEGs are reduced
    first, second = (
        cv2.resize(pixels, size, interpolation=cv2.INTER_AREA).astype(np.float64).mean(axis=2)
        for pixels in (first, second)
    )
    shift = np.diff(first, axis=1).std()
    return bool((first - second).std() < max(_ROUNDING, 0.5 * shift))
