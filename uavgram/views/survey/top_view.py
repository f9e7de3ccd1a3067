"""Scaled top view of the report: world metres to coordinates of a drawing, nothing more."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Bools, Floats
from uavgram.model.result.result import Result
from uavgram.stages.products.map_layers import (
    ellipse_outlines,
    measured_strips,
    position_strips,
    reference_strips,
)
from uavgram.views.formatting import number, order_worst_first
from uavgram.views.sentence_units import convert_sentence
from uavgram.views.style import hex_colour
from uavgram.views.survey.off_ground import Departures, collect_departures
from uavgram.views.survey.outlines import longest_part, nice_factor
from uavgram.views.survey.sheet import (
    INK,
    MAX_HEIGHT,
    WIDTH,
    GridLine,
    Sheet,
    grid_lines,
    lay_sheet,
)
from uavgram.views.survey.text_placement import (
    PlacedText,
    TextRequest,
    around_drawing,
    box,
    place_texts,
)
from uavgram.views.units import INCH_M, round_bar, units_of, value_text

ELLIPSE_SHARE, FILL_SHARE = 0.03, 0.05
MAX_ROOM = 0.3
# Half size of the area around a point without text.
HALF_DOT = 2.5
# Half the diagonal of the mark of a point off the ground.
DIAMOND = 5.0
# Departures from the plane are shown to millimetres if their sigma is below this.
WELL_KNOWN_M = 0.01
# With more lines than this they are thin, and only some of the measured ones are named.
MANY_LINES, MAX_MEASURED = 20, 12
BOLD, FINE, THIN = 2.0, 1.0, 0.5


@dataclass(frozen=True)
class Stroke:
    """Polyline: SVG points, colour, whether it is dashed, and its width."""

    points: str
    colour: str
    dashed: bool
    width: float = BOLD


@dataclass(frozen=True)
class TopView:
    """Content of the drawing for the template.

    Attributes
    ----------
    width, height
        Size of the drawing.
    sheet
        Mapping from the world to it.
    grid
        Lines at round distances from the origin.
    lines, ellipses
        Strokes in drawing order.
    dots
        (x, y) of the points.
    off_plane
        (x, y) and colour of those whose ground is off its plane; empty for a plane.
    off_ground
        SVG points of a diamond around each point off the ground.
    full_m
        Departure from the plane from which on colours are full; 0 if there is none.
    texts
        Names, lengths and heights, without overlaps.
    unnamed
        Number of names without room.
    ellipse_factor, fill_ellipses
        Exaggeration of the ellipses within the survey; whether they are small enough to be filled.
    bar_text, bar
        Length of the scale bar in words, and in the drawing.
    small_unit
        Unit of the numbers under points off their plane, in words.
    north_known
        False with gauge ``plane``, where north is arbitrary.
    """

    width: float
    height: float
    sheet: Sheet
    grid: tuple[GridLine, ...]
    lines: tuple[Stroke, ...]
    ellipses: tuple[Stroke, ...]
    dots: tuple[tuple[float, float], ...]
    off_plane: tuple[tuple[float, float, str], ...]
    off_ground: tuple[str, ...]
    full_m: float
    texts: tuple[PlacedText, ...]
    unnamed: int
    ellipse_factor: int
    fill_ellipses: bool
    bar_text: str
    bar: float
    small_unit: str
    north_known: bool

    @property
    def looks(self) -> tuple[Stroke, ...]:
        """Lines joined by style, their pieces separated by an M of SVG paths."""
        alike: dict[tuple[str, bool, float], list[str]] = {}
        for stroke in self.lines:
            look = stroke.colour, stroke.dashed, stroke.width
            alike.setdefault(look, []).append(stroke.points)
        return tuple(Stroke(" M".join(points), *look) for look, points in alike.items())


class Layout(NamedTuple):
    """Scale and position of the drawing.

    Attributes
    ----------
    sheet
        Mapping from the world to it.
    extent_m
        Extent of the points, the larger one of east and north.
    ellipse_factor, ellipse_m
        Exaggeration of the ellipses within the survey, and half the length of the median one.
    """

    sheet: Sheet
    extent_m: float
    ellipse_factor: int
    ellipse_m: float


def used_labels(result: Result) -> frozenset[str]:
    """Return the labels of the points used by a measurement, a known quantity or a check."""
    lines, checks = result.lines, result.point_checks.label
    groups = (*result.measurements.points, *result.known.points)
    return frozenset((*lines.start, *lines.end, *checks)).union(*groups)


def used_points(result: Result) -> Bools:
    """Mark the (K,) points of `used_labels`; all points if there are none."""
    used = used_labels(result)
    found = np.array([label in used for label in result.points.label], np.bool_)
    return found if found.any() else np.ones_like(found)


def fit_layout(
    result: Result, most_height: float = MAX_HEIGHT, shown: Bools | None = None
) -> Layout | None:
    """Fit the points into a drawing; return None if there are none.

    Parameters
    ----------
    result
        Result of the run.
    most_height
        Largest height of the drawing.
    shown
        (K,) the points that it has to show; by default all.
    """
    position = result.points.position_world_m
    if not len(position):
        return None
    rows = slice(None) if shown is None else shown
    low, high = position[rows, :2].min(axis=0), position[rows, :2].max(axis=0)
    extent_m = max(float((high - low).max()), 1.0)
    major = result.points.relative.ellipse_95_m[rows, 0]
    usual = float(np.median(major))
    factor = nice_factor(usual, ELLIPSE_SHARE * extent_m)
    # room for the ellipses too, unless they would leave none for the points
    room = min(factor * float(major.max()), MAX_ROOM * extent_m)
    return Layout(lay_sheet(low - room, high + room, most_height), extent_m, factor, usual)


def top_view(
    result: Result, most_height: float = MAX_HEIGHT, shown: Bools | None = None
) -> TopView | None:
    """Lay out the drawing; return None if there is no point to draw.

    Parameters
    ----------
    result, most_height, shown
        See `fit_layout`; with `shown`, only these points have names and dots, and there are no
        heights.
    """
    layout = fit_layout(result, most_height, shown)
    if layout is None:
        return None
    sheet, extent_m, factor, usual = layout
    position = result.points.position_world_m
    units = units_of(result)
    bar_m, bar_text = round_bar(extent_m / 5, units)
    uneven = collect_departures(result) if shown is None else None
    grid, rows = tuple(grid_lines(sheet, units)), slice(None) if shown is None else shown
    dots = sheet(position[rows])
    taken = [box(dot, HALF_DOT, HALF_DOT) for dot in dots]
    taken += around_drawing(sheet, grid, bar_m * sheet.scale)
    texts, unnamed = place_texts(list(_texts(result, sheet, uneven, shown)), sheet.corners, taken)
    return TopView(
        width=WIDTH,
        height=sheet.height,
        sheet=sheet,
        grid=grid,
        lines=tuple(_lines(result, sheet)),
        ellipses=tuple(_ellipses(result, sheet, factor)),
        dots=tuple((float(x), float(y)) for x, y in dots),
        off_plane=tuple(_off_plane(result, sheet, uneven)) if uneven else (),
        off_ground=tuple(_diamonds(dots[result.points.is_off_ground[rows]])),
        full_m=uneven.full_m if uneven else 0.0,
        texts=texts,
        unnamed=unnamed,
        ellipse_factor=factor,
        fill_ellipses=factor * usual <= FILL_SHARE * extent_m,
        bar_text=bar_text,
        bar=bar_m * sheet.scale,
        small_unit="centimetres" if units.length == "m" else "inches",
        north_known=result.world.gauge == "world",
    )


def _points(drawn: Floats) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in drawn.tolist())


def _lines(result: Result, sheet: Sheet) -> list[Stroke]:
    strips = [strip for some in measured_strips(result).values() for strip in some]
    width = BOLD if len(strips) <= MANY_LINES else THIN
    measured = [
        Stroke(_points(sheet(strip)), INK["measured"], dashed=False, width=width)
        for strip in strips
    ]
    reference = reference_strips(result)
    width = BOLD if len(reference) <= MANY_LINES else FINE
    known = [
        Stroke(
            _points(sheet(strip)),
            INK[result.lines.status[i]],
            dashed=result.lines.status[i] != "used",
            width=BOLD if result.lines.status[i] in ("suspect", "removed") else width,
        )
        for i, strip in reference.items()
    ]
    return measured + known + _lines_of_position(result, sheet)


def _lines_of_position(result: Result, sheet: Sheet) -> list[Stroke]:
    """Draw lines of known position as they were stated; those that do not fit in red."""
    bad = ("suspect", "removed")
    return [
        Stroke(
            _points(sheet(strip)),
            INK[status] if status in bad else INK["position"],
            dashed=status != "used",
            width=BOLD if status in bad else FINE,
        )
        for strip, status in zip(position_strips(result), result.control_lines.status, strict=True)
    ]


def _ellipses(result: Result, sheet: Sheet, factor: int) -> list[Stroke]:
    within = result.points.relative
    center = result.points.position_world_m[:, :2]
    outlines = ellipse_outlines(center, within.ellipse_95_m, within.ellipse_azimuth_rad, factor)
    return [Stroke(_points(sheet(outline)), INK["ellipse"], dashed=False) for outline in outlines]


def _off_plane(
    result: Result, sheet: Sheet, uneven: Departures
) -> Iterator[tuple[float, float, str]]:
    spots = sheet(result.points.position_world_m[uneven.rows])
    for (x, y), colour in zip(spots, uneven.colours, strict=True):
        yield float(x), float(y), hex_colour(colour)


def _diamonds(spots: Floats) -> Iterator[str]:
    corners = DIAMOND * np.array([[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]])
    for spot in spots:
        yield _points(spot + corners)


def _over_ground(result: Result, spots: Floats) -> Iterator[TextRequest]:
    """Yield heights of points over the ground [m], the highest first."""
    points, units = result.points, units_of(result)
    off, height = np.flatnonzero(points.is_off_ground), points.height_above_ground_m
    for k in off[np.argsort(-np.abs(height[off]), kind="stable")]:
        sign = "+" if height[k] > 0 else ""
        text = sign + value_text(float(height[k]), float(points.height_sigma_m[k]), "m", units)
        yield TextRequest(text, "off_ground", spots[k : k + 1], is_needed=False)


def _off_their_plane(result: Result, spots: Floats, uneven: Departures) -> Iterator[TextRequest]:
    """Yield departures of points from their plane [cm or in], the farthest first."""
    small_m = 0.01 if units_of(result).length == "m" else INCH_M
    for k in np.argsort(-np.abs(uneven.value_m), kind="stable"):
        places = int(uneven.sigma_m[k] < WELL_KNOWN_M)
        text = number(float(uneven.value_m[k]) / small_m, places, signed=True)
        yield TextRequest(text, "off_plane", spots[uneven.rows[k]][None], is_needed=False)


def _texts(
    result: Result, sheet: Sheet, uneven: Departures | None, named: Bools | None
) -> Iterator[TextRequest]:
    """Yield names and values of all objects; of many measured values the least certain."""
    rows, units, measured = result.measurements, units_of(result), measured_strips(result)
    shown = [int(i) for i in order_worst_first(rows) if measured.get(int(i))]
    for i in shown[: MAX_MEASURED if len(shown) > MANY_LINES else None]:
        value = value_text(float(rows.value[i]), float(rows.sigma[i]), rows.unit[i], units)
        text = f"{rows.name[i]} {value}{' ?' if rows.is_ambiguous[i] else ''}"
        yield TextRequest(text, "measured", sheet(longest_part(measured[i])))
    for name, strip in zip(result.control_lines.name, position_strips(result), strict=True):
        yield TextRequest(name, "known", sheet(strip))
    for i, strip in reference_strips(result).items():
        length_m = float(result.lines.length_m[i])
        length = convert_sentence(f"{length_m:.2f} m", units, exact=[length_m])
        yield TextRequest(f"{result.lines.name[i]} {length}", "known", sheet(strip))
    spots = sheet(result.points.position_world_m)
    for k, label in enumerate(result.points.label):
        if named is None or named[k]:
            yield TextRequest(label, "name", spots[k : k + 1])
    if named is not None:
        return
    yield from _over_ground(result, spots)
    if uneven:
        yield from _off_their_plane(result, spots, uneven)
