"""Candidates of coded plates in a photo: OpenCV's marker detector with a finer search.

With its defaults OpenCV misses most plates below 20 pixels a side. With the smallest perimeter at
0.005 of the photo's size and threshold windows from 5 to 29 pixels it finds all of 20; in the photo
enlarged twice also those of 12 to 16 pixels.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from uavgram.imaging.plates.families import dictionary
from uavgram.imaging.raster import Image
from uavgram.model.arrays import Floats

_LEAST_PERIMETER = 0.005
_WINDOWS_PX = (5, 29, 8)  # first, last, step
_MOST_DOUBLED_PX = 60e6  # larger photos would take seconds and a quarter of a GB
_SAME = 0.5  # of a side: two finds of one id within this distance are one plate


class Candidate(NamedTuple):
    """Candidate of a plate: its id, and its corners (4, 2) to a pixel."""

    plate: int
    corner_px: Floats


def candidates(image: Image, family: str, *, doubled: bool = True) -> list[Candidate]:
    """Find candidates of plates of a family, without verification.

    Parameters
    ----------
    image
        (height, width) grey.
    family
        One of `FAMILIES`.
    doubled
        Whether to search for small ones, too, in the photo enlarged twice.
    """
    detector = _detector(family)
    found: list[Candidate] = []
    for scale in (1, 2) if doubled else (1,):
        if scale > 1 and image.size > _MOST_DOUBLED_PX:
            break
        larger = image if scale == 1 else _doubled(image)
        quads, ids, _ = detector.detectMarkers(larger)
        # OpenCV's stubs declare an array; it returns None where there is no marker
        numbers = [] if not quads else np.asarray(ids, np.int64).ravel().tolist()
        for quad, plate in zip(quads, numbers, strict=True):
            corner = (np.asarray(quad, np.float64).reshape(4, 2) + 0.5) / scale - 0.5
            if not any(_is_same(one, int(plate), corner) for one in found):
                found.append(Candidate(int(plate), corner))
    return found


def _doubled(image: Image) -> Image:
    return np.asarray(cv2.resize(image, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC), np.uint8)


def _detector(family: str) -> cv2.aruco.ArucoDetector:
    options = cv2.aruco.DetectorParameters()
    options.minMarkerPerimeterRate = _LEAST_PERIMETER
    options.adaptiveThreshWinSizeMin = _WINDOWS_PX[0]
    options.adaptiveThreshWinSizeMax = _WINDOWS_PX[1]
    options.adaptiveThreshWinSizeStep = _WINDOWS_PX[2]
    options.minDistanceToBorder = 1
    return cv2.aruco.ArucoDetector(dictionary(family), options)


def _is_same(one: Candidate, plate: int, corner_px: Floats) -> bool:
    side = np.linalg.norm(np.diff(one.corner_px, axis=0), axis=1).min()
    apart = np.linalg.norm(one.corner_px.mean(axis=0) - corner_px.mean(axis=0))
    return bool(one.plate == plate and apart < _SAME * side)
