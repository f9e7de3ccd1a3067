"""Pictures of a calibration's photos, made from reduced copies: each photo is decoded once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.imaging.photos.preview import Preview, decode_preview
from uavgram.imaging.targets.draw_board import draw_board
from uavgram.model.camera.board import Board, BoardPhoto


def found_picture(
    preview: Preview,
    board: Board,
    photo: BoardPhoto,
    residual_px: np.ndarray | None = None,
    magnification: float = 1.0,
) -> bytes:
    """JPEG of a reduced photo with what was found in the original; see `draw_board`.

    Parameters
    ----------
    preview
        The reduced photo.
    board, photo
        What was found, in original pixels.
    residual_px
        (n, 2) of the corners, drawn as arrows.
    magnification
        Of the arrows.
    """
    scale = np.array(preview.scale)
    small = replace(photo, pixel_px=(photo.pixel_px + 0.5) / scale - 0.5)
    return draw_board(
        np.ascontiguousarray(decode_preview(preview)[:, :, 0]),
        board,
        small,
        residual_px=None if residual_px is None else residual_px / scale,
        magnification=magnification,
    )
