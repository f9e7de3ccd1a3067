"""Drawing of a plan for paper, in black and white."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.naming import Units
from uavgram.model.planned import FlightPlanned
from uavgram.stages.products.planned_layers import wanted_shapes
from uavgram.views.field_sheet.names import placed_names
from uavgram.views.field_sheet.paper import WIDTH, Paper
from uavgram.views.field_sheet.shades import Shading, shading
from uavgram.views.survey.texts import Text, svg_points
from uavgram.views.units import round_bar

MOST_FOOTPRINTS = 8
"""Largest number of outlined photos: more would hide the ground."""

_TRIANGLE = np.array([[0.0, -11.0], [6.5, 7.0], [0.0, 3.0], [-6.5, 7.0]])
_TICK = 7.0
_LEAST_PLATE = 9.0
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
    names: tuple[Text, ...]
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
    paper = Paper.showing(shown)
    every = -(-len(frames.name) // MOST_FOOTPRINTS)
    starts, ends = paper(lines.start_world_m), paper(lines.end_world_m)
    bar_m, bar_text = round_bar(WIDTH / 5 / paper.scale, units)
    return FieldDrawing(
        width=WIDTH,
        height=paper.height,
        shading=shading(planned, paper),
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
        names=placed_names(planned, paper, units),
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
    larger = np.maximum(_LEAST_PLATE / np.maximum(half, 1e-9), 1.0)
    return tuple(svg_points(ring) for ring in middle + larger * (corners - middle))


def _ticks(starts: Floats, ends: Floats) -> tuple[str, ...]:
    along = ends - starts
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    across *= _TICK / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    places, out = np.concatenate([starts, ends]), np.concatenate([across, across])
    bars = np.stack([places - out, places + out], axis=1)
    return tuple(svg_points(bar) for bar in bars)
