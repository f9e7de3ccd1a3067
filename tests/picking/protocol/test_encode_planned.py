"""The lines of a plan as the page gets them."""

from __future__ import annotations

from planned_sample import sample_plan

from uavgram.model.units import METRIC, Units
from uavgram.picking.protocol.encode_planned import planned_json


def test_a_line_is_told_in_the_units_of_the_project() -> None:
    first = planned_json(sample_plan(), METRIC)[0]
    assert first == {
        "name": "L1",
        "start": "L1a",
        "end": "L1b",
        "length": "14.2 m",
        "start_place": "1.2 m from corner 1 towards corner 2, then 1.2 m inwards",
        "end_place": "15.4 m from corner 1 towards corner 2, then 1.2 m inwards",
    }
    feet = planned_json(sample_plan(), Units(length="ft", speed="mph"))[0]
    assert feet["length"] == "46.6 ft"
    assert feet["start_place"].startswith("3.9 ft from corner 1")


def test_without_a_plan_there_is_none() -> None:
    assert planned_json(None, METRIC) == []
