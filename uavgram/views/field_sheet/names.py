"""Names in the drawing, placed without overlaps."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.naming import Units
from uavgram.model.planned import FlightPlanned
from uavgram.views.field_sheet.paper import WIDTH, Paper
from uavgram.views.planned.numbers import metres
from uavgram.views.survey.texts import Letters, Text, Wanted, box, placed_texts
from uavgram.views.unit_words import in_units

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


def placed_names(planned: FlightPlanned, paper: Paper, units: Units) -> tuple[Text, ...]:
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
        Wanted(text, kind, paper(at)[None], gap=_BESIDE)
        for kind, text, at in _names(planned, units)
    ]
    sheet = np.zeros(2), np.array([WIDTH, paper.height])
    return placed_texts(wanted, sheet, _taken(planned, paper), letters=LETTERS, reach=_REACH)[0]


def _taken(planned: FlightPlanned, paper: Paper) -> Floats:
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
        if label not in numbered:  # else the name of the value contains the label already
            yield "point", label, at
