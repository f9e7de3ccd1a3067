"""Drawing of a photo with the corners found in it."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np

from uavgram.imaging.photos.preview import JPEG_QUALITY, Preview, decode_preview
from uavgram.imaging.raster import Image
from uavgram.model.arrays import Floats
from uavgram.model.camera.board import Board, BoardPhoto

_SHIFT = 4  # OpenCV draws to 1/16 px
_RADIUS_PX = 5
_LINE, _FIRST, _TEXT = (60, 200, 60), (60, 60, 240), (240, 160, 20)  # BGR
_ARROW = (220, 60, 220)


def draw_board(
    preview: Preview,
    board: Board,
    photo: BoardPhoto,
    residual_px: Floats | None = None,
    magnification: float = 1.0,
) -> bytes:
    """Draw the corners, their numbers and the rows of the board in a reduced photo; return a JPEG.

    Parameters
    ----------
    preview
        The photo, grey and reduced: each photo is decoded once.
    board, photo
        Board, and its corners in original pixels.
    residual_px
        (n, 2) of the corners, drawn as arrows.
    magnification
        Magnification of the arrows.
    """
    scale = np.array(preview.scale)
    grey = np.ascontiguousarray(decode_preview(preview)[:, :, 0])
    picture = np.asarray(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), np.uint8)
    place = np.full((board.rows * board.columns, 2), np.nan)
    place[photo.corner] = (photo.pixel_px + 0.5) / scale - 0.5
    _draw_rows(picture, place.reshape(board.rows, board.columns, 2))
    found = place[photo.corner]
    for index, center in zip(photo.corner.tolist(), found, strict=True):
        color = _FIRST if index == 0 else _LINE
        cv2.circle(picture, _fixed(center), _RADIUS_PX << _SHIFT, color, 1, cv2.LINE_AA, _SHIFT)
    _draw_numbers(picture, photo, found, board.columns)
    if residual_px is not None:
        ends = found + residual_px / scale * magnification
        for start, end in zip(found, ends, strict=True):
            cv2.line(picture, _fixed(start), _fixed(end), _ARROW, 2, cv2.LINE_AA, _SHIFT)
    quality = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
    return bytes(cv2.imencode(".jpg", picture, quality)[1].tobytes())


def _draw_rows(picture: Image, grid: Floats) -> None:
    """Connect the known corners of each row."""
    for row in grid:
        known = row[np.isfinite(row[:, 0])]
        for start, end in pairwise(known):
            cv2.line(picture, _fixed(start), _fixed(end), _LINE, 1, cv2.LINE_AA, _SHIFT)


def _draw_numbers(picture: Image, photo: BoardPhoto, place: Floats, columns: int) -> None:
    """Write the numbers of the corners; only each row's first and last where space is short."""
    step = np.ptp(place, axis=0).max() / max(columns - 1, 1) if len(place) else 0.0
    for index, (u, v) in zip(photo.corner.tolist(), place.tolist(), strict=True):
        if step < 30 and index % columns not in (0, columns - 1):
            continue
        at = (round(u) + _RADIUS_PX, round(v) - _RADIUS_PX)
        cv2.putText(picture, str(index), at, cv2.FONT_HERSHEY_SIMPLEX, 0.4, _TEXT, 1, cv2.LINE_AA)


def _fixed(point: Floats) -> tuple[int, int]:
    u, v = np.round(point * (1 << _SHIFT)).astype(int).tolist()
    return u, v
