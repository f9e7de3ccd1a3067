"""Lines and plates to lay out, and the expected accuracy, as rows of tables."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.naming import Units
from uavgram.model.planned import FlightPlanned
from uavgram.views.planned.numbers import centimetres, metres
from uavgram.views.planned.words import WORTH_SAYING
from uavgram.views.units import spread_text, value_text
from uavgram.views.formatting import KIND_WORDS

ROUGHLY = 10.0
"""Rounding of a wanted value, in its standard deviations: it is only approximate."""

ON_THE_SIDE_M = 0.05


@dataclass(frozen=True)
class LineRow:
    """Line to lay out.

    Attributes
    ----------
    name, length, start, end
        As on the drawing.
    start_place, end_place
        How to get there from a corner of the area.
    photos
        Number of photos that show both ends.
    mistake
        The smallest wrong reading that is detected; empty if none is.
    without
        The accuracy if this line is lost; empty if the loss hardly matters.
    is_needed
        Whether the survey has no scale without it.
    """

    name: str
    length: str
    start: str
    end: str
    start_place: str
    end_place: str
    photos: int
    mistake: str
    without: str
    is_needed: bool


@dataclass(frozen=True)
class PlateRow:
    """Plate to lay out: name, way to its middle, number of photos, and as in `LineRow`."""

    name: str
    place: str
    photos: int
    without: str
    is_needed: bool


@dataclass(frozen=True)
class ValueRow:
    """Wanted value.

    Attributes
    ----------
    name, kind, about
        Name, kind and approximate value.
    sigma, wanted
        Expected and required accuracy; the latter is empty if not stated.
    is_good
        Whether the expected accuracy is sufficient; None if no requirement is stated.
    """

    name: str
    kind: str
    about: str
    sigma: str
    wanted: str
    is_good: bool | None


def line_rows(planned: FlightPlanned) -> tuple[LineRow, ...]:
    """Return the rows of all lines in their order."""
    lines, area = planned.lines, planned.area_world_m
    rows = []
    for k, name in enumerate(lines.name):
        mistake, without = float(lines.mdb_m[k]), float(lines.mean_sigma_without[k])
        is_worse = without > WORTH_SAYING * planned.mean_sigma
        rows.append(
            LineRow(
                name=name,
                length=metres(float(lines.length_m[k])),
                start=lines.start_label[k],
                end=lines.end_label[k],
                start_place=place_in_area(area, lines.start_world_m[k]),
                end_place=place_in_area(area, lines.end_world_m[k]),
                photos=round(float(lines.frames_seen[k])),
                mistake=centimetres(mistake) if math.isfinite(mistake) else "",
                without=centimetres(without) if is_worse else "",
                is_needed=math.isnan(without),
            )
        )
    return tuple(rows)


def plate_rows(planned: FlightPlanned) -> tuple[PlateRow, ...]:
    """Return the rows of all plates in their order."""
    plates = planned.plates
    worse = WORTH_SAYING * planned.mean_sigma
    return tuple(
        PlateRow(
            name=name,
            place=place_in_area(planned.area_world_m, middle),
            photos=round(photos),
            without=centimetres(without) if without > worse else "",
            is_needed=math.isnan(without),
        )
        for name, middle, photos, without in zip(
            plates.name,
            plates.center_world_m,
            plates.frames_seen.tolist(),
            plates.mean_sigma_without.tolist(),
            strict=True,
        )
    )


def value_rows(planned: FlightPlanned, units: Units) -> tuple[ValueRow, ...]:
    """Return the rows of all wanted values in their order, in the units of the project."""
    rows = planned.measurements
    made = []
    for k, unit in enumerate(rows.unit):
        sigma, wanted = float(rows.sigma[k]), float(rows.wanted_sigma[k])
        is_asked = math.isfinite(wanted)
        made.append(
            ValueRow(
                name=rows.name[k],
                kind=KIND_WORDS.get(rows.kind[k], rows.kind[k]),
                about=value_text(float(rows.value[k]), ROUGHLY * sigma, unit, units),
                sigma=_spread(sigma, unit, units),
                wanted=_spread(wanted, unit, units) if is_asked else "",
                is_good=sigma <= wanted if is_asked else None,
            )
        )
    return tuple(made)


def _spread(sigma: float, unit: str, units: Units) -> str:
    return centimetres(sigma) if unit == "m" else spread_text(sigma, unit, units)


def place_in_area(area_m: Floats, place_m: Floats) -> str:
    """Describe a place in an area: ``1.7 m from corner 1 towards corner 2, then 1.2 m inwards``.

    It follows the nearest side, from the nearer of its corners.

    Parameters
    ----------
    area_m
        (V, 3) corners, counterclockwise from above.
    place_m
        (3,) the place.
    """
    start, side = area_m[:, :2], (np.roll(area_m, -1, axis=0) - area_m)[:, :2]
    length = np.linalg.norm(side, axis=1)
    along_side = side / length[:, None]
    away = place_m[:2] - start
    # coordinates of the place along each side, and at a right angle to it
    along = np.einsum("vi,vi->v", away, along_side)
    inwards = along_side[:, 0] * away[:, 1] - along_side[:, 1] * away[:, 0]
    beyond = np.maximum(np.maximum(-along, along - length), 0.0)
    # nearest side: distance to the segment, beyond its ends to the corner
    k = int(np.argmin(np.hypot(inwards, beyond)))
    ends = (k + 1, (k + 1) % len(area_m) + 1)
    on_way = float(along[k])
    if on_way > length[k] / 2:
        ends, on_way = ends[::-1], float(length[k]) - on_way
    # beyond the end of the side, the way leads back from the corner
    towards = "towards" if on_way >= 0 else "away from"
    told = f"{metres(abs(on_way))} from corner {ends[0]} {towards} corner {ends[1]}"
    aside = float(inwards[k])
    if abs(aside) < ON_THE_SIDE_M:
        return told
    return f"{told}, then {metres(abs(aside))} {'inwards' if aside > 0 else 'outwards'}"
