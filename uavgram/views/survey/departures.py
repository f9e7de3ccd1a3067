"""Uneven ground: departure of each point's ground from its plane, and its colour."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.imaging.photos.preview import Pixels
from uavgram.model.arrays import Floats, Ints
from uavgram.model.result.result import Result
from uavgram.views.style import diverging_colours

# Smaller departures do not deserve a picture.
LEAST_M = 5e-4
# Sigmas by which at least one point must be off the plane: ordinary roughness is not shown.
SURE = 3.0
# Quantile of their sizes at which colours are full: one large value does not pale all others.
FULL_SHARE = 0.9


@dataclass(frozen=True, eq=False)
class Departures:
    """Departures of n points whose ground is off its plane.

    Attributes
    ----------
    rows
        (n,) rows of the points.
    value_m, sigma_m
        (n,) height of the ground above the plane of its area.
    full_m
        Size from which on colours are full.
    """

    rows: Ints
    value_m: Floats
    sigma_m: Floats
    full_m: float

    @property
    def colours(self) -> Pixels:
        """(n, 3) colours: red above the plane, blue below it, pale near it."""
        return diverging_colours(self.value_m / self.full_m)

    @property
    def largest(self) -> int:
        """Index of the largest departure."""
        return int(np.argmax(np.abs(self.value_m)))


def departures(result: Result) -> Departures | None:
    """Collect departures of the ground from its plane; return None if none is significant."""
    rows = np.flatnonzero(result.points.departs)
    value, sigma = result.points.departure_m[rows], result.points.departure_sigma_m[rows]
    size = np.abs(value)
    if not (size > np.maximum(SURE * sigma, LEAST_M)).any():
        return None
    full = max(float(np.quantile(size, FULL_SHARE)), LEAST_M)
    return Departures(rows, value, sigma, full)
