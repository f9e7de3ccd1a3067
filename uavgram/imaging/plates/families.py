"""Families of coded plates: ids, black and white cells, and exact outlines for printing."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from uavgram.imaging.plates.picture import UNIT_SQUARE
from uavgram.imaging.targets.charuco import charuco_board
from uavgram.model.arrays import Bools, Floats
from uavgram.model.camera.board import Board
from uavgram.model.target_families import FAMILIES


@lru_cache(maxsize=8)
def find_dictionary(family: str) -> cv2.aruco.Dictionary:
    """Return OpenCV's dictionary of a family; its name is one of `FAMILIES`."""
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, FAMILIES[family]))


def count_plates(family: str) -> int:
    """Return the number of plates in a family: their ids run from 0."""
    return len(find_dictionary(family).bytesList)


@lru_cache(maxsize=256)
def read_cells(family: str, plate: int) -> Bools:
    """Return the (n, n) cells of a plate, its black border included; True is white.

    The first row is the upper edge, from the plate's first corner to its second.
    """
    codes = find_dictionary(family)
    side = codes.markerSize + 2
    drawn = cv2.aruco.generateImageMarker(codes, plate, side, borderBits=1)
    return np.asarray(drawn) > 127


MARGIN_CELLS = 1.0
"""Width of the white margin around a plate's black square."""


def plate_outlines(family: str, plate: int) -> list[Floats]:
    """Compute outlines of the black areas of a plate whose black square has side 1, y downwards.

    Parameters
    ----------
    family
        One of `FAMILIES`.
    plate
        Its id.

    Returns
    -------
    list of (k, 2)
        Closed; black is to the right of each, so that holes run the other way round.
    """
    black = ~read_cells(family, plate)
    return [outline / len(black) for outline in _outlines(black)]


def board_outlines(board: Board) -> list[Floats]:
    """Compute outlines of the black areas of a ChArUco board [m] from its first square's corner."""
    columns, rows = board.columns + 1, board.rows + 1
    outlines = [
        (UNIT_SQUARE + np.array([column, row])) * board.square_m
        for row in range(rows)
        for column in range(columns)
        if (row + column) % 2 == 0
    ]
    opencv = charuco_board(board, (columns, rows))
    for number, corner in zip(np.ravel(opencv.getIds()), opencv.getObjPoints(), strict=True):
        drawn = _dictionary_cells(opencv, int(number))
        side = board.marker_m / len(drawn)
        first = np.asarray(corner, np.float64)[0, :2]
        outlines += [first + side * outline for outline in _outlines(~drawn)]
    return outlines


def _dictionary_cells(board: object, number: int) -> Bools:
    codes = board.getDictionary()  # type: ignore[attr-defined]  # a board of OpenCV
    side = codes.markerSize + 2
    return np.asarray(codes.generateImageMarker(number, side, borderBits=1)) > 127


def _outlines(black: Bools) -> list[Floats]:
    """Trace the borders between black and white cells (n, m); black is to the right."""
    inside = np.pad(black, 1)
    # Directed unit edges by their start; each loop follows them back to its start.
    ends: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for row, column in np.argwhere(inside).tolist():
        x, y = column - 1, row - 1
        if not inside[row - 1, column]:
            ends.setdefault((x, y), []).append((x + 1, y))
        if not inside[row, column + 1]:
            ends.setdefault((x + 1, y), []).append((x + 1, y + 1))
        if not inside[row + 1, column]:
            ends.setdefault((x + 1, y + 1), []).append((x, y + 1))
        if not inside[row, column - 1]:
            ends.setdefault((x, y + 1), []).append((x, y))
    outlines = []
    while ends:
        start = next(iter(ends))
        loop, at = [], start
        while True:
            loop.append(at)
            onward = ends[at]
            following = onward.pop()
            if not onward:
                del ends[at]
            at = following
            if at == start:
                break
        outlines.append(np.array(loop, np.float64))
    return outlines
