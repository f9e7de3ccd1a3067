"""Where in the image a board's corners were found: counts per cell, and a picture of them."""

from __future__ import annotations

import cv2
import numpy as np

from uavgram.imaging.raster import Image
from uavgram.model.arrays import Ints
from uavgram.model.camera.board import BoardObservations

CELLS_ACROSS = 16
PICTURE_WIDTH_PX = 800
_EMPTY = (60, 60, 190)  # BGR: what deserves another photo
_FEW, _MANY = np.array([120.0, 90.0, 40.0]), np.array([250.0, 220.0, 150.0])
_LINE = (90, 90, 90)


def corner_coverage(observations: BoardObservations, cells_across: int = CELLS_ACROSS) -> Ints:
    """(rows, cells_across) number of corners of all photos in each cell of the image.

    The cells are as good as square. Row 0 is the image's top.
    """
    first = observations.photos[0]
    size = np.array([first.width_px, first.height_px])
    cells = np.array([cells_across, max(1, round(cells_across * size[1] / size[0]))])
    pixel = np.concatenate([photo.pixel_px for photo in observations.photos])
    # pixel coordinates run from -0.5 at the image's edge
    cell = np.floor((pixel + 0.5) / size * cells).astype(np.int64).clip(0, cells - 1)
    count: Ints = np.zeros((cells[1], cells[0]), np.int64)
    np.add.at(count, (cell[:, 1], cell[:, 0]), 1)
    return count


def draw_coverage(count: Ints, size_px: tuple[int, int]) -> Image:
    """(height, PICTURE_WIDTH_PX, 3) RGB: blue by number of corners, red where there is none.

    Parameters
    ----------
    count
        From `corner_coverage`.
    size_px
        Width and height of the photos.
    """
    strength = np.log1p(count) / np.log1p(max(int(count.max()), 1))
    color = _FEW + strength[..., None] * (_MANY - _FEW)
    color[count == 0] = _EMPTY
    width, height = PICTURE_WIDTH_PX, max(1, round(PICTURE_WIDTH_PX * size_px[1] / size_px[0]))
    cells = np.round(color).astype(np.uint8)
    picture = np.asarray(cv2.resize(cells, (width, height), interpolation=cv2.INTER_NEAREST))
    rows, columns = count.shape
    for row in range(rows):
        for column in range(columns):
            place = (round((column + 0.2) * width / columns), round((row + 0.65) * height / rows))
            text = str(count[row, column])
            font = cv2.FONT_HERSHEY_SIMPLEX
            cv2.putText(picture, text, place, font, 0.4, _LINE, 1, cv2.LINE_AA)
    return np.ascontiguousarray(picture[:, :, ::-1], dtype=np.uint8)
