"""Plates in place of lines: what a plan of them promises is what the simulated survey keeps."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from plan_scenes import plan_case

from uavgram.io.results.command_json import read_plan, write_plan
from uavgram.model.naming import Units
from uavgram.model.planned import FlightPlanned
from uavgram.synthetic.plan.accuracy import list_ends
from uavgram.synthetic.plan.flights import VisiblePoints, remove_small_plates
from uavgram.synthetic.plan.layouts import find_best_layout
from uavgram.synthetic.plan.plan import plan
from uavgram.synthetic.plan.survey import compute_possible, predict_values
from uavgram.synthetic.scenario import PlateSpec, Scenario
from uavgram.synthetic.scenario_file import format_scenario, load_scenario
from uavgram.synthetic.simulate import predict_sigmas
from uavgram.synthetic.survey import ScenarioWorld
from uavgram.views.field_sheet import field_sheet
from uavgram.views.flight_plan_text import plan_lines

SCENARIO = """
name: yard
site: {ground_slope_deg: [5.0, -6.0]}
stated: {position_sigma_m: [0.5, 0.8], attitude_sigma_deg: [1.0, 2.0]}
plates: {side_m: 0.7, corner_px: 0.15}
plan:
  area: [[-14, -10], [14, -10], [14, 10], [-14, 10]]
  no_go: [[[-3, -3], [3, -3], [3, 3], [-3, 3]]]
  wanted:
    - {name: width, points: [[-8, -6], [-8, 6]]}
    - {name: way, points: [[-8, -6], [8, 5]], sigma_m: 0.1}
  patterns: [strip]
  heights_m: [40]
  pitches_deg: [-75]
  frames: [3]
  lay: either
  lines: 3
  deviation_m: 0.5
  deviation_deg: 0.5
"""


@pytest.fixture(scope="module")
def yard(tmp_path_factory: pytest.TempPathFactory) -> tuple[FlightPlanned, Scenario]:
    path = tmp_path_factory.mktemp("plates") / "yard.yaml"
    path.write_text(SCENARIO)
    return plan(path)


@pytest.mark.parametrize("pattern", ["single", "strip"])
@pytest.mark.parametrize(("roughness_m", "corner_px"), [(0.0, 0.1), (0.05, 0.1), (0.0, 0.005)])
def test_the_criterion_is_the_mean_sigma_of_the_real_likelihood(
    pattern: str, roughness_m: float, corner_px: float
) -> None:
    case = plan_case(pattern, 7, roughness_m=roughness_m, lines=3)  # type: ignore[arg-type]
    scene = replace(case.scene, plates=PlateSpec(side_m=0.6, corner_px=corner_px))
    found = compute_possible(scene, case.cameras, case.wanted, None, most_spots=40)
    layout = find_best_layout(found.aim, found.candidates, 3)
    real = predict_values(scene, case.cameras, case.wanted, list_ends(found, layout.lines))
    assert layout.criterion == pytest.approx(real.sigma.mean(), rel=1e-5)


def test_plates_are_laid_whole_and_clear_of_what_is_out_of_bounds(
    yard: tuple[FlightPlanned, Scenario],
) -> None:
    planned, _ = yard
    assert planned.plates.name == ("T0", "T1", "T2")
    assert not planned.lines.name
    assert (planned.plates.frames_seen >= 1).all()
    corner = planned.plates.corner_world_m
    sides = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=-1)
    np.testing.assert_allclose(sides, 0.7)
    no_go = planned.no_go_world_m[0].mean(axis=0)
    assert (np.linalg.norm((corner - no_go)[..., :2], axis=-1) > 3.0).all()
    assert "3 lines in place of these plates" in {gain.what for gain in planned.gains}


def test_plates_count_from_sixteen_pixels_on() -> None:
    """Of 800 px focal length from 40 m: 0.79 m are 15.8 px, 0.81 m 16.2 px."""
    for side, is_found in ((0.79, False), (0.81, True)):
        half = 0.5 * side * 800.0 / 40.0
        square = 500.0 + half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        pixel = np.concatenate([np.zeros((1, 2)), square, square])[None]
        sure = np.ones((1, 9), dtype=np.bool_)
        found = remove_small_plates(VisiblePoints(pixel, sure), 1)
        assert found.certain.tolist() == [[True] + 8 * [is_found]]


def test_the_pipeline_predicts_the_same_of_the_flown_plan(
    yard: tuple[FlightPlanned, Scenario],
) -> None:
    planned, as_flown = yard
    calm = replace(as_flown.flight, wobble_m=0.0, tilt_wobble_deg=0.0, gimbal_wobble_deg=0.0)
    name, _, sigma = predict_sigmas(ScenarioWorld(replace(as_flown, flight=calm)))
    assert name == planned.measurements.name
    np.testing.assert_allclose(sigma, planned.measurements.sigma, rtol=0.03)


def test_a_plan_of_plates_is_written_and_told(
    yard: tuple[FlightPlanned, Scenario], tmp_path: Path
) -> None:
    planned, as_flown = yard
    write_plan(planned, tmp_path / "plan.json")
    again = read_plan(tmp_path / "plan.json")
    np.testing.assert_array_equal(again.plates.corner_world_m, planned.plates.corner_world_m)
    (tmp_path / "flown.yaml").write_text(format_scenario(as_flown, "as planned"))
    assert load_scenario(tmp_path / "flown.yaml") == as_flown
    in_feet = field_sheet(planned, Units(length="ft", speed="mph"))
    assert "Lay 3 plates of 2.30 ft" in in_feet
    for told in (field_sheet(planned), "\n".join(plan_lines(planned))):
        assert "Lay 3 plates of 70 cm, then take 3 photos" in told
        assert "T2" in told
