"""Points off the ground, with ellipsoids and heights, and departures of uneven ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.geometry.ground.figures import ELLIPSOID_95, error_ellipsoid
from uavgram.imaging.photos.preview import Pixels
from uavgram.model.arrays import Floats, Ints
from uavgram.model.naming import METRIC, Units
from uavgram.model.result.result import Result
from uavgram.model.result.tables import HeightSource, PointResults
from uavgram.views.formatting import format_with_sigma, height_text, number
from uavgram.views.sentence_units import convert_sentence
from uavgram.views.style import diverging_colours


@dataclass(frozen=True, eq=False)
class OffGround:
    """n points off the ground.

    Attributes
    ----------
    rows
        (n,) rows of the points.
    foot_m
        (n, 3) places on the ground straight below (or above) them.
    half_axes_m, directions
        (n, 3) and (n, 3, 3) of their 95 % ellipsoids within the survey, the largest axis first,
        along the columns; 0 if not known.
    source
        (n,) whether the height was ``stated``, left ``free``, or ``found`` without being stated.
    """

    rows: Ints
    foot_m: Floats
    half_axes_m: Floats
    directions: Floats
    source: tuple[HeightSource, ...]

    def of(self, source: HeightSource) -> Ints:
        """Return the indices of the points whose heights are from a source."""
        return np.flatnonzero([one == source for one in self.source])


def collect_off_ground(result: Result) -> OffGround | None:
    """Collect the points off the ground; return None if all are on it."""
    points = result.points
    rows = np.flatnonzero(points.is_off_ground)
    if not len(rows):
        return None
    foot = points.position_world_m[rows].copy()
    foot[:, 2] -= points.height_above_ground_m[rows]
    half_axes, directions = error_ellipsoid(np.nan_to_num(points.relative.covariance_m3[rows]))
    source = tuple(points.height_source[row] for row in rows)
    return OffGround(rows, foot, ELLIPSOID_95 * half_axes, directions, source)


def height_of(points: PointResults, row: int) -> str:
    """Format a point's height above the ground with its source: ``1.402 ± 0.021 m, found``."""
    height, sigma = float(points.height_above_ground_m[row]), float(points.height_sigma_m[row])
    return height_text(height, sigma, points.height_source[row])


def height_label(points: PointResults, row: int, units: Units = METRIC) -> str:
    """Format a short label, ``V21 1.40 ± 0.03 m``, with the source unless the height was free.

    Parameters
    ----------
    points
        Points of a result.
    row
        Row of the point.
    units
        Units in which it is shown.
    """
    height, sigma = float(points.height_above_ground_m[row]), float(points.height_sigma_m[row])
    source = points.height_source[row]
    value = format_with_sigma(height, sigma, "m", units)
    if not sigma > 0:
        value = convert_sentence(f"{number(height, 2)} m", units, exact=[abs(height)])
    word = {"stated": ", stated", "found": ", not free in the picks"}.get(source, "")
    return f"{points.label[row]} {value}{word}"


# Smaller departures do not deserve a picture.
MIN_DEPARTURE_M = 5e-4
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


def collect_departures(result: Result) -> Departures | None:
    """Collect departures of the ground from its plane; return None if none is significant."""
    rows = np.flatnonzero(result.points.departs)
    value, sigma = result.points.departure_m[rows], result.points.departure_sigma_m[rows]
    size = np.abs(value)
    if not (size > np.maximum(SURE * sigma, MIN_DEPARTURE_M)).any():
        return None
    full = max(float(np.quantile(size, FULL_SHARE)), MIN_DEPARTURE_M)
    return Departures(rows, value, sigma, full)
