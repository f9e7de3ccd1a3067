"""Search for a patch in a region: its best place, and the next best one."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from uavgram.imaging.patches import Grey
from uavgram.model.arrays import Bools, Floats

SAME_PEAK = 4
"""Steps about the best place within which other places belong to the same peak."""


class Peak(NamedTuple):
    """Best place (x, y) from the middle of the searched region, in steps.

    Attributes
    ----------
    place
        (2,) to some tenths of a step.
    likeness
        Normalised correlation there.
    next_place, second
        (2,) the best place elsewhere in the region, to a step, and its correlation; -1: none.
    at_edge
        Whether the place is on the edge of the region: the true place may be outside.
    """

    place: Floats
    likeness: float
    next_place: Floats
    second: float
    at_edge: bool


def best_place(patch: Grey, searched: Grey, allowed: Bools) -> Peak:
    """Find the place of a patch within a larger window.

    Parameters
    ----------
    patch
        (p, p), p odd.
    searched
        (p + 2 r, p + 2 r).
    allowed
        (2 r + 1, 2 r + 1) mask of places allowed for its middle.
    """
    like = cv2.matchTemplate(searched, patch, cv2.TM_CCOEFF_NORMED)
    like[~(np.abs(like) < 1.01)] = -1.0  # not finite where there is no texture
    inside = np.where(allowed, like, np.float32(-1.0))
    y, x = np.unravel_index(int(inside.argmax()), inside.shape)
    reach = like.shape[0] // 2
    if not 0 < x < 2 * reach or not 0 < y < 2 * reach:
        off = np.array([x - reach, y - reach], np.float64)
        return Peak(off, float(inside[y, x]), off, second=-1.0, at_edge=True)
    around = like[y - 1 : y + 2, x - 1 : x + 2].astype(np.float64)
    at_edge = bool(around.max() > like[y, x])
    rest = inside.copy()
    rest[max(y - SAME_PEAK, 0) : y + SAME_PEAK + 1, max(x - SAME_PEAK, 0) : x + SAME_PEAK + 1] = -1
    next_y, next_x = np.unravel_index(int(rest.argmax()), rest.shape)
    next_place = np.array([next_x - reach, next_y - reach], np.float64)
    offset = np.array([_top(around[1]), _top(around[:, 1])])
    place = np.array([x - reach, y - reach]) + offset
    return Peak(place, float(like[y, x]), next_place, float(rest[next_y, next_x]), at_edge)


def _top(three: Floats) -> float:
    """Find the maximum of the parabola through three values, the middle one largest."""
    bend = 2 * three[1] - three[0] - three[2]
    return float(np.clip(0.5 * (three[2] - three[0]) / bend, -0.5, 0.5)) if bend > 0 else 0.0
