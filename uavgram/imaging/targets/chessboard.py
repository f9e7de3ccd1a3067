"""Detection of chessboards: a seed by OpenCV's sector-based detector, grown over the board.

A seed of 3 x 3 corners is continued outwards: the next corner of a row is extrapolated from the
last three, and accepted if bright and dark squares alternate about it. This excludes a rim with
narrower squares, objects on the board, and other edges nearby.

The detector (Duda and Frese 2018, Accurate detection and localization of checkerboard corners) runs
on reduced copies of a large photo, where it takes a fraction of the time; only the corners
themselves are measured at full size.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from uavgram.imaging.photos.decoding import make_reduced_copies, scale_to_original
from uavgram.imaging.raster import Image
from uavgram.imaging.targets.corners import (
    MAX_MOVE,
    Sighting,
    average_known,
    grid_axes,
    measure_corners,
    search_corners,
)
from uavgram.model.arrays import Bools, Floats
from uavgram.model.board import Board

CORE = 3
_QUADRANT = 0.3  # squares from a corner to the samples of its four quadrants
_CUT_SQUARE = (
    0.4  # the same, to distinguish squares (boards are cut through the outer ones) from strips
)
_MOST_BEND = 0.35  # of a square: second difference of three corners in a row, in perspective
_LEAST_CONTRAST = 0.35  # of the contrast of the core
_LARGEST_WINDOW_PX = 8


@dataclass(frozen=True, eq=False)
class Grid:
    """Corners of a chessboard that is not numbered yet.

    Attributes
    ----------
    pixel_px
        (H, W, 2), NaN where no corner was found.
    sign
        +1 where the quadrant between corner (0, 0)'s two axes is bright, else -1.
    whole
        (H, W) whether squares (halves at least) meet in a corner, not strips of the rim.
    """

    pixel_px: Floats
    sign: int
    whole: Bools


def grow_grid(image: Image, seed_px: Floats, limit: int) -> Grid | None:
    """Extend a seed over the board.

    Parameters
    ----------
    image
        (height, width) grey.
    seed_px
        (R, C, 2) corners, of which a part may be wrong; R, C >= 3.
    limit
        Largest number of rows and columns to add.

    Returns
    -------
    The grid, whose outermost rows and columns hold some corners; None where the seed holds no
    regular core.
    """
    smooth = np.asarray(cv2.GaussianBlur(image, (0, 0), 1.0), np.float64)
    seeds = (_core(smooth, seed) for seed in (seed_px, *_insert_skipped_lines(image, seed_px)))
    core = next((core for core in seeds if core is not None), None)
    if core is None:
        return None
    corners, sign, contrast = core
    grid = np.full((2 * limit + CORE, 2 * limit + CORE, 2), np.nan)
    grid[limit : limit + CORE, limit : limit + CORE] = corners
    parity = sign * (1 - 2 * (np.indices(grid.shape[:2]).sum(axis=0) % 2))  # 2 limit is even
    for _ in range(2 * limit):
        found = _next_corners(image, smooth, grid, parity * _LEAST_CONTRAST * contrast)
        if found is None:
            break
        grid[found[0]] = found[1]
    known = np.isfinite(grid[..., 0])
    rows, columns = (np.flatnonzero(known.any(axis=axis)) for axis in (1, 0))
    part = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    grid, parity = grid[part], parity[part]
    whole = np.zeros(parity.shape, np.bool_)
    known = np.isfinite(grid[..., 0])
    gap = _contrast(smooth, grid[known], grid_axes(grid)[known], _CUT_SQUARE)
    whole[known] = gap * parity[known] > _LEAST_CONTRAST * contrast
    return Grid(grid, int(parity[0, 0]), whole)


def _insert_skipped_lines(image: Image, seed_px: Floats) -> Iterator[Floats]:
    """Insert a line of corners between every two: the detector may skip every other one."""
    for axis in (0, 1):
        seed = np.moveaxis(seed_px, axis, 0)
        dense = np.empty((2 * len(seed) - 1, *seed.shape[1:]))
        between = 0.5 * (seed[1:] + seed[:-1])
        dense[::2], dense[1::2] = seed, between
        step = np.linalg.norm(grid_axes(np.moveaxis(dense, 0, axis)), axis=-1)
        dense[1::2] = _refine(image, between.reshape(-1, 2), _window(step)).reshape(between.shape)
        yield np.moveaxis(dense, 0, axis)


def _core(smooth: Floats, seed_px: Floats) -> tuple[Floats, int, float] | None:
    """Find the most regular 3 x 3 corners of a seed, the sign at the first, and the contrast."""
    rows, columns = seed_px.shape[:2]
    best: tuple[Floats, int, float] | None = None
    least = _MOST_BEND
    for i in range(rows - CORE + 1):
        for j in range(columns - CORE + 1):
            part = seed_px[i : i + CORE, j : j + CORE]
            step = np.linalg.norm(grid_axes(part), axis=-1).min()
            bends = (np.diff(part, 2, axis=0), np.diff(part, 2, axis=1))
            bend = max(float(np.linalg.norm(b, axis=-1).max()) for b in bends) / max(step, 1e-9)
            if not bend < least:
                continue
            contrast = _contrast(smooth, part.reshape(-1, 2), grid_axes(part).reshape(-1, 2, 2))
            alternating = contrast * (1 - 2 * (np.arange(CORE * CORE) % 2))
            if (alternating > 0).all() or (alternating < 0).all():
                sign = 1 if alternating[0] > 0 else -1
                least, best = bend, (part, sign, float(np.median(np.abs(contrast))))
    return best


def _contrast(
    smooth: Floats, corner_px: Floats, axes_px: Floats, away: float = _QUADRANT
) -> Floats:
    """Compute the brightness gap (n,) of the quadrants between the axes to the others; 0 if none.

    Positive where both of the former are brighter than both of the latter: the darkest of the
    former minus the brightest of the latter, so that a board's rim (three equal quadrants) has
    none.
    """
    first, second = away * axes_px[:, 0], away * axes_px[:, 1]
    at = [corner_px + a * first + b * second for a, b in ((1, 1), (-1, -1), (1, -1), (-1, 1))]
    height, width = smooth.shape
    place = np.round(np.nan_to_num(np.stack(at), nan=-1.0)).astype(int)
    inside = (place >= 0).all(axis=(0, 2)) & (place < [width, height]).all(axis=(0, 2))
    place = place.clip(0, [width - 1, height - 1])
    light = smooth[place[..., 1], place[..., 0]]
    same, other = light[:2], light[2:]
    gap = np.maximum(same.min(axis=0) - other.max(axis=0), 0.0)
    gap -= np.maximum(other.min(axis=0) - same.max(axis=0), 0.0)
    return np.where(inside, gap, 0.0)


def _next_corners(
    image: Image, smooth: Floats, grid: Floats, threshold: Floats
) -> tuple[Bools, Floats] | None:
    """Find cells next to known ones that hold a corner: mask over the grid, and places."""
    predicted = _predict(grid)
    candidate = np.isnan(grid[..., 0]) & np.isfinite(predicted[..., 0])
    height, width = image.shape
    with np.errstate(invalid="ignore"):
        candidate &= (predicted > 1).all(axis=-1) & (predicted < [width - 2, height - 2]).all(-1)
    if not candidate.any():
        return None
    filled = np.where(candidate[..., None], predicted, grid)
    axes = grid_axes(filled)[candidate]
    start, step = predicted[candidate], np.linalg.norm(axes, axis=2).min(axis=1)
    refined = _refine(image, start, _window(step))
    near = np.linalg.norm(refined - start, axis=1) < MAX_MOVE * step
    limit = threshold[candidate]
    contrast = _contrast(smooth, refined, axes) * np.sign(limit)
    good = near & (contrast > np.abs(limit))
    if not good.any():
        return None
    mask = np.zeros_like(candidate)
    mask[candidate] = good
    return mask, refined[good]


def _predict(grid: Floats) -> Floats:
    """Extrapolate the neighbours on each side (H, W, 2), and average; NaN where there are none.

    Three corners in a row are continued by a parabola, two by a straight line, which counts only
    where there is no parabola.
    """
    rows, columns = grid.shape[:2]
    wide = np.pad(grid, ((3, 3), (3, 3), (0, 0)), constant_values=np.nan)

    def shifted(down: int, right: int) -> Floats:
        part: Floats = wide[3 + down : 3 + down + rows, 3 + right : 3 + right + columns]
        return part

    bent, straight = [], []
    for down, right in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        near, next_, far = (shifted(k * down, k * right) for k in (1, 2, 3))
        bent.append(3.0 * near - 3.0 * next_ + far)
        straight.append(2.0 * near - next_)
    best = average_known(np.stack(bent))
    return np.where(np.isfinite(best), best, average_known(np.stack(straight)))


def _window(step_px: Floats) -> int:
    """Compute half the size of a window that holds no neighbours, for most corners."""
    return int(np.clip(round(0.3 * float(np.median(step_px))), 2, _LARGEST_WINDOW_PX))


def _refine(image: Image, start_px: Floats, half_px: int) -> Floats:
    """Refine corners by gradients at the image's own size; `corners.py` has the exact ones."""
    return search_corners(image, start_px, half_px, 20, 0.01)


def trim_grid(grid: Grid, largest: tuple[int, int]) -> Grid:
    """Remove outermost rows and columns that do not belong to the board.

    Parameters
    ----------
    grid
        Grid as it grew.
    largest
        The board's sides. Where the grid is larger, it loses, one by one, the lines in which fewer
        than half of the corners have squares, not strips, on all sides; elsewhere only those of a
        single corner.
    """
    while min(grid.whole.shape) > 1:
        height, width = grid.whole.shape
        sides = sorted(largest) if height < width else sorted(largest, reverse=True)
        known = np.isfinite(grid.pixel_px[..., 0])
        shares = []
        for axis, is_larger in ((0, height > sides[0]), (1, width > sides[1])):
            good = np.moveaxis(grid.whole if is_larger else known, axis, 0)
            for line in (good[0], good[-1]):
                is_kept = not is_larger and line.sum() > 1
                shares.append(1.0 if is_kept else float(line.mean()))
        worst = int(np.argmin(shares))
        if shares[worst] >= 0.5:
            break
        cut = (np.s_[1:], np.s_[:-1], np.s_[:, 1:], np.s_[:, :-1])[worst]
        sign = -grid.sign if worst in (0, 2) else grid.sign
        grid = Grid(grid.pixel_px[cut], sign, grid.whole[cut])
    return grid


def number_grid(grid: Grid, columns: int, rows: int) -> Floats | None:
    """Assign a grid to the board.

    Parameters
    ----------
    grid
        Corners of the board, or of a part of it.
    columns, rows
        Inner corners of the board.

    Returns
    -------
    (rows, columns, 2), or None if the grid is larger than the board. Among the ways that it fits
    (turned, never mirrored), one is taken whose first square is black, as printed boards begin; of
    several, the one whose first corner is nearest to the image's top left. A part of a board is
    assigned from its first corner: without markers its place on the board is unknown.
    """
    right_handed, sign = _orient_right_handed(grid.pixel_px, grid.sign)
    fits = []
    for turns in range(4):
        turned = np.rot90(right_handed, turns)
        if turned.shape[0] > rows or turned.shape[1] > columns:
            continue
        # The quadrants up-left and down-right of the first corner are those between its axes; each
        # quarter turn exchanges them with the others.
        first = np.array([(0, 0), (0, -1), (-1, -1), (-1, 0)][turns])
        cell = first % right_handed.shape[:2]
        is_bright = sign * (-1) ** int(cell.sum() + turns) > 0
        corner = turned[np.isfinite(turned[..., 0])]
        place = turned[0, 0] if np.isfinite(turned[0, 0, 0]) else corner.mean(axis=0)
        fits.append((is_bright, float(place.sum()), turns))
    if not fits:
        return None
    turned = np.rot90(right_handed, min(fits)[2])
    whole = np.full((rows, columns, 2), np.nan)
    whole[: turned.shape[0], : turned.shape[1]] = turned
    return whole


def _orient_right_handed(grid_px: Floats, sign: int) -> tuple[Floats, int]:
    """Orient the grid with x along a row and y down a column, as in the image: not mirrored."""
    along_row = np.nanmedian(np.diff(grid_px, axis=1).reshape(-1, 2), axis=0)
    along_column = np.nanmedian(np.diff(grid_px, axis=0).reshape(-1, 2), axis=0)
    if along_row[0] * along_column[1] - along_row[1] * along_column[0] > 0:
        return grid_px, sign
    # mirrored columns: the quadrants between the axes and those beside them are exchanged
    return grid_px[:, ::-1], sign * (-1) ** grid_px.shape[1]


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


def detect_chessboard(image: Image, board: Board) -> Sighting:
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
