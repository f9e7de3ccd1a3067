"""The scaled top view of the report: world metres to coordinates of a drawing, nothing more."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result
from uavgram.stages.products.map_layers import (
    ellipse_outlines,
    measured_strips,
    position_strips,
    reference_strips,
)
from uavgram.views.style import ABOVE, BELOW, hex_colour
from uavgram.views.survey.departures import Departures, departures
from uavgram.views.survey.drawing import longest_middle, nice_factor, uncovered
from uavgram.views.survey.sheet import (
    MOST_HEIGHT,
    WIDTH,
    GridLine,
    Sheet,
    grid_lines,
    lay_sheet,
)
from uavgram.views.unit_words import in_units
from uavgram.views.units import INCH_M, round_bar, units_of, value_text
from uavgram.views.wording import number, worst_first

LINE_HEIGHT = 14.0
# Half the width of a letter, by CSS class, in the widest of the usual fonts; and around a text.
HALF_LETTER = {"measured": 3.9, "known": 3.5, "name": 3.5, "off_plane": 3.2, "off_ground": 3.2}
ASIDE = 2.0
ELLIPSE_SHARE, FILL_SHARE = 0.03, 0.05
MOST_ROOM = 0.3
MOST_NAMES = 60
NAME_ABOVE, NUMBER_BELOW = 8.0, 13.0
# Half the diagonal of the mark of a point off the ground.
DIAMOND = 5.0
# Departures from the plane are shown to millimetres where they are known better than this.
WELL_KNOWN_M = 0.01
# Many lines are drawn thin, and only so many of the measured ones named.
MANY_LINES, MOST_MEASURED = 20, 12
BOLD, FINE, THIN = 2.0, 1.0, 0.5
# On white paper the screen's light colours are too faint.
INK = {
    "used": "#b0127a",
    "suspect": "#c62828",
    "removed": "#c62828",
    "checked": "#6a3fb5",
    "unseen": "#777777",
    "position": "#8e24aa",
    "measured": "#00796b",
    "point": "#222222",
    "ellipse": "#e07b00",
    "above": hex_colour(ABOVE),
    "below": hex_colour(BELOW),
}


@dataclass(frozen=True)
class Stroke:
    """A polyline: SVG points, colour, whether it is dashed, and its width."""

    points: str
    colour: str
    dashed: bool
    width: float = BOLD


@dataclass(frozen=True)
class Text:
    """A text with its middle at (x, y); `kind` is a CSS class."""

    x: float
    y: float
    text: str
    kind: str


@dataclass(frozen=True)
class TopView:
    """Everything the template draws.

    Attributes
    ----------
    width, height
        Of the drawing.
    sheet
        From the world to it.
    grid
        Lines at round distances from the origin.
    lines, ellipses
        Strokes in drawing order.
    dots
        (x, y) of the points.
    off_plane
        (x, y) and colour of those whose ground is no plane; empty where it is.
    off_ground
        SVG points of a diamond around each point that stands off the ground.
    full_m
        Departure from the plane from which on colours are full; 0 where there is none.
    texts
        Names and lengths that do not cover each other.
    ellipse_factor, fill_ellipses
        Exaggeration of the ellipses within the survey; whether they are small enough to be filled.
    bar_text, bar
        Length of the scale bar in words, and in the drawing.
    small_unit
        Of the numbers under points off their plane, in words.
    north_known
        False with gauge ``plane``, where north is a free choice.
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
    texts: tuple[Text, ...]
    ellipse_factor: int
    fill_ellipses: bool
    bar_text: str
    bar: float
    small_unit: str
    north_known: bool

    @property
    def looks(self) -> tuple[Stroke, ...]:
        """The lines, those that look the same as one, their pieces parted by an M of SVG paths."""
        alike: dict[tuple[str, bool, float], list[str]] = {}
        for stroke in self.lines:
            look = stroke.colour, stroke.dashed, stroke.width
            alike.setdefault(look, []).append(stroke.points)
        return tuple(Stroke(" M".join(points), *look) for look, points in alike.items())


class Layout(NamedTuple):
    """What lies where in the drawing.

    Attributes
    ----------
    sheet
        From the world to it.
    extent_m
        Of the points, the larger one of east and north.
    ellipse_factor, ellipse_m
        Exaggeration of the ellipses within the survey, and half the length of the median one.
    """

    sheet: Sheet
    extent_m: float
    ellipse_factor: int
    ellipse_m: float


def lay_out(result: Result, most_height: float = MOST_HEIGHT) -> Layout | None:
    """Lay the points into a drawing, not higher than that; None where there is none."""
    position = result.points.position_world_m
    if not len(position):
        return None
    low, high = position[:, :2].min(axis=0), position[:, :2].max(axis=0)
    extent_m = max(float((high - low).max()), 1.0)
    major = result.points.relative.ellipse_95_m[:, 0]
    usual = float(np.median(major))
    factor = nice_factor(usual, ELLIPSE_SHARE * extent_m)
    # room for the ellipses too, unless they would leave none for the points
    room = min(factor * float(major.max()), MOST_ROOM * extent_m)
    return Layout(lay_sheet(low - room, high + room, most_height), extent_m, factor, usual)


def top_view(result: Result, most_height: float = MOST_HEIGHT) -> TopView | None:
    """Lay out the drawing, not higher than that; None where there is no point to draw."""
    layout = lay_out(result, most_height)
    if layout is None:
        return None
    sheet, extent_m, factor, usual = layout
    position = result.points.position_world_m
    units = units_of(result)
    bar_m, bar_text = round_bar(extent_m / 5, units)
    uneven = departures(result)
    return TopView(
        width=WIDTH,
        height=sheet.height,
        sheet=sheet,
        grid=tuple(grid_lines(sheet, units)),
        lines=tuple(_lines(result, sheet)),
        ellipses=tuple(_ellipses(result, sheet, factor)),
        dots=tuple((float(x), float(y)) for x, y in sheet(position)),
        off_plane=tuple(_off_plane(result, sheet, uneven)) if uneven else (),
        off_ground=tuple(_diamonds(result, sheet)),
        full_m=uneven.full_m if uneven else 0.0,
        texts=tuple(_texts(result, sheet, uneven)),
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
    """Lines of known position as they were stated; those that do not fit in red."""
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


def _diamonds(result: Result, sheet: Sheet) -> Iterator[str]:
    corners = DIAMOND * np.array([[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]])
    for spot in sheet(result.points.position_world_m[result.points.is_off_ground]):
        yield _points(spot + corners)


def _over_ground(result: Result, sheet: Sheet) -> Iterator[Text]:
    """Heights of points over the ground [m], the highest first."""
    points = result.points
    off, spots = np.flatnonzero(points.is_off_ground), sheet(points.position_world_m)
    height, sigma = points.height_above_ground_m, points.height_sigma_m
    for k in off[np.argsort(-np.abs(height[off]), kind="stable")]:
        sign = "+" if height[k] > 0 else ""
        text = value_text(float(height[k]), float(sigma[k]), "m", units_of(result))
        at = float(spots[k, 0]), float(spots[k, 1]) + NUMBER_BELOW
        yield Text(*at, sign + text, "off_ground")


def _off_their_plane(result: Result, sheet: Sheet, uneven: Departures) -> Iterator[Text]:
    """How far points lie off their plane [cm or in], the farthest first."""
    small_m = 0.01 if units_of(result).length == "m" else INCH_M
    spots = sheet(result.points.position_world_m[uneven.rows])
    for k in np.argsort(-np.abs(uneven.value_m), kind="stable"):
        places = int(uneven.sigma_m[k] < WELL_KNOWN_M)
        text = number(float(uneven.value_m[k]) / small_m, places, signed=True)
        yield Text(float(spots[k, 0]), float(spots[k, 1]) + NUMBER_BELOW, text, "off_plane")


def _texts(result: Result, sheet: Sheet, uneven: Departures | None) -> list[Text]:
    """What there is room for: measured values first (the least certain), then known lengths.

    Then names of points, how high they stand over the ground, and how far the ground lies off its
    plane there.
    """
    rows, words, units = result.measurements, [], units_of(result)
    for i, strips in measured_strips(result).items():
        if strips:
            value = value_text(float(rows.value[i]), float(rows.sigma[i]), rows.unit[i], units)
            text = f"{rows.name[i]} {value}{' ?' if rows.is_ambiguous[i] else ''}"
            words.append((int(i), Text(*_at(sheet(longest_middle(strips))), text, "measured")))
    rank = {int(i): r for r, i in enumerate(worst_first(rows))}
    texts = [text for _, text in sorted(words, key=lambda word: rank[word[0]])]
    if len(texts) > MANY_LINES:
        texts = texts[:MOST_MEASURED]
    for name, strip in zip(result.control_lines.name, position_strips(result), strict=True):
        texts.append(Text(*_at(sheet(longest_middle([strip]))), name, "known"))
    for i, strip in reference_strips(result).items():
        length_m = float(result.lines.length_m[i])
        text = f"{result.lines.name[i]} {in_units(f'{length_m:.2f} m', units, exact=[length_m])}"
        texts.append(Text(*_at(sheet(longest_middle([strip]))), text, "known"))
    for label, spot in zip(result.points.label, sheet(result.points.position_world_m), strict=True):
        texts.append(Text(float(spot[0]), float(spot[1]) - NAME_ABOVE, label, "name"))
    heights = list(_over_ground(result, sheet))
    if uneven:
        heights += _off_their_plane(result, sheet, uneven)
    texts += heights
    most = 2 * MOST_NAMES if heights else MOST_NAMES
    half = np.array([HALF_LETTER[text.kind] * len(text.text) + ASIDE for text in texts])
    anchors = np.reshape([(text.x, text.y) for text in texts], (-1, 2))
    # no text is cut off at the sheet's sides
    anchors[:, 0] = np.clip(anchors[:, 0], half, np.maximum(WIDTH - half, half))
    return [
        replace(texts[i], x=float(anchors[i, 0]))
        for i in uncovered(anchors, half, LINE_HEIGHT, most)
    ]


def _at(drawn: Floats) -> tuple[float, float]:
    return float(drawn[0]), float(drawn[1]) - 4.0
