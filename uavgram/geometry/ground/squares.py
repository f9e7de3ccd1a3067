"""Squares that lie on a plane."""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Floats

_CORNERS = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])


def squares_on_plane(center_m: Floats, slope: Floats, turn_rad: Floats, side_m: float) -> Floats:
    """(N, 4, 3) corners of squares, counterclockwise from above.

    Parameters
    ----------
    center_m
        (N, 3) their middles.
    slope
        (N, 2) or (2,) d up / d east and d up / d north of the ground there.
    turn_rad
        (N,) of the first side from east, counterclockwise.
    side_m
        Of each.
    """
    slope = np.broadcast_to(slope, (len(center_m), 2))
    flat = np.column_stack([np.cos(turn_rad), np.sin(turn_rad)])
    along = np.column_stack([flat, np.sum(slope * flat, axis=1)])
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    up = np.column_stack([-slope, np.ones(len(slope))])
    across = np.cross(up / np.linalg.norm(up, axis=1, keepdims=True), along)
    corner = side_m * (_CORNERS[:, :1] * along[:, None] + _CORNERS[:, 1:] * across[:, None])
    return np.asarray(center_m[:, None] + corner)
