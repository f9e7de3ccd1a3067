"""Poses of a camera that reads its rows one after the other, while it moves.

Row v of a photo of height h is exposed at time + readout * share(v), with share(v) =
(v - (h - 1) / 2) / h: the stated instant is that of the middle row. Within one photo the camera is
taken to move steadily (Hedborg et al. 2012, "Rolling shutter bundle adjustment")::

    centre(v)            = centre + share sweep[:3]
    world_from_camera(v) = world_from_camera exp(share sweep[3:])

with the sweep readout * (velocity in the world, angular rate in camera axes).
"""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Floats


def row_share(row_px: Floats, height_px: int) -> Floats:
    """(...) when rows are exposed, from the middle row, in readout times: about -1/2 to 1/2."""
    return np.asarray((row_px - (height_px - 1) / 2) / height_px)


def turned_vector(turn: Floats, vector: Floats) -> Floats:
    """(..., 3) exp(turn) vector, without a matrix for each (Rodrigues' formula)."""
    angle = np.linalg.norm(turn, axis=-1)[..., None]
    across = np.cross(turn, vector)
    once = np.sinc(angle / np.pi)
    twice = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2  # (1 - cos a) / a^2
    return np.asarray(vector + once * across + twice * np.cross(turn, across))
