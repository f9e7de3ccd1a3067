"""Families of coded plates: their ids, and the black and white cells of each plate."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from uavgram.model.arrays import Bools
from uavgram.model.target_families import FAMILIES


@lru_cache(maxsize=8)
def dictionary(family: str) -> cv2.aruco.Dictionary:
    """Return OpenCV's dictionary of a family; its name is one of `FAMILIES`."""
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, FAMILIES[family]))


def size_of(family: str) -> int:
    """Return the number of plates in a family: their ids run from 0."""
    return len(dictionary(family).bytesList)


@lru_cache(maxsize=256)
def cells_of(family: str, plate: int) -> Bools:
    """Return the (n, n) cells of a plate, its black border included; True is white.

    The first row is the upper edge, from the plate's first corner to its second.
    """
    codes = dictionary(family)
    side = codes.markerSize + 2
    drawn = cv2.aruco.generateImageMarker(codes, plate, side, borderBits=1)
    return np.asarray(drawn) > 127
