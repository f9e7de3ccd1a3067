"""The mission for DJI drones, read back by its documented columns."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from planned_sample import HEIGHT_M, PITCH_DEG, in_metres, sample_plan

from uavgram.io.exports.mission_litchi import litchi_text
from uavgram.model.maps.mission import HeightFrame
from uavgram.stages.products.mission import flight_mission

PLAN = sample_plan()


def rows_of(height_frame: HeightFrame = "relative") -> list[dict[str, str]]:
    mission = flight_mission(PLAN, height_frame=height_frame)
    table = csv.DictReader(litchi_text(mission).splitlines())
    assert table.fieldnames is not None
    assert len(table.fieldnames) == len(set(table.fieldnames)) == 8 + 2 * 15 + 2 + 4 + 2
    return list(table)


def test_stops_are_where_the_photos_are() -> None:
    rows = rows_of()
    place = in_metres([[float(row["longitude"]), float(row["latitude"])] for row in rows])
    np.testing.assert_allclose(place, PLAN.frames.center_world_m[:, :2], atol=0.002, rtol=0)
    assert [float(row["altitude(m)"]) for row in rows] == pytest.approx([HEIGHT_M] * 6)


def test_at_each_stop_it_turns_tilts_waits_and_takes_one_photo() -> None:
    for row, heading in zip(rows_of(), PLAN.frames.heading_deg, strict=True):
        done = [(int(row[f"actiontype{k}"]), float(row[f"actionparam{k}"])) for k in range(1, 16)]
        # rotate aircraft, tilt camera, stay for [ms], take photo
        stay_ms = 1000 * PLAN.flight.seconds_per_photo
        assert done[:4] == [(4, round(heading)), (5, PITCH_DEG), (0, stay_ms), (1, 0)]
        assert {action for action, _ in done[4:]} == {-1}
        assert row["photo_timeinterval"] == row["photo_distinterval"] == "-1"


def test_what_heights_count_from_is_said() -> None:
    assert {row["altitudemode"] for row in rows_of()} == {"0"}
    assert {row["altitudemode"] for row in rows_of("terrain")} == {"1"}
