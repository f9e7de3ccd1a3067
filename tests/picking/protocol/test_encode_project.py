"""The flight's track, and the lines and plates of its plan, as the page gets them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from planned_sample import sample_plan, sample_plates

from uavgram.model.arrays import Floats
from uavgram.model.flight_log import Track
from uavgram.model.naming import METRIC, Units
from uavgram.picking.protocol.encode_project import MAX_VERTICES, cut_track, planned_json


def track(time_s: Floats) -> Track:
    """Ten metres a second to the east."""
    none = np.zeros(0)
    return Track(
        position_time_s=time_s,
        position_world_m=np.stack([10.0 * time_s, 0.0 * time_s, 50.0 + 0.0 * time_s], axis=1),
        attitude_time_s=none,
        world_from_body_xyzw=np.zeros((0, 4)),
        gimbal_time_s=none,
        world_from_gimbal_xyzw=np.zeros((0, 4)),
        sigma_time_s=np.zeros(1),
        sigma_position_m=np.ones((1, 2)),
        sigma_attitude_rad=np.ones((1, 2)),
        source="none",
    )


@pytest.mark.parametrize(
    ("photos_s", "first_s", "last_s"),
    [([200.0, np.nan, 300.0], 175.0, 325.0), ([200.0], 195.0, 205.0), ([np.nan], 0.0, 1000.0)],
)
def test_it_goes_a_little_beyond_the_photos(
    photos_s: list[float], first_s: float, last_s: float
) -> None:
    vertices = cut_track(track(np.arange(0.0, 1000.5, 0.5)), np.array(photos_s))

    assert vertices[0, 0] == first_s
    assert vertices[-1, 0] == last_s
    assert len(vertices) <= MAX_VERTICES
    np.testing.assert_array_equal(vertices[:, 1], 10.0 * vertices[:, 0])


# The lines and plates of a plan as the page gets them.


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
