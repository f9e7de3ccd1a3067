"""Detection of chessboards: a seed by OpenCV's sector-based detector, grown over the board.

The detector (Duda and Frese 2018, Accurate detection and localization of checkerboard corners) runs
on reduced copies of a large photo, where it takes a fraction of the time; only the corners
themselves are measured at full size.
"""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np

from uavgram.imaging.photos.reduction import make_reduced_copies, scale_to_original
from uavgram.imaging.raster import Image
from uavgram.imaging.targets.grid import CORE, Grid, grow_grid, number_grid, trim_grid
from uavgram.imaging.targets.sighting import Sighting, measure_corners
from uavgram.model.arrays import Floats
from uavgram.model.camera.board import Board

# Half the distance to the next corner, less the blur: no other print is within.
REACH = 0.35
WIDTHS_PX = (640, 1280, 2400)
LEAST_CORNERS = 9
_NEARLY_ALL = 0.8
_SEED = 4
_RANDOM_SEED = 0
# The detector itself needs three corners each way.
_MODES = (
    cv2.CALIB_CB_LARGER,
    cv2.CALIB_CB_LARGER | cv2.CALIB_CB_NORMALIZE_IMAGE,
)


def sight_chessboard(image: Image, board: Board) -> Sighting:
    """Find a chessboard, or a part of it, in a photo.

    Parameters
    ----------
    image
        (height, width) grey, original size.
    board
        Board to find.
    """
    best: tuple[Floats, Floats] | None = None  # numbered, and as found
    other: Floats | None = None
    for found in _grids(image, board):
        grid, numbered = found.pixel_px, number_grid(found, board.columns, board.rows)
        if numbered is None:
            other = grid if other is None or _count(grid) > _count(other) else other
            if np.isfinite(grid).all():
                break  # a complete rectangle larger than the board: certainly another board
        elif best is None or _count(numbered) > _count(best[0]):
            best = numbered, grid
            is_whole = sorted(grid.shape[:2]) == sorted(numbered.shape[:2])
            if is_whole and _count(numbered) >= _NEARLY_ALL * numbered.shape[0] * numbered.shape[1]:
                break  # the missing corners are hidden in this photo
    if other is not None and (best is None or _count(other) > _count(best[0])):
        return Sighting(found_size=_size(other), is_other_board=True)
    if best is None or _count(best[0]) < LEAST_CORNERS:
        return Sighting()
    return measure_corners(image, best[0], REACH, _size(best[1]))


def _grids(image: Image, board: Board) -> Iterator[Grid]:
    """Find grids of corners in full-size pixels, one after the other, on demand."""
    side = max(CORE, min(_SEED, board.columns, board.rows))
    limit = 2 * max(board.columns, board.rows)
    for scale, small in make_reduced_copies(image, WIDTHS_PX):
        for mode in _MODES:
            seed = _seed(small, side, mode)
            grown = None if seed is None else grow_grid(small, seed, limit)
            if grown is None:
                continue
            grid = trim_grid(grown, (board.columns, board.rows))
            if _count(grid.pixel_px) >= LEAST_CORNERS and min(grid.whole.shape) > 1:
                yield Grid(scale_to_original(grid.pixel_px, scale), grid.sign, grid.whole)


def _seed(image: Image, side: int, mode: int) -> Floats | None:
    """Find the (R, C, 2) corners of a part of some chessboard."""
    # Reset the random numbers of the detector's nearest-neighbour search (FLANN), which continue
    # from photo to photo: the result for a photo (12 or 22 corners) would depend on the photos
    # before it.
    cv2.setRNGSeed(_RANDOM_SEED)
    is_found, corners, meta = cv2.findChessboardCornersSBWithMeta(image, (side, side), mode)
    if not is_found:
        return None
    rows, columns = np.asarray(meta).shape[:2]
    return np.asarray(corners, np.float64).reshape(rows, columns, 2)


def _count(grid: Floats) -> int:
    return int(np.isfinite(grid[..., 0]).sum())


def _size(grid: Floats) -> tuple[int, int]:
    """Return columns and rows, the longer side first."""
    rows, columns = sorted(grid.shape[:2])
    return columns, rows
