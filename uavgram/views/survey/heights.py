"""Heights of a result: points off the ground, departures of uneven ground, drawn profiles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.geometry.ground.figures import ELLIPSOID_95, error_ellipsoid
from uavgram.imaging.photos.preview import Pixels
from uavgram.model.arrays import Floats, Ints
from uavgram.model.naming import METRIC, Units, round_down
from uavgram.model.result.result import Result
from uavgram.model.result.tables import COLUMNS, HeightSource, PointResults
from uavgram.views.formatting import format_with_sigma, height_text, number
from uavgram.views.style import INK, diverging_colours
from uavgram.views.survey.drawing import Drawing, Look
from uavgram.views.survey.outlines import nice_factor
from uavgram.views.survey.text_placement import TextRequest, box
from uavgram.views.tables import Table, make_table
from uavgram.views.units import (
    DisplayUnit,
    decimals,
    format_length,
    round_bar,
    table_unit,
    units_of,
)


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
        value = format_length(height, units)
    word = {"stated": ", stated", "found": ", not free in the picks"}.get(source, "")
    return f"{points.label[row]} {value}{word}"


# Smaller departures do not deserve a picture.
MIN_DEPARTURE_M = 5e-4
# Sigmas by which at least one point must be off the plane: ordinary roughness is not shown.
SHOWN_SIGMAS = 3.0
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
    if not (size > np.maximum(SHOWN_SIGMAS * sigma, MIN_DEPARTURE_M)).any():
        return None
    full = max(float(np.quantile(size, FULL_SHARE)), MIN_DEPARTURE_M)
    return Departures(rows, value, sigma, full)


WIDTH, LEFT, RIGHT, TOP, BOTTOM = 720.0, 70.0, 30.0, 34.0, 30.0
MAX_HEIGHT, MIN_HEIGHT = 200.0, 24.0
"""Limits of the drawn height: heights are exaggerated as far as the first allows."""

HALF_DOT, HALF_BAR = 2.5, 1.5
"""Half sizes of the areas around points and bars without names."""
GRID_LINES = 4
INTERVAL_SIGMAS = 1.959964
"""Half of a 95 % interval, in sigmas."""

DOT, BAR, LINE = 2.4, 2.4, 1.6
RULER, GROUND = Look("#777777", 0.7), Look("#8a6d3b", 1.2, dashes="6 3")
LEVEL = Look("#d7dbe0", 0.7)


@dataclass(frozen=True)
class ProfileDrawing:
    """Drawing of one profile, and what else is shown of it.

    Attributes
    ----------
    name
        Name of the profile.
    drawing
        The drawing: ``points``, ``line``, ``ground`` below it, ``bars`` of the 95 % interval of
        each height, ``rulers`` from the ground to points off it, and level ``grid`` lines.
    labels
        Labels of all points.
    levels
        Heights of the level lines over the first point as texts.
    exaggeration
        Exaggeration of heights against stations.
    table
        Label, then a cell for each of `COLUMNS`.
    """

    name: str
    drawing: Drawing
    labels: tuple[str, ...]
    levels: tuple[str, ...]
    exaggeration: int
    table: Table


def profile_drawings(result: Result) -> tuple[ProfileDrawing, ...]:
    """Draw all profiles of a result."""
    return tuple(_draw(result, name, rows) for name, rows in result.profiles.each())


def _draw(result: Result, name: str, rows: Ints) -> ProfileDrawing:
    profiles = result.profiles
    station, _, up, ground = profiles.place_m[rows].T
    reach = INTERVAL_SIGMAS * profiles.sigma_m[rows, 2]
    low = min((up - reach).min(), ground.min())
    high = max((up + reach).max(), ground.max())
    rise, run = max(high - low, 1e-6), max(float(np.ptp(station)), 1e-6)
    # scale along from the width; exaggeration of heights from the 1-2-5 series
    scale = (WIDTH - LEFT - RIGHT) / run
    factor = nice_factor(rise * scale, MAX_HEIGHT)
    first = station.min()

    def places(along_m: Floats, up_m: Floats) -> Floats:
        x = LEFT + (along_m - first) * scale
        return np.stack([x, TOP + (high - up_m) * scale * factor], axis=-1)

    units = units_of(result)
    drawing = Drawing(
        f"Profile {name}: heights along its line",
        WIDTH,
        TOP + max(rise * scale * factor, MIN_HEIGHT) + BOTTOM,
    )
    levels_m, levels = _levels(low, high, table_unit(units))
    for level_m, text in zip(levels_m, levels, strict=True):
        _, y = places(first, level_m)
        drawing.lines("grid", [np.array([[LEFT - 8, y], [WIDTH - 20, y]])], LEVEL)
        drawing.write((LEFT / 2 - 1, y + 4), text, "name")
    in_order, off = np.argsort(station, kind="stable"), up != ground
    dots, below = places(station, up), places(station, ground)
    bars = np.stack([places(station, up + reach), places(station, up - reach)], axis=1)
    drawing.lines("ground", [below[in_order]], GROUND)
    drawing.lines("rulers", np.stack([dots[off], below[off]], axis=1), RULER)
    drawing.lines("line", [dots], Look(INK["measured"], LINE))
    drawing.lines("bars", bars, Look(INK["ellipse"], BAR))
    drawing.signs("points", dots, DOT, Look(fill=INK["point"]))
    bar_m, bar_text = round_bar(run / 4.0, units)
    drawing.scale_bar(LEFT, drawing.height - 16, bar_m * scale, bar_text)
    drawing.reserve([box(dot, HALF_DOT, HALF_DOT) for dot in dots])
    heights = np.abs(np.diff(bars[..., 1], axis=1))[:, 0] / 2
    drawing.reserve(
        [box(at, HALF_BAR, half) for at, half in zip(bars.mean(axis=1), heights, strict=True)]
    )
    labels = tuple(profiles.label[i] for i in rows)
    # labels around the tops of their bars
    drawing.place(
        [
            TextRequest(label, "name", bar[:1], is_needed=False, rank=rank)
            for rank, (label, bar) in enumerate(zip(labels, bars, strict=True))
        ]
    )
    titles = " | ".join(("point", *(f">{name}, {table_unit(units).symbol}" for name in COLUMNS)))
    cells = ((profiles.label[i], *_cells(result, int(i))) for i in rows)
    return ProfileDrawing(name, drawing, labels, levels, factor, make_table(titles, cells))


def _levels(low: float, high: float, one: DisplayUnit) -> tuple[Floats, tuple[str, ...]]:
    """Return round heights [m] in the unit that is shown, and their texts."""
    low, high = low * one.factor, high * one.factor
    step = round_down(max(high - low, 1e-6) / GRID_LINES * 2.0)
    levels = step * np.arange(np.ceil(low / step), np.floor(high / step) + 1)
    places = max(0, int(np.ceil(-np.log10(step))))
    texts = tuple(f"{number(level, places)} {one.symbol}" for level in levels.tolist())
    return levels / one.factor, texts


def _cells(result: Result, row: int) -> tuple[str, ...]:
    """Format place and sigma of each of `COLUMNS`; values fixed by definition have no sigma."""
    cells, unit = [], table_unit(units_of(result))
    for k in range(len(COLUMNS)):
        place = unit.factor * float(result.profiles.place_m[row, k])
        sigma = unit.factor * float(result.profiles.sigma_m[row, k])
        places = decimals(sigma, unit) if sigma > 0 else 3
        known = f" ± {number(sigma, places)}" if sigma > 0 else ""
        cells.append(f"{number(place, places)}{known}")
    return tuple(cells)
