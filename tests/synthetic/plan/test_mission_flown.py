"""The mission that an autopilot is given: flown by the simulator, it is as exact as was planned."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mission_files import by_plan, by_pymavlink, stations

from uavgram.model.arrays import Floats
from uavgram.model.maps import Mission
from uavgram.model.planned import FlightPlanned
from uavgram.stages.products.mission import flight_mission
from uavgram.synthetic.inputs import ScenarioWorld
from uavgram.synthetic.plan.run import plan
from uavgram.synthetic.scenario import Scenario
from uavgram.synthetic.simulate import predict_sigmas

SCENARIO = """
site: {ground_slope_deg: [4.0, -3.0]}
plan:
  area: [[-14, -10], [14, -10], [14, 10], [-14, 10]]
  wanted:
    - {name: width, points: [[-8, -6], [-8, 6]]}
    - {name: way, points: [[-8, -6], [8, 5]]}
  patterns: [strip]
  heights_m: [40]
  pitches_deg: [-75]
  frames: [3]
  lines: 3
  deviation_m: 0.5
  deviation_deg: 0.5
"""


@pytest.fixture(scope="module")
def yard(tmp_path_factory: pytest.TempPathFactory) -> tuple[FlightPlanned, Scenario]:
    path = tmp_path_factory.mktemp("mission") / "yard.yaml"
    path.write_text(SCENARIO)
    return plan(path)


@pytest.mark.parametrize("read_by", [by_pymavlink, by_plan])
def test_a_mission_flown_by_the_simulator_is_as_exact_as_predicted(
    yard: tuple[FlightPlanned, Scenario],
    tmp_path: Path,
    read_by: Callable[[Mission, Path], Floats],
) -> None:
    planned, as_planned = yard
    read = stations(read_by(flight_mission(planned), tmp_path), as_planned.site)
    flight = replace(
        as_planned.flight, poses=read, wobble_m=0.0, tilt_wobble_deg=0.0, gimbal_wobble_deg=0.0
    )

    name, _, sigma = predict_sigmas(ScenarioWorld(replace(as_planned, flight=flight)))
    assert name == planned.measurements.name
    assert planned.chosen_by == "mean"  # two lengths, and nothing stated of either
    np.testing.assert_allclose(sigma, planned.measurements.sigma, rtol=0.03)
    # a mission flown 5 m lower, or looking elsewhere, would not be as exact as that by chance
    for one, other in zip(read, as_planned.flight.poses, strict=True):
        there, planned_there = ((p.x_m, p.y_m, p.height_m) for p in (one, other))
        np.testing.assert_allclose(there, planned_there, atol=0.03)
        turned = (one.heading_deg - other.heading_deg + 180.0) % 360.0 - 180.0
        assert turned == pytest.approx(0.0, abs=1e-3)
        assert one.pitch_deg == pytest.approx(other.pitch_deg, abs=1e-3)
