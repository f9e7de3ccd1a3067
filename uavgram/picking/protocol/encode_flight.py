"""The flight and the plan made before it as JSON for the page."""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.flight_log import Track
from uavgram.model.naming import PLATE_CORNERS, Units
from uavgram.model.planned import FlightPlanned
from uavgram.picking.protocol import messages as m
from uavgram.pipeline.pick.live_survey import LiveSurvey
from uavgram.views.flight_plan import LineRow, PlateRow, line_rows, plate_rows, plate_side
from uavgram.views.units import convert_sentence

MAX_VERTICES = 300

BEFORE_AND_AFTER = 0.25
"""Time shown before the first and after the last photo, as a share of the time between them."""

MIN_BEFORE_S = 5.0


def flight_json(survey: LiveSurvey) -> m.Flight | None:
    """Return the track around the photos; None without seed poses.

    ``track`` is [UTC time s, east m, north m], empty where the photos state their own places.
    """
    posed = survey.posed
    if posed is None or posed.telemetry is None:
        return None
    track, vertices = posed.telemetry.track, np.zeros((0, 3))
    if isinstance(track, Track):
        vertices = cut_track(track, posed.frames.time_utc_s)
    return {"track": [(t, e, n) for t, e, n in vertices.round(2).tolist()]}


def cut_track(track: Track, time_utc_s: Floats) -> Floats:
    """Return (n, 3) time, east and north of the track while photos were taken, and some time more.

    Parameters
    ----------
    track
        Track of the flight.
    time_utc_s
        (F,) times of the photos, NaN where not known.
    """
    vertices = np.column_stack([track.position_time_s, track.position_world_m[:, :2]])
    known = time_utc_s[np.isfinite(time_utc_s)]
    if len(known):
        more = max(BEFORE_AND_AFTER * float(np.ptp(known)), MIN_BEFORE_S)
        inside = (vertices[:, 0] >= known.min() - more) & (vertices[:, 0] <= known.max() + more)
        vertices = vertices[inside]
    if len(vertices) <= MAX_VERTICES:
        return vertices
    rows = np.linspace(0, len(vertices) - 1, MAX_VERTICES).round().astype(int)
    return np.asarray(vertices[rows])


NOT_SOUGHT = (
    "The program does not look for them yet: the project file must say what is printed on them "
    "and how large they are, such as "
    "targets: {{family: aruco-4x4-50, side_m: {side:g}, sigma_m: 0.001}}"
)


def planned_json(planned: FlightPlanned | None, units: Units, *, sought: bool) -> m.Planned:
    """Return the planned lines and plates in their order: names, labels and places in words.

    Lengths are words only: a planned length is no reading of a tape.

    Parameters
    ----------
    planned
        The plan, if there is one.
    units
        Units of the project.
    sought
        Whether the project file describes the plates to search for.
    """
    if planned is None:
        return {"lines": [], "plates": [], "why": ""}
    side = convert_sentence(plate_side(planned), units)
    plates = plate_rows(planned)
    return {
        "lines": [_line(row, units) for row in line_rows(planned)],
        "plates": [_plate(row, side, units) for row in plates],
        "why": NOT_SOUGHT.format(side=planned.plates.side_m) if plates and not sought else "",
    }


def _line(row: LineRow, units: Units) -> m.PlannedLine:
    return {
        "name": row.name,
        "start": row.start,
        "end": row.end,
        "length": convert_sentence(row.length, units),
        "start_place": convert_sentence(row.start_place, units),
        "end_place": convert_sentence(row.end_place, units),
    }


def _plate(row: PlateRow, side: str, units: Units) -> m.PlannedPlate:
    return {
        "name": row.name,
        "side": side,
        "place": convert_sentence(row.place, units),
        "corners": [f"{row.name}-{corner + 1}" for corner in range(PLATE_CORNERS)],
    }
