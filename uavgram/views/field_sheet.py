"""The field sheet of a planned flight: self-contained HTML, to be printed in black and white."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.maps import Paper
from uavgram.model.naming import METRIC, Units, round_up
from uavgram.model.planned import FlightPlanned
from uavgram.stages.products.planned_layers import grid_cells, wanted_strips
from uavgram.views import flight_plan
from uavgram.views.pages import PAPER_SIZES, page, page_pdf
from uavgram.views.survey.drawing import HATCH, PAPER, Drawing, Look
from uavgram.views.survey.sheet import Sheet, lay_sheet
from uavgram.views.survey.text_placement import Letters, TextRequest, box
from uavgram.views.units import convert_sentence, round_bar, select_like_lengths, table_unit

WIDTH = 900.0
MIN_HEIGHT, MAX_HEIGHT = 420.0, 740.0
"""Limits of the drawing's height, in its own units: a sheet has room for it and for some text."""

MARGIN = 46.0

LIGHTEST, DARKEST = 1.0, 0.66
"""Range of grey as a share of white: names on the darkest can still be read."""

_MIN_STEP_M = 1e-3
_STEPS = 4


@dataclass(frozen=True)
class Shade:
    """Shade of grey, and the range of accuracies that it represents."""

    colour: str
    words: str


def _shade_cells(planned: FlightPlanned, drawing: Drawing, paper: Sheet) -> tuple[Shade, ...]:
    """Shade the cells: the lighter, the better; cross out those that cannot be measured in."""
    grid, area = planned.grid, paper(planned.area_world_m)
    rings = paper(grid_cells(planned))
    known = np.isfinite(grid.sigma_m)
    crosses = rings[~known][:, [0, 2, 1, 3]].reshape(-1, 2, 2)
    shades: tuple[Shade, ...] = ()
    if known.any():
        edges = class_edges(grid.sigma_m[known])
        count = len(edges) - 1
        shades = tuple(
            Shade(_grey(k / max(count - 1, 1)), flight_plan.centimetres(float(low), float(high)))
            for k, (low, high) in enumerate(pairwise(edges))
        )
        which = np.clip(np.searchsorted(edges, grid.sigma_m, side="right") - 1, 0, count - 1)
        for k, shade in enumerate(shades):
            look = Look(shade.colour, 0.4, fill=shade.colour)
            cells = rings[known & (which == k)]
            drawing.lines("cells", cells, look, closed=True, clip=area)
    drawing.lines("unseen", crosses, Look("#999", 0.6), clip=area)
    return shades


def class_edges(sigma_m: Floats) -> Floats:
    """Choose (c + 1,) round class limits in equal steps that enclose some (n,) accuracies."""
    low, high = float(sigma_m.min()), float(sigma_m.max())
    step = round_up(max((high - low) / _STEPS, _MIN_STEP_M))
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
    "scale": Letters(13.0, colour="#000"),
}
"""Letters of each kind of name, in black."""

_REACH = 40.0
"""Largest distance of a name from its object, in heights of a line of text."""

_BESIDE = 8.0
_HALF_TICK, _HALF_PHOTO, _HALF_POINT = 8.0, 9.0, 3.0


def _names(planned: FlightPlanned, units: Units) -> Iterator[tuple[str, str, Floats]]:
    lines, measured, points = planned.lines, planned.measurements, planned.points
    middles = (lines.start_world_m + lines.end_world_m) / 2
    for name, length, at in zip(lines.name, lines.length_m, middles, strict=True):
        yield "line", f"{name} {convert_sentence(flight_plan.metres(float(length)), units)}", at
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


class FieldDrawing(NamedTuple):
    """Drawing, shades of grey of its map, and names of the photos whose footprints are shown."""

    drawing: Drawing
    shades: tuple[Shade, ...]
    outlined: tuple[str, ...]


def field_drawing(planned: FlightPlanned, units: Units) -> FieldDrawing:
    """Lay out the drawing: area, flight and lines fill it; photos may extend beyond it."""
    frames, lines, points = planned.frames, planned.lines, planned.points
    shown = np.concatenate(
        [
            *(planned.area_world_m, *planned.no_go_world_m, frames.center_world_m),
            *(lines.start_world_m, lines.end_world_m, points.world_m),
            planned.plates.center_world_m,
        ]
    )[:, :2]
    low, high = shown.min(axis=0), shown.max(axis=0)
    paper = lay_sheet(low, high, MAX_HEIGHT, width=WIDTH, least_height=MIN_HEIGHT, margin=MARGIN)
    drawing = Drawing(
        "The area from above, to scale: lines to lay, photos to take, accuracy to expect",
        WIDTH, paper.height, letters=LETTERS,
    )  # fmt: skip
    every = -(-len(frames.name) // MAX_FOOTPRINTS)
    shades = _shade_cells(planned, drawing, paper)
    whole = np.array([[0, 0], [WIDTH, 0], [WIDTH, paper.height], [0, paper.height]])
    footprints = [paper(ring) for ring in frames.footprint_world_m[::every]]
    strips = np.stack([paper(lines.start_world_m), paper(lines.end_world_m)], axis=1)
    photos, dots = paper(frames.center_world_m), paper(points.world_m)
    drawing.lines(
        "footprints", footprints, Look("#666", 0.8, dashes="1.5 4"), closed=True, clip=whole
    )
    drawing.lines("area", [paper(planned.area_world_m)], Look("#000", 1.6), closed=True)
    rings = [paper(ring) for ring in planned.no_go_world_m]
    drawing.lines("no_go", rings, Look(fill=PAPER), Look("#000", 2.2, fill=HATCH), closed=True)
    drawing.lines("path", [photos], Look("#333", 1.1, dashes="8 4"))
    wanted = [paper(strip) for strip in wanted_strips(planned).values()]
    drawing.lines("wanted", wanted, Look("#000", 1.3))
    drawing.signs("points", dots, 2.6, Look("#000", 1.2, fill=PAPER))
    drawing.lines("lines", strips, Look(PAPER, 8.0), Look("#000", 4.2))
    plates = _plates(paper(planned.plates.corner_world_m))
    drawing.lines("plates", plates, Look(PAPER, 2.0, fill="#000"), closed=True)
    drawing.lines("ticks", _ticks(strips), Look("#000", 3.0))
    triangles = _triangles(photos, frames.heading_deg)
    drawing.lines("photos", triangles, Look("#000", 1.2, fill=PAPER), closed=True)
    bar_m, bar_text = round_bar(WIDTH / 5 / paper.scale, units)
    drawing.scale_bar(22.0, paper.height - 24.0, bar_m * paper.scale, bar_text, patch=0.85)
    drawing.compass(patch=0.85)
    along = strips[:, 1] - strips[:, 0]
    reach, angle = np.linalg.norm(along, axis=1) / 2 + 2.0, np.arctan2(along[:, 1], along[:, 0])
    half = np.full(len(reach), _HALF_TICK)
    drawing.reserve(np.column_stack([strips.mean(axis=1), reach, half, angle]))
    for places, half_sign in (
        (photos, _HALF_PHOTO),
        (paper(planned.plates.center_world_m), _HALF_PHOTO),
        (dots, _HALF_POINT),
    ):
        drawing.reserve([box(at, half_sign, half_sign) for at in places])
    drawing.place(
        [
            TextRequest(text, kind, paper(at)[None], gap=_BESIDE)
            for kind, text, at in _names(planned, units)
        ],
        reach=_REACH,
    )
    return FieldDrawing(drawing, shades, frames.name[::every])


def _triangles(places: Floats, heading_deg: Floats) -> Floats:
    angle = np.deg2rad(heading_deg)
    cos, sin = np.cos(angle), np.sin(angle)
    # y goes down in a drawing, so clockwise from north is clockwise from up
    turn = np.stack([np.stack([cos, -sin], -1), np.stack([sin, cos], -1)], axis=1)
    return np.asarray(places[:, None] + np.einsum("nij,kj->nki", turn, _TRIANGLE))


def _plates(corners: Floats) -> Floats:
    middle = corners.mean(axis=1, keepdims=True)
    half = np.linalg.norm(corners - middle, axis=-1, keepdims=True)
    larger = np.maximum(_MIN_PLATE / np.maximum(half, 1e-9), 1.0)
    return np.asarray(middle + larger * (corners - middle))


def _ticks(strips: Floats) -> Floats:
    """Return a bar across each end of the (n, 2, 2) lines, (2n, 2, 2)."""
    along = strips[:, 1] - strips[:, 0]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    across *= _TICK / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    out = across[:, None, None] * np.array([-1.0, 1.0])[:, None]
    return np.asarray(strips[:, :, None] + out).reshape(-1, 2, 2)


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
    lengths, unit = planned.lines.length_m, table_unit(units).symbol
    named = (*planned.lines.name, *planned.measurements.name, *planned.points.label, planned.name)
    return page(
        "field_sheet/page.html",
        planned=planned,
        view=field_drawing(planned, units),
        headline=flight_plan.summarise_work(planned),
        outcome=flight_plan.describe_accuracy(planned),
        lines=planned.lines.name,
        plates=planned.plates.name,
        laid=flight_plan.lay_table(planned, "lies" if planned.plates.name else f"you read, {unit}"),
        wanted=flight_plan.value_table(planned, units),
        facts=flight_plan.flight_facts(planned),
        corners=flight_plan.corners_on_earth(planned),
        unchecked=flight_plan.find_unchecked_lines(planned),
        lost=flight_plan.describe_alternatives(planned),
        take_off=flight_plan.take_off_words(planned),
        chosen=flight_plan.describe_criterion(planned),
        assumed=flight_plan.list_assumptions(planned),
        plate_side=flight_plan.plate_side(planned),
        longest=flight_plan.metres(math.ceil(lengths.max())) if len(lengths) else "",
        length_of_map=flight_plan.metres(planned.grid.length_m),
        has_log=planned.assumptions.telemetry != "none",
        units=units,
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
