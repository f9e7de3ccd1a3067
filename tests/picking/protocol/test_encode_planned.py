"""The lines and plates of a plan as the page gets them."""

from __future__ import annotations

from dataclasses import replace

from planned_sample import sample_plan, sample_plates

from uavgram.model.naming import METRIC, Units
from uavgram.picking.protocol.encode_flight import planned_json

FEET = Units(length="ft", speed="mph")


def test_a_line_is_told_in_the_units_of_the_project() -> None:
    first = planned_json(sample_plan(), METRIC, sought=False)["lines"][0]
    assert first == {
        "name": "L1",
        "start": "L1a",
        "end": "L1b",
        "length": "14.2 m",
        "start_place": "1.2 m from corner 1 towards corner 2, then 1.2 m inwards",
        "end_place": "15.4 m from corner 1 towards corner 2, then 1.2 m inwards",
    }
    feet = planned_json(sample_plan(), FEET, sought=False)["lines"][0]
    assert feet["length"] == "46.6 ft"
    assert feet["start_place"].startswith("3.9 ft from corner 1")


def test_without_a_plan_there_is_none() -> None:
    assert not any(planned_json(None, METRIC, sought=False).values())
    assert planned_json(sample_plan(), METRIC, sought=False)["why"] == ""


def test_plates_are_told_with_what_the_project_lacks_to_look_for_them() -> None:
    plates = sample_plates()
    found = planned_json(replace(sample_plan(), plates=plates), FEET, sought=False)
    assert found["plates"][1] == {
        "name": "T1",
        "side": "2.30 ft",
        "place": "16 ft from corner 3 towards corner 2, then 6.6 ft inwards",
        "corners": ["T1-1", "T1-2", "T1-3", "T1-4"],
    }
    assert "targets: {family: aruco-4x4-50, side_m: 0.7," in found["why"]
    assert planned_json(replace(sample_plan(), plates=plates), METRIC, sought=True)["why"] == ""
