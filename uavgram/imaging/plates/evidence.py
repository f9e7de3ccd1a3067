"""Tests whether a detected plate is the plate that it is taken for."""

from __future__ import annotations

import numpy as np

from uavgram.imaging.plates.fit import FIRST_BLUR_PX, PlateFit, plate_weights
from uavgram.imaging.plates.picture import Window, homography, inverse_of, mapped, render
from uavgram.imaging.raster import Image
from uavgram.model.arrays import Bools, Floats

_WRONG_CELL = 0.4  # mean residual of a wrong cell, as a share of the contrast


def agreement_at(grey: Image, window: Window, cells: Bools, corner_px: Floats) -> float:
    """Correlate a plate's picture at given corners with a window of a photo.

    Parameters
    ----------
    grey, window, cells, corner_px
        As for `fit_plate`.
    """
    inside = plate_weights(window, corner_px, len(cells), FIRST_BLUR_PX) > 0
    share = render(cells, corner_px, FIRST_BLUR_PX, window).share[inside]
    values = grey[inside].astype(np.float64)
    if values.size < len(cells) ** 2 or np.ptp(values) == 0 or np.ptp(share) == 0:
        return 0.0
    return float(np.corrcoef(share, values)[0, 1])


def wrong_cells(fitted: PlateFit, cells: Bools, window: Window) -> int:
    """Count the cells of a plate that are nearer to the other colour.

    Parameters
    ----------
    fitted
        Fitted plate.
    cells, window
        As for `fit_plate`.
    """
    n = len(cells)
    place = n * mapped(inverse_of(homography(fitted.corner_px)), window.pixels)
    inside = ((place > 0) & (place < n)).all(axis=-1) & (fitted.weight > 0)
    column, row = place[inside].astype(int).T
    # Mean residual of each cell, from the pixels inside it.
    number = np.bincount(row * n + column, minlength=n * n)
    total = np.bincount(row * n + column, fitted.residual[inside], minlength=n * n)
    mean = np.abs(total) / np.maximum(number, 1)
    return int((mean > _WRONG_CELL * abs(fitted.contrast)).sum())
