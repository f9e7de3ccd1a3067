"""Measurement of a ChArUco board in the scene as one plate: its outermost inner corners."""

from __future__ import annotations

import numpy as np

from uavgram.imaging.plates.picture import UNIT_SQUARE, homography, mapped
from uavgram.imaging.raster import Image
from uavgram.imaging.targets.charuco import sight_charuco
from uavgram.model.camera.board import Board
from uavgram.model.survey.observations import LeftOut, SeenPlate

BOARD = 0
"""Number of the board as a plate."""

_WIDER = 1.25
_LEAST_SIGMA_PX = 0.018


def sight_board_plate(image: Image, board: Board) -> tuple[SeenPlate, ...]:
    """Find a ChArUco board, or a part of it.

    Parameters
    ----------
    image
        (height, width) grey, original size and orientation.
    board
        Board to find.
    """
    seen = sight_charuco(image, board)
    last, rows = board.columns - 1, board.rows - 1
    # The outermost inner corners, in the order of a plate's corners.
    outer = [0, last, rows * board.columns + last, rows * board.columns]
    place = {corner: k for k, corner in enumerate(seen.corner.tolist())}
    corner, sigma = np.full((4, 2), np.nan), np.full(4, np.nan)
    for i, number in enumerate(outer):
        if (k := place.get(number)) is not None:
            corner[i] = seen.pixel_px[k]
            sigma[i] = np.hypot(_WIDER * seen.sigma_px[k], _LEAST_SIGMA_PX)
    if not np.isfinite(sigma).any():
        return ()
    whole = bool(np.isfinite(sigma).all())
    nothing = np.full(2, np.nan)
    return (
        SeenPlate(
            plate=BOARD,
            corner_px=corner,
            sigma_px=sigma,
            center_px=mapped(homography(corner), UNIT_SQUARE.mean(axis=0)) if whole else nothing,
            center_sigma_px=float(np.sqrt((sigma**2).mean() / 4)) if whole else float("nan"),
            score=1.0 - min(seen.misfit, 1.0),
            left_out=LeftOut.NO,
        ),
    )
