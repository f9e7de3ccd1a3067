"""Scaled top view of the report: world metres to coordinates of a drawing, nothing more."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Bools, Floats
from uavgram.model.result.result import GroundPicture, Result
from uavgram.stages.products.map_layers import (
    ellipse_outlines,
    measured_strips,
    position_strips,
    reference_strips,
)
from uavgram.views.formatting import number, order_worst_first
from uavgram.views.sentence_units import convert_sentence
from uavgram.views.style import INK, hex_colour
from uavgram.views.survey.drawing import PAPER, Drawing, Look
from uavgram.views.survey.off_ground import Departures, collect_departures
from uavgram.views.survey.outlines import longest_part, nice_factor
from uavgram.views.survey.sheet import MAX_HEIGHT, WIDTH, Sheet, draw_frame, lay_sheet
from uavgram.views.survey.text_placement import TextRequest, box
from uavgram.views.units import INCH_M, units_of, value_text

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
DASHES = "7 4"


@dataclass(frozen=True)
class TopView:
    """Drawing, and what its legend needs.

    Attributes
    ----------
    drawing
        The drawing.
    sheet
        Mapping from the world to it.
    full_m
        Departure from the plane from which on colours are full; 0 if there is none.
    has_off_ground
        Whether points are marked that are off the ground.
    ellipse_factor, fill_ellipses
        Exaggeration of the ellipses within the survey; whether they are small enough to be filled.
    small_unit
        Unit of the numbers under points off their plane, in words.
    """

    drawing: Drawing
    sheet: Sheet
    full_m: float
    has_off_ground: bool
    ellipse_factor: int
    fill_ellipses: bool
    small_unit: str


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
    result: Result,
    most_height: float = MAX_HEIGHT,
    shown: Bools | None = None,
    ground: GroundPicture | None = None,
    address: str = "",
) -> TopView | None:
    """Lay out the drawing; return None if there is no point to draw.

    Ellipses are drawn only without a picture of the ground: they would hide it.

    Parameters
    ----------
    result, most_height, shown
        See `fit_layout`; with `shown`, only these points have names and dots, and there are no
        heights.
    ground, address
        Picture of the ground below the drawing, and its address.
    """
    layout = fit_layout(result, most_height, shown)
    if layout is None:
        return None
    sheet, extent_m, factor, usual = layout
    units, is_bare = units_of(result), ground is None
    fill_ellipses = factor * usual <= FILL_SHARE * extent_m
    uneven = collect_departures(result) if shown is None else None
    rows = slice(None) if shown is None else shown
    dots = sheet(result.points.position_world_m[rows])
    is_off = result.points.is_off_ground[rows]
    drawing = Drawing("Top view of points and lines, to scale", WIDTH, sheet.height)
    if ground is not None:
        corner = sheet(np.array([ground.west_m, ground.north_m]))
        drawing.image(corner, np.array([ground.width_m, ground.height_m]) * sheet.scale, address)
    draw_frame(
        drawing, sheet, extent_m / 5, units,
        is_north_known=result.world.gauge == "world", on_picture=not is_bare,
    )  # fmt: skip
    if is_bare:
        ink = INK["ellipse"]
        look = Look(ink, 1.0, fill=ink, fill_opacity=0.15) if fill_ellipses else Look(ink, 0.6)
        drawing.lines("ellipses", _ellipses(result, sheet, factor), look)
    lines = _lines(result, sheet)
    if not is_bare:
        casings = (Look(PAPER, look.width + 1.6, opacity=0.75) for _, look in lines)
        drawing.lines_by_look(
            "casings", ((line, c) for (line, _), c in zip(lines, casings, strict=True))
        )
    drawing.lines_by_look("lines", lines)
    edge = Look(INK["point"]) if is_bare else Look(PAPER, 0.8)
    drawing.signs("points", dots, 2.2, edge._replace(fill=INK["point"]))
    if uneven:
        spots = sheet(result.points.position_world_m[uneven.rows])
        for spot, colour in zip(spots, uneven.colours, strict=True):
            look = Look(INK["point"], 0.7, fill=hex_colour(colour))
            drawing.signs("off_plane", spot[None], 4.5, look)
    drawing.signs("off_ground", dots[is_off], DIAMOND, Look(INK["point"], 1.1), sign="diamond")
    drawing.reserve([box(dot, HALF_DOT, HALF_DOT) for dot in dots])
    drawing.place(list(_texts(result, sheet, uneven, shown)))
    return TopView(
        drawing=drawing,
        sheet=sheet,
        full_m=uneven.full_m if uneven else 0.0,
        has_off_ground=bool(is_off.any()),
        ellipse_factor=factor,
        fill_ellipses=fill_ellipses,
        small_unit="centimetres" if units.length == "m" else "inches",
    )


def _lines(result: Result, sheet: Sheet) -> list[tuple[Floats, Look]]:
    """Draw measurements, known lengths, and lines of known position as they were stated."""
    strips = [strip for some in measured_strips(result).values() for strip in some]
    look = Look(INK["measured"], BOLD if len(strips) <= MANY_LINES else THIN)
    measured = [(sheet(strip), look) for strip in strips]
    reference = reference_strips(result)
    width = BOLD if len(reference) <= MANY_LINES else FINE
    known = [
        (sheet(strip), _known_look(result.lines.status[i], INK[result.lines.status[i]], width))
        for i, strip in reference.items()
    ]
    stated = [
        (sheet(strip), _known_look(status, INK["position"], FINE))
        for strip, status in zip(position_strips(result), result.control_lines.status, strict=True)
    ]
    return measured + known + stated


def _known_look(status: str, colour: str, width: float) -> Look:
    """Return the style of a known line: dashed if it is not used, bold and red if it is wrong."""
    is_bad = status in ("suspect", "removed")
    return Look(
        INK[status] if is_bad else colour,
        BOLD if is_bad else width,
        dashes="" if status == "used" else DASHES,
    )


def _ellipses(result: Result, sheet: Sheet, factor: int) -> list[Floats]:
    within = result.points.relative
    center = result.points.position_world_m[:, :2]
    outlines = ellipse_outlines(center, within.ellipse_95_m, within.ellipse_azimuth_rad, factor)
    return [sheet(outline) for outline in outlines]


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
