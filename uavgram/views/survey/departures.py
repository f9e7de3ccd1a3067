"""Where the ground is no plane: how far each point's ground departs from it, and its colour."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.imaging.photos.preview import Pixels
from uavgram.model.arrays import Floats, Ints
from uavgram.model.result.result import Result
from uavgram.views.style import diverging_colours

# Smaller departures are not worth a picture.
LEAST_M = 5e-4
# Sigmas by which one point at least must be off it: ordinary roughness is no news.
SURE = 3.0
# Quantile of their sizes at which colours are full: one far off does not pale all others.
FULL_SHARE = 0.9


@dataclass(frozen=True, eq=False)
class Departures:
    """Of n points whose ground is no plane.

    Attributes
    ----------
    rows
        (n,) which points.
    value_m, sigma_m
        (n,) of the ground over the plane of its area.
    full_m
        Size from which on colours are full.
    """

    rows: Ints
    value_m: Floats
    sigma_m: Floats
    full_m: float

    @property
    def colours(self) -> Pixels:
        """(n, 3) red above the plane, blue below it, pale near it."""
        return diverging_colours(self.value_m / self.full_m)

    @property
    def largest(self) -> int:
        """Which of the n is farthest off."""
        return int(np.argmax(np.abs(self.value_m)))


def departures(result: Result) -> Departures | None:
    """How far points' ground departs from its plane; None where no point is surely off it."""
    rows = np.flatnonzero(result.points.departs)
    value, sigma = result.points.departure_m[rows], result.points.departure_sigma_m[rows]
    size = np.abs(value)
    if not (size > np.maximum(SURE * sigma, LEAST_M)).any():
        return None
    full = max(float(np.quantile(size, FULL_SHARE)), LEAST_M)
    return Departures(rows, value, sigma, full)
