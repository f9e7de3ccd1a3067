"""Assignment of the corners of a grid to the corners of the board."""

from __future__ import annotations

import numpy as np

from uavgram.imaging.targets.grid_growth import Grid
from uavgram.model.arrays import Floats


def trim(grid: Grid, largest: tuple[int, int]) -> Grid:
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
    right_handed, sign = _right_handed(grid.pixel_px, grid.sign)
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


def _right_handed(grid_px: Floats, sign: int) -> tuple[Floats, int]:
    """Orient the grid with x along a row and y down a column, as in the image: not mirrored."""
    along_row = np.nanmedian(np.diff(grid_px, axis=1).reshape(-1, 2), axis=0)
    along_column = np.nanmedian(np.diff(grid_px, axis=0).reshape(-1, 2), axis=0)
    if along_row[0] * along_column[1] - along_row[1] * along_column[0] > 0:
        return grid_px, sign
    # mirrored columns: the quadrants between the axes and those beside them are exchanged
    return grid_px[:, ::-1], sign * (-1) ** grid_px.shape[1]
