"""Coded plates: their families for printing, and their detection in photos with tests of each.

Candidates are OpenCV's, with a finer search. With its defaults OpenCV misses most plates below 20
pixels a side. With the smallest perimeter at 0.005 of the photo's size and threshold windows from 5
to 29 pixels it finds all of 20; in the photo enlarged twice also those of 12 to 16 pixels.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np

from uavgram.imaging.raster import Image
from uavgram.imaging.targets.boards import charuco_board, detect_charuco
from uavgram.imaging.targets.plate_fit import (
    FIRST_BLUR_PX,
    UNIT_SQUARE,
    PlateFit,
    Window,
    apply_homography,
    fit_homography,
    fit_with_shadows,
    invert_homography,
    plate_weights,
    render_plate,
)
from uavgram.model.arrays import Bools, Floats
from uavgram.model.board import Board
from uavgram.model.naming import FAMILIES
from uavgram.model.observations import RejectedPlate, SeenPlate


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


_MIN_PERIMETER = 0.005
_WINDOWS_PX = (5, 29, 8)  # first, last, step
_MOST_DOUBLED_PX = 60e6  # larger photos would take seconds and a quarter of a GB
_SAME = 0.5  # of a side: two finds of one id within this distance are one plate


class Candidate(NamedTuple):
    """Candidate of a plate: its id, and its corners (4, 2) to a pixel."""

    plate: int
    corner_px: Floats


def find_candidates(image: Image, family: str, *, doubled: bool = True) -> list[Candidate]:
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
        larger = image if scale == 1 else _double_size(image)
        quads, ids, _ = detector.detectMarkers(larger)
        # OpenCV's stubs declare an array; it returns None where there is no marker
        numbers = [] if not quads else np.asarray(ids, np.int64).ravel().tolist()
        for quad, plate in zip(quads, numbers, strict=True):
            corner = (np.asarray(quad, np.float64).reshape(4, 2) + 0.5) / scale - 0.5
            if not any(_is_same(one, int(plate), corner) for one in found):
                found.append(Candidate(int(plate), corner))
    return found


def _double_size(image: Image) -> Image:
    return np.asarray(cv2.resize(image, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC), np.uint8)


def _detector(family: str) -> cv2.aruco.ArucoDetector:
    options = cv2.aruco.DetectorParameters()
    options.minMarkerPerimeterRate = _MIN_PERIMETER
    options.adaptiveThreshWinSizeMin = _WINDOWS_PX[0]
    options.adaptiveThreshWinSizeMax = _WINDOWS_PX[1]
    options.adaptiveThreshWinSizeStep = _WINDOWS_PX[2]
    options.minDistanceToBorder = 1
    return cv2.aruco.ArucoDetector(find_dictionary(family), options)


def _is_same(one: Candidate, plate: int, corner_px: Floats) -> bool:
    side = np.linalg.norm(np.diff(one.corner_px, axis=0), axis=1).min()
    apart = np.linalg.norm(one.corner_px.mean(axis=0) - corner_px.mean(axis=0))
    return bool(one.plate == plate and apart < _SAME * side)


_WRONG_CELL = 0.4  # mean residual of a wrong cell, as a share of the contrast


def compute_agreement(grey: Image, window: Window, cells: Bools, corner_px: Floats) -> float:
    """Correlate a plate's picture at given corners with a window of a photo.

    Parameters
    ----------
    grey, window, cells, corner_px
        As for `fit_plate`.
    """
    inside = plate_weights(window, corner_px, len(cells), FIRST_BLUR_PX) > 0
    share = render_plate(cells, corner_px, FIRST_BLUR_PX, window).share[inside]
    values = grey[inside].astype(np.float64)
    if values.size < len(cells) ** 2 or np.ptp(values) == 0 or np.ptp(share) == 0:
        return 0.0
    return float(np.corrcoef(share, values)[0, 1])


def count_wrong_cells(fitted: PlateFit, cells: Bools, window: Window) -> int:
    """Count the cells of a plate that are nearer to the other colour.

    Parameters
    ----------
    fitted
        Fitted plate.
    cells, window
        As for `fit_plate`.
    """
    n = len(cells)
    place = n * apply_homography(invert_homography(fit_homography(fitted.corner_px)), window.pixels)
    inside = ((place > 0) & (place < n)).all(axis=-1) & (fitted.weight > 0)
    column, row = place[inside].astype(int).T
    # Mean residual of each cell, from the pixels inside it.
    number = np.bincount(row * n + column, minlength=n * n)
    total = np.bincount(row * n + column, fitted.residual[inside], minlength=n * n)
    mean = np.abs(total) / np.maximum(number, 1)
    return int((mean > _WRONG_CELL * abs(fitted.contrast)).sum())


LEAST_SIDE_PX = 8.0
"""Least side of a plate: with a shorter one its cells are hardly a pixel wide."""

_LEAST_AGREEMENT = 0.93  # below, it is not a plate
_CLEAN_AGREEMENT = 0.97  # below, something covers it that the fit cannot model
_LEAST_CONTRAST = 5.0  # in rms of the residuals
_WIDER = 1.25
_LEAST_SIGMA_PX = 0.018
_MOST_SIGMA_PX = 0.3
_LARGEST_SIDE_PX = 72.0  # larger plates are fitted in a reduced photo
_PROMISING = 0.6  # correlation at OpenCV's corners
_AROUND = 1.3  # cells of the window around the black square


def shortest_side(corner_px: Floats) -> float:
    """Compute the length of the shortest side of a quadrilateral (4, 2)."""
    return float(np.linalg.norm(np.roll(corner_px, -1, axis=0) - corner_px, axis=1).min())


def detect_plates(image: Image, family: str) -> tuple[SeenPlate, ...]:
    """Find and measure all plates of a family in a photo.

    Parameters
    ----------
    image
        (height, width) grey, original size and orientation.
    family
        One of `FAMILIES`.
    """
    return _measure_candidates(image, family, find_candidates(image, family))


def detect_large_plates(
    reduced: Image, factor: int, whole: Callable[[], Image], family: str
) -> tuple[SeenPlate, ...]:
    """Find the plates that a reduced photo shows, and measure them in the photo itself.

    Parameters
    ----------
    reduced
        (height, width) grey, reduced by `factor` in each direction.
    factor
        Pixels of the photo per pixel of the reduced one.
    whole
        Gives the photo; called only where there may be a plate.
    family
        One of `FAMILIES`.
    """
    found = [
        one._replace(corner_px=(one.corner_px + 0.5) * factor - 0.5)
        for one in find_candidates(reduced, family, doubled=False)
    ]
    return _measure_candidates(whole(), family, found) if found else ()


def _measure_candidates(
    image: Image, family: str, found: Sequence[Candidate]
) -> tuple[SeenPlate, ...]:
    """Measure candidates; return those that are plates, sorted by their ids."""
    seen = [_measure_candidate(image, family, one) for one in found]
    plates = [one for one in seen if one is not None]
    certain = [one.plate for one in plates if one.left_out is not RejectedPlate.DOUBTFUL]
    count = np.bincount(certain, minlength=1 + max((one.plate for one in plates), default=0))
    marked = [
        replace(one, left_out=RejectedPlate.TWICE) if count[one.plate] > 1 else one
        for one in plates
    ]
    return tuple(sorted(marked, key=lambda one: one.plate))


def _measure_candidate(image: Image, family: str, candidate: Candidate) -> SeenPlate | None:
    """Measure a candidate; None where it is not a plate."""
    corner = candidate.corner_px
    if shortest_side(corner) < LEAST_SIDE_PX - 1.0:
        return None
    cells = read_cells(family, candidate.plate)
    window = find_plate_window(corner, len(cells), image.shape)
    rows, columns = window.slices
    grey = image[rows, columns]
    sides = np.linalg.norm(np.roll(corner, -1, axis=0) - corner, axis=1)
    # Large plates are measured in a reduced window.
    factor = max(1, math.ceil(float(sides.max()) / _LARGEST_SIDE_PX))
    if factor > 1:
        grey, window = _reduce_window(grey, window, factor)
        corner = (corner + 0.5) / factor - 0.5
    agreement = compute_agreement(grey, window, cells, corner)
    if agreement < _PROMISING:
        return None
    fitted = fit_with_shadows(grey.astype(np.float64), window, cells, corner)
    if fitted is None:
        return _doubtful(candidate, agreement)
    if count_wrong_cells(fitted, cells, window):
        return None
    if not _is_plate(fitted):
        return _doubtful(candidate, fitted.agreement)
    return _describe_plate(candidate.plate, fitted, factor)


def _doubtful(candidate: Candidate, agreement: float) -> SeenPlate:
    """Describe a doubtful plate, reported only where other photos confirm the same plate."""
    return SeenPlate(
        plate=candidate.plate,
        corner_px=candidate.corner_px,
        sigma_px=np.full(4, np.nan),
        center_px=candidate.corner_px.mean(axis=0),
        center_sigma_px=float("nan"),
        score=max(agreement, 0.0),
        left_out=RejectedPlate.DOUBTFUL,
    )


def _reduce_window(grey: Image, window: Window, factor: int) -> tuple[Image, Window]:
    """Reduce a window by `factor` each way; an incomplete block at its end is dropped."""
    left, top = (-(-n // factor) for n in (window.left, window.top))
    inner = grey[top * factor - window.top :, left * factor - window.left :]
    height, width = (n // factor for n in inner.shape)
    blocks = inner[: height * factor, : width * factor].reshape(height, factor, width, factor)
    mean = blocks.mean(axis=(1, 3), dtype=np.float64)
    return np.asarray(np.round(mean), np.uint8), Window(left, top, width, height)


def _is_plate(fitted: PlateFit) -> bool:
    strong = fitted.contrast > _LEAST_CONTRAST * fitted.rms
    large = shortest_side(fitted.corner_px) >= LEAST_SIDE_PX
    return strong and large and fitted.agreement >= _LEAST_AGREEMENT


def _describe_plate(plate: int, fitted: PlateFit, factor: int) -> SeenPlate:
    """Describe a fitted plate in the photo, where `factor` pixels were reduced to one."""
    variance = np.diagonal(fitted.covariance_px2).reshape(4, 2).mean(axis=1)
    sigma = factor * np.hypot(_WIDER * np.sqrt(variance), _LEAST_SIGMA_PX)
    corner = (fitted.corner_px + 0.5) * factor - 0.5
    matrix = fit_homography(corner)
    left_out = RejectedPlate.NO
    if sigma.max() > factor * _MOST_SIGMA_PX:
        left_out = RejectedPlate.FAINT
    if fitted.agreement < _CLEAN_AGREEMENT:
        left_out = RejectedPlate.COVERED
    return SeenPlate(
        plate=plate,
        corner_px=corner,
        sigma_px=sigma,
        center_px=apply_homography(matrix, UNIT_SQUARE.mean(axis=0)),
        center_sigma_px=float(np.sqrt((sigma**2).mean() / 4)),
        score=fitted.agreement,
        shadows=len(fitted.edges),
        left_out=left_out,
    )


def find_plate_window(corner_px: Floats, cells: int, shape: tuple[int, ...]) -> Window:
    """Return the window of a plate and of the white around it, within the photo.

    Parameters
    ----------
    corner_px
        (4, 2) corners of its black square.
    cells
        Number of cells along a side.
    shape
        Shape of the photo.
    """
    side = np.linalg.norm(np.roll(corner_px, -1, axis=0) - corner_px, axis=1).max()
    around = _AROUND * side / cells + 3.0
    height, width = shape[:2]
    left, top = np.floor(corner_px.min(axis=0) - around).astype(int).clip(0).tolist()
    last = np.ceil(corner_px.max(axis=0) + around).astype(int) + 1
    right, below = min(int(last[0]), width), min(int(last[1]), height)
    return Window(left, top, right - left, below - top)


BOARD_ID = 0
"""Number of the board as a plate."""

_BOARD_MARGIN = 1.25
_MIN_BOARD_SIGMA_PX = 0.018


def detect_board_plate(image: Image, board: Board) -> tuple[SeenPlate, ...]:
    """Find a ChArUco board, or a part of it.

    Parameters
    ----------
    image
        (height, width) grey, original size and orientation.
    board
        Board to find.
    """
    seen = detect_charuco(image, board)
    last, rows = board.columns - 1, board.rows - 1
    # The outermost inner corners, in the order of a plate's corners.
    outer = [0, last, rows * board.columns + last, rows * board.columns]
    place = {corner: k for k, corner in enumerate(seen.corner.tolist())}
    corner, sigma = np.full((4, 2), np.nan), np.full(4, np.nan)
    for i, number in enumerate(outer):
        if (k := place.get(number)) is not None:
            corner[i] = seen.pixel_px[k]
            sigma[i] = np.hypot(_BOARD_MARGIN * seen.sigma_px[k], _MIN_BOARD_SIGMA_PX)
    if not np.isfinite(sigma).any():
        return ()
    whole = bool(np.isfinite(sigma).all())
    nothing = np.full(2, np.nan)
    return (
        SeenPlate(
            plate=BOARD_ID,
            corner_px=corner,
            sigma_px=sigma,
            center_px=apply_homography(fit_homography(corner), UNIT_SQUARE.mean(axis=0))
            if whole
            else nothing,
            center_sigma_px=float(np.sqrt((sigma**2).mean() / 4)) if whole else float("nan"),
            score=1.0 - min(seen.misfit, 1.0),
            left_out=RejectedPlate.NO,
        ),
    )
