"""Plan made before the flight as JSON for the page: lines to tape, plates to put down."""

from __future__ import annotations

from uavgram.model.naming import Units
from uavgram.model.planned import FlightPlanned
from uavgram.model.target_families import PLATE_CORNERS
from uavgram.picking.protocol.encode_places import Json
from uavgram.views.flight_plan import LineRow, PlateRow, line_rows, plate_rows, plate_side
from uavgram.views.sentence_units import convert_sentence

NOT_SOUGHT = (
    "The program does not look for them yet: the project file must say what is printed on them "
    "and how large they are, such as "
    "targets: {{family: aruco-4x4-50, side_m: {side:g}, sigma_m: 0.001}}"
)


def planned_json(planned: FlightPlanned | None, units: Units, *, sought: bool) -> Json:
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


def _line(row: LineRow, units: Units) -> Json:
    return {
        "name": row.name,
        "start": row.start,
        "end": row.end,
        "length": convert_sentence(row.length, units),
        "start_place": convert_sentence(row.start_place, units),
        "end_place": convert_sentence(row.end_place, units),
    }


def _plate(row: PlateRow, side: str, units: Units) -> Json:
    return {
        "name": row.name,
        "side": side,
        "place": convert_sentence(row.place, units),
        "corners": [f"{row.name}-{corner + 1}" for corner in range(PLATE_CORNERS)],
    }
