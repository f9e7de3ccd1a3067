"""Detection of ChArUco boards, or parts of them, whose corners are identified by markers."""

from __future__ import annotations

import cv2
import numpy as np

from uavgram.imaging.photos.reduction import make_reduced_copies, scale_to_original
from uavgram.imaging.raster import Image
from uavgram.imaging.targets.sighting import Sighting, measure_corners
from uavgram.model.arrays import Floats, Ints
from uavgram.model.camera.board import Board

WIDTHS_PX = (1200, 2400, 4800)
LEAST_CORNERS = 6
_LARGEST_BOARD = 20  # squares each way, in the search for another size
_CLEAR = 0.9  # of the distance from a corner to the nearest marker


def sight_charuco(image: Image, board: Board) -> Sighting:
    """Find a ChArUco board, or a part of it, in a photo.

    Parameters
    ----------
    image
        (height, width) grey, original size.
    board
        Board to find.
    """
    detector = cv2.aruco.CharucoDetector(charuco_board(board, (board.columns + 1, board.rows + 1)))
    grid = np.full((board.rows * board.columns, 2), np.nan)
    marker_px, marker = np.empty((0, 2)), np.empty(0, np.int64)
    for scale, small in make_reduced_copies(image, WIDTHS_PX):
        found, corner, quads, ids = detector.detectBoard(small)
        if ids is not None and len(ids) > len(marker):
            marker = np.asarray(ids, np.int64).ravel()
            centers = np.asarray(quads, np.float64).reshape(-1, 4, 2).mean(axis=1)
            marker_px = scale_to_original(centers, scale)
        if corner is not None and len(corner) > np.isfinite(grid[:, 0]).sum():
            grid[:] = np.nan
            pixel = np.asarray(found, np.float64).reshape(-1, 2)
            grid[np.asarray(corner).ravel()] = scale_to_original(pixel, scale)
        if np.isfinite(grid).all():
            break
    other = _other_size(board, marker, marker_px)
    if other is not None:
        return Sighting(found_size=other, is_other_board=True)
    if np.isfinite(grid[:, 0]).sum() < LEAST_CORNERS:
        return Sighting()
    # the nearest point of a marker is on the diagonal of a white square
    clear = _CLEAR * np.sqrt(0.5) * (1.0 - board.marker_m / board.square_m)
    shape = (board.rows, board.columns, 2)
    return measure_corners(image, grid.reshape(shape), clear, (board.columns, board.rows))


def charuco_board(board: Board, squares: tuple[int, int]) -> cv2.aruco.CharucoBoard:
    """Create OpenCV's object of a board with the given number of squares along x and y."""
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.dictionary))
    return cv2.aruco.CharucoBoard(squares, board.square_m, board.marker_m, dictionary)


def _other_size(board: Board, marker: Ints, marker_px: Floats) -> tuple[int, int] | None:
    """Find the inner corners of another board whose layout the markers show; None otherwise.

    Markers are numbered row by row, so their places in a photo determine the number in a row.
    """
    if len(marker) < LEAST_CORNERS:
        return None
    asked = _layout_error(board.columns + 1, marker, marker_px)
    is_too_large = int(marker.max()) >= (board.columns + 1) * (board.rows + 1) // 2
    if asked < 1.0 and not is_too_large:
        return None
    errors = {
        columns: _layout_error(columns, marker, marker_px)
        for columns in range(3, _LARGEST_BOARD + 1)
    }
    columns = min(errors, key=lambda key: errors[key])
    if errors[columns] > 0.5 * asked and not is_too_large:
        return None  # no other layout is clearly better
    rows = int(np.ceil(2 * (int(marker.max()) + 1) / columns))
    return columns - 1, max(rows - 1, 1)


def _layout_error(columns: int, marker: Ints, marker_px: Floats) -> float:
    """Compute the median error, in squares, of markers laid out in rows of `columns` squares.

    inf where no layout fits.
    """
    row, place = _marker_cells(columns, int(marker.max()) + 1)
    cell = np.stack([place, row], axis=1)[marker].astype(np.float64)
    if np.ptp(cell, axis=0).min() < 1:
        return float("inf")
    matrix = np.asarray(cv2.findHomography(marker_px, cell, cv2.RANSAC, 0.5)[0], np.float64)
    if matrix.shape != (3, 3):  # OpenCV returns None on failure
        return float("inf")
    mapped = cv2.perspectiveTransform(marker_px[:, None], matrix)[:, 0]
    return float(np.median(np.linalg.norm(mapped - cell, axis=1)))


def _marker_cells(columns: int, count: int) -> tuple[Ints, Ints]:
    """Compute row and column of the squares with markers 0 to count - 1, the white ones in turn."""
    row, column = np.divmod(np.arange(2 * count + 2 * columns), columns)
    white = (row + column) % 2 == 1
    return row[white][:count], column[white][:count]


def dictionary_size(name: str) -> int:
    """Return the number of markers of a dictionary; 0 for an unknown name."""
    if name not in dictionary_names():
        return 0
    return len(cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name)).bytesList)


def dictionary_names() -> tuple[str, ...]:
    """Return the names of OpenCV's dictionaries."""
    return tuple(name for name in dir(cv2.aruco) if name.startswith("DICT_"))
