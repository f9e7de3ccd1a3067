"""Part of the ground as a picture to print."""

from __future__ import annotations

import cv2
import numpy as np

from uavgram.imaging.photos.shrink import shrunk
from uavgram.imaging.top_view.mosaic import GroundTexture
from uavgram.model.arrays import Floats
from uavgram.model.result.pictures import GroundPicture

MOST_PX = 1200
"""Largest longer side: 170 pixels an inch across a page of that width."""
QUALITY = 82


def cut_ground(texture: GroundTexture, low_m: Floats, high_m: Floats) -> GroundPicture | None:
    """Cut a part of the ground as a picture; None where no photo shows any of it.

    Parameters
    ----------
    texture
        Whole photographed ground.
    low_m, high_m
        (2,) its south-western and north-eastern corner, in the world.
    """
    size = texture.pixel_size_m
    rows, columns = texture.covered.shape
    corner = np.array([texture.west_m, texture.north_m])
    first = np.floor((np.array([low_m[0], -high_m[1]]) - corner * [1, -1]) / size).astype(int)
    last = np.ceil((np.array([high_m[0], -low_m[1]]) - corner * [1, -1]) / size).astype(int)
    left, top = np.clip(first, 0, [columns, rows])
    right, bottom = np.clip(last, 0, [columns, rows])
    covered = texture.covered[top:bottom, left:right]
    if not covered.any():
        return None
    white = np.where(covered, np.uint8(0), np.uint8(255))  # where no photo shows the ground
    shown = cv2.bitwise_or(
        texture.rgb[top:bottom, left:right], cv2.cvtColor(white, cv2.COLOR_GRAY2RGB)
    )
    small = shrunk(np.asarray(shown, np.uint8), MOST_PX)
    quality = [int(cv2.IMWRITE_JPEG_QUALITY), QUALITY]
    encoded = cv2.imencode(".jpg", cv2.cvtColor(small, cv2.COLOR_RGB2BGR), quality)[1]
    return GroundPicture(
        jpeg=bytes(encoded.tobytes()),
        west_m=float(texture.west_m + left * size),
        north_m=float(texture.north_m - top * size),
        width_m=float((right - left) * size),
        height_m=float((bottom - top) * size),
        brightened=not texture.tone.is_identity,
    )
