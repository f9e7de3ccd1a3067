"""The field sheet of a planned flight: self-contained HTML, to be printed in black and white."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.maps import Paper
from uavgram.model.naming import METRIC, Units
from uavgram.model.planned import FlightPlanned
from uavgram.stages.products.planned_layers import grid_cells, wanted_shapes
from uavgram.views.flight_plan import (
    centimetres,
    corners_on_earth,
    describe_accuracy,
    describe_alternatives,
    describe_criterion,
    flight_facts,
    line_rows,
    list_assumptions,
    metres,
    plate_rows,
    plate_side,
    summarise_work,
    take_off_words,
    unchecked_lines,
    value_rows,
)
from uavgram.views.pages import page
from uavgram.views.pages_pdf import PAPER_SIZES, page_pdf
from uavgram.views.sentence_units import convert_sentence, select_like_lengths
from uavgram.views.survey.text_placement import (
    Letters,
    PlacedText,
    TextRequest,
    box,
    place_texts,
    svg_points,
)
from uavgram.views.units import round_bar, table_unit

WIDTH = 900.0
MIN_HEIGHT, MAX_HEIGHT = 420.0, 740.0
"""Limits of the drawing's height, in its own units: a sheet has room for it and for some text."""

MARGIN = 46.0


@dataclass(frozen=True, eq=False)
class SheetMapping:
    """Drawing of a rectangle of ground.

    Attributes
    ----------
    west_m, north_m
        World coordinates of the inner edge of its left and upper margins.
    scale
        Units of the drawing per metre.
    height
        Height of the drawing.
    """

    west_m: float
    north_m: float
    scale: float
    height: float

    @classmethod
    def fit(cls, world_m: Floats) -> SheetMapping:
        """Make the paper on which all (n, 2 or 3) places are seen."""
        low = world_m[:, :2].min(axis=0)
        size = np.maximum(world_m[:, :2].max(axis=0) - low, 1.0)
        scale = float(((np.array([WIDTH, MAX_HEIGHT]) - 2 * MARGIN) / size).min())
        height = max(float(size[1]) * scale + 2 * MARGIN, MIN_HEIGHT)
        spare = ((np.array([WIDTH, height]) - 2 * MARGIN) / scale - size) / 2
        return cls(
            west_m=float(low[0] - spare[0]),
            north_m=float(low[1] + size[1] + spare[1]),
            scale=scale,
            height=height,
        )

    def __call__(self, world_m: Floats) -> Floats:
        """Map (..., 2 or 3) places to (..., 2) x to the right and y downwards."""
        x = MARGIN + (world_m[..., 0] - self.west_m) * self.scale
        return np.stack([x, MARGIN + (self.north_m - world_m[..., 1]) * self.scale], axis=-1)


LIGHTEST, DARKEST = 1.0, 0.66
"""Range of grey as a share of white: names on the darkest can still be read."""

_MIN_STEP_M = 1e-3
_STEPS = 4


@dataclass(frozen=True)
class Shade:
    """Shade of grey, and the range of accuracies that it represents."""

    colour: str
    words: str


@dataclass(frozen=True)
class Shading:
    """Map: SVG points of each cell with its grey, cells that cannot be measured in, legend."""

    cells: tuple[tuple[str, str], ...]
    unseen: tuple[str, ...]
    legend: tuple[Shade, ...]


def shade_cells(planned: FlightPlanned, paper: SheetMapping) -> Shading:
    """Shade the cells: the lighter, the better."""
    grid = planned.grid
    corners = [svg_points(paper(ring)) for ring in grid_cells(planned)]
    known = np.isfinite(grid.sigma_m)
    unseen = tuple(ring for ring, is_known in zip(corners, known, strict=True) if not is_known)
    if not known.any():
        return Shading((), unseen, ())
    edges = class_edges(grid.sigma_m[known])
    count = len(edges) - 1
    greys = [_grey(k / max(count - 1, 1)) for k in range(count)]
    which = np.clip(np.searchsorted(edges, grid.sigma_m, side="right") - 1, 0, count - 1)
    cells = tuple(
        (ring, greys[k]) for ring, k, seen in zip(corners, which, known, strict=True) if seen
    )
    legend = tuple(
        Shade(grey, centimetres(float(low), float(high)))
        for grey, low, high in zip(greys, edges, edges[1:], strict=False)
    )
    return Shading(cells, unseen, legend)


def class_edges(sigma_m: Floats) -> Floats:
    """Choose (c + 1,) round class limits in equal steps that enclose some (n,) accuracies."""
    low, high = float(sigma_m.min()), float(sigma_m.max())
    least = max((high - low) / _STEPS, _MIN_STEP_M)
    # smallest step of the 1-2-5 series that is not below the least step
    power = 10.0 ** np.floor(np.log10(least))
    step = power * min(f for f in (1, 2, 5, 10) if f * power >= least * (1 - 1e-9))
    first = np.floor(low / step + 1e-9)
    last = max(np.ceil(high / step - 1e-9), first + 1)
    return np.asarray(step * np.arange(first, last + 1))


def _grey(share: float) -> str:
    level = round(255 * (LIGHTEST + (DARKEST - LIGHTEST) * share))
    return f"#{level:02x}{level:02x}{level:02x}"


LETTERS = {
    "line": Letters(15.0, is_bold=True, colour="#000"),
    "plate": Letters(15.0, is_bold=True, colour="#000"),
    "corner": Letters(13.0, is_bold=True, colour="#000"),
    "end": Letters(11.0, colour="#000"),
    "wanted": Letters(12.0, colour="#000"),
    "photo": Letters(11.0, colour="#000"),
    "point": Letters(10.0, colour="#000"),
    "bar": Letters(13.0, colour="#000"),
    "north": Letters(14.0, is_bold=True, colour="#000"),
}
"""Letters of each kind of name, in black."""

BAR_ROOM = WIDTH / 5 + 40.0
"""Room of the scale bar at the lower left; the north arrow is at the upper right."""

_REACH = 40.0
"""Largest distance of a name from its object, in heights of a line of text."""

_BESIDE = 8.0
_HALF_TICK, _HALF_PHOTO, _HALF_POINT = 8.0, 9.0, 3.0


def place_names(
    planned: FlightPlanned, paper: SheetMapping, units: Units
) -> tuple[PlacedText, ...]:
    """Place all names, each at the nearest place that is free.

    Parameters
    ----------
    planned
        The plan.
    paper
        Mapping from the world to the drawing.
    units
        Units of lengths.
    """
    wanted = [
        TextRequest(text, kind, paper(at)[None], gap=_BESIDE)
        for kind, text, at in _names(planned, units)
    ]
    sheet = np.zeros(2), np.array([WIDTH, paper.height])
    return place_texts(
        wanted, sheet, _occupied_boxes(planned, paper), letters=LETTERS, reach=_REACH
    )[0]


def _occupied_boxes(planned: FlightPlanned, paper: SheetMapping) -> Floats:
    """Return (n, 5) boxes to keep free of names: reference lines, photos, points, bar and arrow."""
    lines = planned.lines
    starts, ends = paper(lines.start_world_m), paper(lines.end_world_m)
    along = ends - starts
    reach = np.linalg.norm(along, axis=1) / 2 + 2.0
    half, angle = np.full(len(reach), _HALF_TICK), np.arctan2(along[:, 1], along[:, 0])
    marks = (
        (planned.frames.center_world_m, _HALF_PHOTO),
        (planned.plates.center_world_m, _HALF_PHOTO),
        (planned.points.world_m, _HALF_POINT),
    )
    return np.concatenate(
        [
            [box((0.5 * BAR_ROOM, paper.height - 21.0), 0.5 * BAR_ROOM, 21.0)],
            [box((WIDTH - 26.0, 35.0), 26.0, 35.0)],
            np.column_stack([(starts + ends) / 2, reach, half, angle]),
            *(
                np.column_stack([paper(at), np.tile([half_mark, half_mark, 0.0], (len(at), 1))])
                for at, half_mark in marks
            ),
        ]
    )


def _names(planned: FlightPlanned, units: Units) -> Iterator[tuple[str, str, Floats]]:
    lines, measured, points = planned.lines, planned.measurements, planned.points
    middles = (lines.start_world_m + lines.end_world_m) / 2
    for name, length, at in zip(lines.name, lines.length_m, middles, strict=True):
        yield "line", f"{name} {convert_sentence(metres(float(length)), units)}", at
    for name, at in zip(planned.plates.name, planned.plates.center_world_m, strict=True):
        yield "plate", name, at
    for number, at in enumerate(planned.area_world_m, start=1):
        yield "corner", f"corner {number}", at
    ends = np.concatenate([lines.start_world_m, lines.end_world_m])
    for label, at in zip((*lines.start_label, *lines.end_label), ends, strict=True):
        yield "end", label, at
    place = dict(zip(points.label, points.world_m, strict=True))
    for name, labels in zip(measured.name, measured.points, strict=True):
        yield "wanted", name, np.mean([place[label] for label in labels], axis=0)
    frames = planned.frames
    for name, at in zip(frames.name, frames.center_world_m, strict=True):
        yield "photo", name, at
    numbered = {
        f"{name} {k}"
        for name, labels in zip(measured.name, measured.points, strict=True)
        for k in range(1, len(labels) + 1)
    }
    for label, at in zip(points.label, points.world_m, strict=True):
        if label not in numbered:  # else the name of the value contains the label already
            yield "point", label, at


MAX_FOOTPRINTS = 8
"""Largest number of outlined photos: more would hide the ground."""

_TRIANGLE = np.array([[0.0, -11.0], [6.5, 7.0], [0.0, 3.0], [-6.5, 7.0]])
_TICK = 7.0
_MIN_PLATE = 9.0
"""Least half diagonal of a plate on paper."""


@dataclass(frozen=True)
class FieldDrawing:
    """Content of the drawing for the template; texts of points are those of SVG.

    Attributes
    ----------
    width, height
        Size of the drawing.
    shading
        Map of the accuracy.
    area, no_go, footprints
        Rings.
    outlined
        Names of the photos of `footprints`.
    path, photos
        Path of the drone; a triangle at each photo, its tip towards the nose.
    lines, ticks
        Reference lines, and a bar across each of their ends.
    plates
        Squares, drawn large enough to be seen.
    wanted, points
        Planned measurements, and (x, y) of the points between which they are measured.
    names
        Texts that do not overlap.
    bar, bar_text
        Scale bar.
    """

    width: float
    height: float
    shading: Shading
    area: str
    no_go: tuple[str, ...]
    footprints: tuple[str, ...]
    outlined: tuple[str, ...]
    path: str
    photos: tuple[str, ...]
    lines: tuple[str, ...]
    ticks: tuple[str, ...]
    plates: tuple[str, ...]
    wanted: tuple[str, ...]
    points: tuple[tuple[float, float], ...]
    names: tuple[PlacedText, ...]
    bar: float
    bar_text: str


def field_drawing(planned: FlightPlanned, units: Units) -> FieldDrawing:
    """Lay out the drawing: area, flight and lines fill it; photos may extend beyond it."""
    frames, lines, points = planned.frames, planned.lines, planned.points
    shown = np.concatenate(
        [
            *(planned.area_world_m, *planned.no_go_world_m, frames.center_world_m),
            *(lines.start_world_m, lines.end_world_m, points.world_m),
            planned.plates.center_world_m,
        ]
    )
    paper = SheetMapping.fit(shown)
    every = -(-len(frames.name) // MAX_FOOTPRINTS)
    starts, ends = paper(lines.start_world_m), paper(lines.end_world_m)
    bar_m, bar_text = round_bar(WIDTH / 5 / paper.scale, units)
    return FieldDrawing(
        width=WIDTH,
        height=paper.height,
        shading=shade_cells(planned, paper),
        area=svg_points(paper(planned.area_world_m)),
        no_go=tuple(svg_points(paper(ring)) for ring in planned.no_go_world_m),
        footprints=tuple(svg_points(paper(ring)) for ring in frames.footprint_world_m[::every]),
        outlined=frames.name[::every],
        path=svg_points(paper(frames.center_world_m)),
        photos=_triangles(paper(frames.center_world_m), frames.heading_deg),
        lines=tuple(svg_points(np.stack(pair)) for pair in zip(starts, ends, strict=True)),
        ticks=_ticks(starts, ends),
        plates=_plates(paper(planned.plates.corner_world_m)),
        wanted=tuple(svg_points(paper(strip)) for some in wanted_shapes(planned) for strip in some),
        points=tuple((x, y) for x, y in paper(points.world_m).tolist()),
        names=place_names(planned, paper, units),
        bar=bar_m * paper.scale,
        bar_text=bar_text,
    )


def _triangles(places: Floats, heading_deg: Floats) -> tuple[str, ...]:
    angle = np.deg2rad(heading_deg)
    cos, sin = np.cos(angle), np.sin(angle)
    # y goes down in a drawing, so clockwise from north is clockwise from up
    turn = np.stack([np.stack([cos, -sin], -1), np.stack([sin, cos], -1)], axis=1)
    corners = places[:, None] + np.einsum("nij,kj->nki", turn, _TRIANGLE)
    return tuple(svg_points(ring) for ring in corners)


def _plates(corners: Floats) -> tuple[str, ...]:
    middle = corners.mean(axis=1, keepdims=True)
    half = np.linalg.norm(corners - middle, axis=-1, keepdims=True)
    larger = np.maximum(_MIN_PLATE / np.maximum(half, 1e-9), 1.0)
    return tuple(svg_points(ring) for ring in middle + larger * (corners - middle))


def _ticks(starts: Floats, ends: Floats) -> tuple[str, ...]:
    along = ends - starts
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    across *= _TICK / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    places, out = np.concatenate([starts, ends]), np.concatenate([across, across])
    bars = np.stack([places - out, places + out], axis=1)
    return tuple(svg_points(bar) for bar in bars)


NAME = "field_sheet"
"""Name of its files, without their endings."""


def field_sheet(planned: FlightPlanned, units: Units = METRIC) -> str:
    """Render the page of a plan, to be taken along on paper.

    Parameters
    ----------
    planned
        The plan; names written by people are escaped.
    units
        Units in which lengths are shown.
    """
    lengths = planned.lines.length_m
    named = (*planned.lines.name, *planned.measurements.name, *planned.points.label, planned.name)
    return page(
        "field_sheet/page.html",
        planned=planned,
        view=field_drawing(planned, units),
        letters=LETTERS,
        headline=summarise_work(planned),
        outcome=describe_accuracy(planned),
        lines=line_rows(planned),
        plates=plate_rows(planned),
        wanted=value_rows(planned, units),
        facts=flight_facts(planned),
        corners=corners_on_earth(planned),
        unchecked=unchecked_lines(planned),
        lost=describe_alternatives(planned),
        take_off=take_off_words(planned),
        chosen=describe_criterion(planned),
        assumed=list_assumptions(planned),
        plate_side=plate_side(planned),
        longest=metres(math.ceil(lengths.max())) if len(lengths) else "",
        length_of_map=metres(planned.grid.length_m),
        has_log=planned.assumptions.telemetry != "none",
        units=units,
        length_unit=table_unit(units).symbol,
        kept_names=select_like_lengths(named),
    )


def field_sheet_pdf(html: str, paper: Paper) -> bytes:
    """Convert the sheet to PDF; equal pages give equal bytes.

    Parameters
    ----------
    html
        The page from `field_sheet`.
    paper
        Size of the paper.

    Raises
    ------
    UavgramError
        If WeasyPrint, or a library of the system that it needs, is missing.
    """
    sheet = f"@page {{ size: {PAPER_SIZES[paper]} !important; }}"
    digest = hashlib.sha256(html.encode()).digest()
    return page_pdf(html, sheet, NAME, pdf_identifier=digest[:16])
