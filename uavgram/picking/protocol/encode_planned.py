"""What was planned before the flight, as JSON for the page: the lines to lay and tape."""

from __future__ import annotations

from uavgram.model.planned.plan import FlightPlanned
from uavgram.model.units import Units
from uavgram.picking.protocol.encode_places import Json
from uavgram.views.planned.tables import line_rows
from uavgram.views.unit_words import in_units


def planned_json(planned: FlightPlanned | None, units: Units) -> list[Json]:
    """The planned lines in their order: names, labels of their ends, and where these are, in words.

    Lengths are words only: a planned length is no reading of a tape.
    """
    if planned is None:
        return []
    return [
        {
            "name": row.name,
            "start": row.start,
            "end": row.end,
            "length": in_units(row.length, units),
            "start_place": in_units(row.start_place, units),
            "end_place": in_units(row.end_place, units),
        }
        for row in line_rows(planned)
    ]
