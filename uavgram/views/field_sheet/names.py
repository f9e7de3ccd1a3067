"""Names in the drawing, none of which covers another."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.naming import Units
from uavgram.model.planned import FlightPlanned
from uavgram.stages.products.text_places import Label, place_labels
from uavgram.views.field_sheet.paper import WIDTH, Paper
from uavgram.views.planned.numbers import metres
from uavgram.views.unit_words import in_units

NameKind = Literal["line", "plate", "corner", "end", "wanted", "photo", "point"]

SIZES: dict[NameKind, float] = {
    "line": 15.0,
    "plate": 15.0,
    "corner": 13.0,
    "end": 11.0,
    "wanted": 12.0,
    "photo": 11.0,
    "point": 10.0,
}
"""Height of the letters."""

BOLD: frozenset[NameKind] = frozenset({"line", "plate", "corner"})

BAR_ROOM = WIDTH / 5 + 40.0
"""What the scale bar takes at the lower left; the arrow to the north is at the upper right."""

_REACH = 40.0
"""Names may be so far from what they name, in heights of a line of text."""

_HALF_LETTER, _HALF_LINE, _BESIDE = 0.31, 0.62, 8.0
_HALF_TICK, _HALF_PHOTO, _HALF_POINT = 8.0, 9.0, 3.0


@dataclass(frozen=True)
class Name:
    """A text with its middle at (x, y), and the white plate under it."""

    x: float
    y: float
    text: str
    size: float
    is_bold: bool
    half_width: float
    half_height: float


def placed_names(planned: FlightPlanned, paper: Paper, units: Units) -> tuple[Name, ...]:
    """All names, those that are needed most first: each at the nearest place that is free.

    Parameters
    ----------
    planned
        The plan.
    paper
        From the world to the drawing.
    units
        Of the lengths that are told.
    """
    names = list(_names(planned, units))
    labels = [
        Label(
            anchor := paper(at),
            anchor,
            np.array([_HALF_LETTER * SIZES[kind] * len(text) + 2.0, _HALF_LINE * SIZES[kind]]),
            _BESIDE,
        )
        for kind, text, at in names
    ]
    sheet = np.zeros(2), np.array([WIDTH, paper.height])
    boxes, size = place_labels(labels, _taken(planned, paper), sheet, reach=_REACH)
    return tuple(
        Name(x, y, text, size * SIZES[kind], kind in BOLD, half_width, half_height)
        for (kind, text, _), (x, y, half_width, half_height, _) in zip(
            names, boxes.tolist(), strict=True
        )
    )


def _taken(planned: FlightPlanned, paper: Paper) -> Floats:
    """(n, 5) what is drawn and must be seen: reference lines, photos, points, bar and arrow."""
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
            [[0.5 * BAR_ROOM, paper.height - 21.0, 0.5 * BAR_ROOM, 21.0, 0.0]],
            [[WIDTH - 26.0, 35.0, 26.0, 35.0, 0.0]],
            np.column_stack([(starts + ends) / 2, reach, half, angle]),
            *(
                np.column_stack([paper(at), np.tile([half_mark, half_mark, 0.0], (len(at), 1))])
                for at, half_mark in marks
            ),
        ]
    )


def _names(planned: FlightPlanned, units: Units) -> Iterator[tuple[NameKind, str, Floats]]:
    lines, measured, points = planned.lines, planned.measurements, planned.points
    middles = (lines.start_world_m + lines.end_world_m) / 2
    for name, length, at in zip(lines.name, lines.length_m, middles, strict=True):
        yield "line", f"{name} {in_units(metres(float(length)), units)}", at
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
        if label not in numbered:  # the name of the value says it already
            yield "point", label, at
