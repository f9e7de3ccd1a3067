"""How the photos stand to the board: tilts, rolls, and how much of the image they cover."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.estimation.calibration.problem import State
from uavgram.model.arrays import Floats, Ints

CELLS = (8, 6)
"""Columns and rows in which the image is looked at for empty places."""


class Tilts(NamedTuple):
    """Directions from which the board was seen.

    Attributes
    ----------
    tilt_rad
        (M,) angle between the board's normal and the optical axis.
    spread_rad
        (2,) root mean square of the tilts about their mean along the image's direction in which
        they vary most, and across it.
    weak_rad
        Direction in the image along which they vary least, in [-pi/2, pi/2).
    """

    tilt_rad: Floats
    spread_rad: Floats
    weak_rad: float


def tilts(state: State) -> Tilts:
    """Tilts of the boards in the camera's frame.

    A roll of the camera by a quarter turns the direction of a tilt with it. What varies along one
    direction only leaves the principal point along the other one to the perspective of few.
    """
    normal = state.camera_from_board[:, :, 2]
    # The same board may be seen with its normal towards or away from the camera.
    normal = normal * np.where(normal[:, 2:] < 0, -1.0, 1.0)
    lateral = np.hypot(normal[:, 0], normal[:, 1])
    tilt = np.arctan2(lateral, normal[:, 2])
    vector = normal[:, :2] * (tilt / np.maximum(lateral, 1e-12))[:, None]
    centred = vector - vector.mean(axis=0)
    values, axes = np.linalg.eigh(centred.T @ centred / len(vector))
    weak = float(np.arctan2(axes[1, 0], axes[0, 0]))
    return Tilts(
        tilt,
        np.sqrt(np.maximum(values[::-1], 0.0)),
        (weak + np.pi / 2) % np.pi - np.pi / 2,
    )


class Coverage(NamedTuple):
    """Where in the image there are corners.

    Attributes
    ----------
    corners
        (R, C) corners by cell of the image.
    largest_share
        Largest distance of a corner from the middle of the image, over that of its corner.
    """

    corners: Ints
    largest_share: float

    @property
    def share(self) -> float:
        """Of the cells, those with a corner."""
        return float(np.mean(self.corners > 0))


def coverage(
    pixel_px: Floats, size_px: tuple[int, int], cells: tuple[int, int] = CELLS
) -> Coverage:
    """Count corners (N, 2) by cell of the image.

    Parameters
    ----------
    pixel_px
        (N, 2) corners of all photos.
    size_px
        Width and height of the image.
    cells
        Columns and rows of cells.
    """
    columns, rows = cells
    size = np.array(size_px, np.float64)
    u, v = ((pixel_px + 0.5) / size).T
    count = np.histogram2d(v, u, bins=(rows, columns), range=((0, 1), (0, 1)))[0]
    radius = np.linalg.norm(pixel_px - (size - 1) / 2, axis=1).max(initial=0.0)
    return Coverage(count.astype(np.int64), float(radius / np.linalg.norm(size / 2)))
