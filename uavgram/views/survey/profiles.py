"""Drawings of the measured profiles: metres along and up to coordinates of a drawing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Floats, Ints
from uavgram.model.result.result import Result
from uavgram.model.result.tables import COLUMNS
from uavgram.views.formatting import decimals_for, number
from uavgram.views.survey.outlines import nice_factor, round_length
from uavgram.views.survey.text_placement import PlacedText, TextRequest, box, place_texts
from uavgram.views.units import DisplayUnit, round_bar, table_unit, units_of

WIDTH, LEFT, RIGHT, TOP, BOTTOM = 720.0, 70.0, 30.0, 34.0, 30.0
MAX_HEIGHT, MIN_HEIGHT = 200.0, 24.0
"""Limits of the drawn height: heights are exaggerated as far as the first allows."""

HALF_DOT, HALF_BAR = 2.5, 1.5
"""Half sizes of the areas around points and bars without names."""
GRID_LINES = 4
WIDE = 1.959964
"""Half of a 95 % interval, in sigmas."""

Place = tuple[float, float]


@dataclass(frozen=True)
class ProfileDrawing:
    """Content of the drawing of one profile for the template.

    Attributes
    ----------
    name
        Name of the profile.
    width, height
        Size of the drawing.
    dots, ground
        Places of the points in their order, and of the smooth ground below them along the line.
    bars
        (x, top, bottom) of the 95 % interval of each height.
    rulers
        (x, top, bottom) from the ground to each point off it.
    labels, names
        Labels of all points, and those texts of them that have room.
    grid
        y of level lines, and their heights over the first point as texts.
    exaggeration
        Exaggeration of heights against stations.
    bar_text, bar
        Length of the scale bar in words, and in the drawing.
    rows
        Rows of the table: label, then a cell for each of `COLUMNS`.
    """

    name: str
    width: float
    height: float
    dots: tuple[Place, ...]
    ground: tuple[Place, ...]
    bars: tuple[tuple[float, float, float], ...]
    rulers: tuple[tuple[float, float, float], ...]
    labels: tuple[str, ...]
    names: tuple[PlacedText, ...]
    grid: tuple[tuple[float, str], ...]
    exaggeration: int
    bar_text: str
    bar: float
    rows: tuple[tuple[str, ...], ...]


def profile_drawings(result: Result) -> tuple[ProfileDrawing, ...]:
    """Draw all profiles of a result."""
    return tuple(_draw(result, name, rows) for name, rows in result.profiles.each())


@dataclass(frozen=True)
class _Sheet:
    """Mapping of metres along and up to the drawing."""

    first_m: float
    high_m: float
    scale: float
    steep: float

    def x(self, along_m: Floats) -> Floats:
        return np.asarray(LEFT + (along_m - self.first_m) * self.scale)

    def y(self, up_m: Floats) -> Floats:
        return np.asarray(TOP + (self.high_m - up_m) * self.steep)


def _draw(result: Result, name: str, rows: Ints) -> ProfileDrawing:
    profiles = result.profiles
    station, _, up, ground = profiles.place_m[rows].T
    reach = WIDE * profiles.sigma_m[rows, 2]
    low = min((up - reach).min(), ground.min())
    high = max((up + reach).max(), ground.max())
    rise, run = max(high - low, 1e-6), max(float(np.ptp(station)), 1e-6)
    # scale along from the width; exaggeration of heights from the 1-2-5 series
    scale = (WIDTH - LEFT - RIGHT) / run
    factor = nice_factor(rise * scale, MAX_HEIGHT)
    sheet = _Sheet(float(station.min()), float(high), scale, scale * factor)
    x, y, below = sheet.x(station), sheet.y(up), sheet.y(ground)
    in_order = np.argsort(station, kind="stable")
    bars = (x, sheet.y(up + reach), sheet.y(up - reach))
    off = up != ground
    units = units_of(result)
    bar_m, bar_text = round_bar(run / 4.0, units)
    height = TOP + max(rise * sheet.steep, MIN_HEIGHT) + BOTTOM
    labels = tuple(profiles.label[i] for i in rows)
    return ProfileDrawing(
        name=name,
        width=WIDTH,
        height=height,
        dots=_places(x, y),
        ground=_places(x[in_order], below[in_order]),
        bars=_uprights(*bars),
        rulers=_uprights(x[off], y[off], below[off]),
        labels=labels,
        names=_names(labels, bars, y, height),
        grid=_grid(sheet, low, high, table_unit(units)),
        exaggeration=factor,
        bar_text=bar_text,
        bar=bar_m * scale,
        rows=tuple((profiles.label[i], *_cells(result, int(i))) for i in rows),
    )


def _names(
    labels: tuple[str, ...], bars: tuple[Floats, Floats, Floats], y: Floats, height: float
) -> tuple[PlacedText, ...]:
    """Place labels around the tops of their bars, as far as there is room above the scale bar."""
    x, top, bottom = bars
    wanted = [
        TextRequest(label, "name", np.array([spot]), is_needed=False, rank=rank)
        for rank, (label, spot) in enumerate(
            zip(labels, np.column_stack([x, top]).tolist(), strict=True)
        )
    ]
    middle = (top + bottom) / 2
    taken = [box((a, b), HALF_DOT, HALF_DOT) for a, b in zip(x, y, strict=True)]
    taken += [
        box((a, b), HALF_BAR, float(c))
        for a, b, c in zip(x, middle, np.abs(bottom - top) / 2, strict=True)
    ]
    return place_texts(wanted, (np.array([LEFT, 0.0]), np.array([WIDTH, height])), taken)[0]


def _grid(
    sheet: _Sheet, low: float, high: float, one: DisplayUnit
) -> tuple[tuple[float, str], ...]:
    """Return level lines at round heights in the unit that is shown."""
    low, high = low * one.factor, high * one.factor
    step = round_length(max(high - low, 1e-6) / GRID_LINES * 2.0)
    levels = step * np.arange(np.ceil(low / step), np.floor(high / step) + 1)
    places = max(0, int(np.ceil(-np.log10(step))))
    return tuple(
        (float(sheet.y(level / one.factor)), f"{number(float(level), places)} {one.symbol}")
        for level in levels
    )


def _places(x: Floats, y: Floats) -> tuple[Place, ...]:
    return tuple(zip(x.tolist(), y.tolist(), strict=True))


def _uprights(x: Floats, top: Floats, bottom: Floats) -> tuple[tuple[float, float, float], ...]:
    return tuple(zip(x.tolist(), top.tolist(), bottom.tolist(), strict=True))


def _cells(result: Result, row: int) -> tuple[str, ...]:
    """Format place and sigma of each of `COLUMNS`; values fixed by definition have no sigma."""
    cells, factor = [], table_unit(units_of(result)).factor
    for k in range(len(COLUMNS)):
        place = factor * float(result.profiles.place_m[row, k])
        sigma = factor * float(result.profiles.sigma_m[row, k])
        places = decimals_for(sigma) if sigma > 0 else 3
        known = f" ± {number(sigma, places)}" if sigma > 0 else ""
        cells.append(f"{number(place, places)}{known}")
    return tuple(cells)
