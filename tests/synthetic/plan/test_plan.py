"""A plan from its scenario: what it promises is what the simulated survey keeps."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from plan_draws import errors
from plan_scenes import plan_case
from scipy.stats import chi2

from uavgram.io.results.command_json import read_plan, write_plan
from uavgram.model.planned import FlightPlanned
from uavgram.synthetic.inputs import ScenarioWorld
from uavgram.synthetic.plan.make import make_plan
from uavgram.synthetic.plan.run import make_flown_scenario
from uavgram.synthetic.plan.scene import Asked, read_scene
from uavgram.synthetic.plan.survey import predict_values
from uavgram.synthetic.scenario_file import format_scenario, load_scenario
from uavgram.synthetic.simulate import predict_sigmas

SCENARIO = """
name: yard
site: {ground_slope_deg: [5.0, -6.0]}
stated: {position_sigma_m: [0.5, 0.8], attitude_sigma_deg: [1.0, 2.0]}
plan:
  area: [[-14, -10], [14, -10], [14, 10], [-14, 10]]
  no_go: [[[-3, -3], [3, -3], [3, 3], [-3, 3]]]
  wanted:
    - {name: width, points: [P8, [-8, 6]]}
    - {name: yard, kind: area, points: [[-8, -6], [8, -6], [8, 6], [-8, 6]]}
    - {name: way, points: [[-8, -6], [8, 5]], sigma_m: 0.03}
  patterns: [strip]
  heights_m: [40]
  pitches_deg: [-75]
  frames: [3]
  lines: 4
  deviation_m: 0.5
  deviation_deg: 0.5
"""


@pytest.fixture(scope="module")
def asked(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Asked, FlightPlanned]:
    path = tmp_path_factory.mktemp("plan") / "yard.yaml"
    path.write_text(SCENARIO)
    scenario = load_scenario(path)
    found = read_scene(scenario, path)
    return path, found, make_plan(scenario, found)


def test_a_plan_keeps_to_what_was_asked(asked: tuple[Path, Asked, FlightPlanned]) -> None:
    _, _, planned = asked
    assert planned.lines.name == ("L1", "L2", "L3", "L4")
    assert (planned.lines.length_m <= 15.0).all()
    assert len(planned.frames.name) == 3
    np.testing.assert_allclose(planned.frames.height_above_ground_m.mean(), 40.0, atol=1.5)
    assert planned.measurements.name == ("width", "yard", "way")
    assert planned.measurements.unit == ("m", "m2", "m")
    assert np.isfinite(planned.grid.sigma_m).mean() > 0.8
    assert [gain.what for gain in planned.gains][:2] == ["one more line", "one line less"]
    sturdy = next(gain for gain in planned.gains if gain.what.startswith("5 lines laid"))
    assert sturdy.worst_without is not None
    assert sturdy.mean_sigma <= sturdy.worst_without < np.nanmax(planned.lines.mean_sigma_without)
    assert planned.chosen_by == "shares"  # one states what it wants, and another is an area
    assert planned.gains[0].mean_sigma <= planned.mean_sigma <= planned.gains[1].mean_sigma


def test_no_line_crosses_what_is_out_of_bounds(asked: tuple[Path, Asked, FlightPlanned]) -> None:
    _, found, planned = asked
    start, end = planned.lines.start_world_m[:, :2], planned.lines.end_world_m[:, :2]
    share = np.linspace(0, 1, 500)[:, None, None]
    along = (start + share * (end - start)).reshape(-1, 2)
    middle = found.scene.no_go_m[0].mean(axis=0)
    site = found.site
    east = np.deg2rad(90.0 - site.road_azimuth_deg)
    x = (along - middle) @ [np.cos(east), np.sin(east)]
    y = (along - middle) @ [-np.sin(east), np.cos(east)]
    assert (np.maximum(np.abs(x), np.abs(y)) > 3.0 - 1e-9).all()


def test_the_pipeline_predicts_the_same_of_the_flown_plan(
    asked: tuple[Path, Asked, FlightPlanned],
) -> None:
    """The whole run on the simulated survey without noise, by way of a log and its clock."""
    path, found, planned = asked
    as_flown = make_flown_scenario(load_scenario(path), found, planned)
    calm = replace(as_flown.flight, wobble_m=0.0, tilt_wobble_deg=0.0, gimbal_wobble_deg=0.0)
    name, _, sigma = predict_sigmas(ScenarioWorld(replace(as_flown, flight=calm)))
    assert name == planned.measurements.name
    np.testing.assert_allclose(sigma, planned.measurements.sigma, rtol=0.03)


def test_a_flown_plan_is_a_scenario_file(
    asked: tuple[Path, Asked, FlightPlanned], tmp_path: Path
) -> None:
    path, found, planned = asked
    as_flown = make_flown_scenario(load_scenario(path), found, planned)
    copy = tmp_path / "flown.yaml"
    copy.write_text(format_scenario(as_flown, "as planned"))
    assert load_scenario(copy) == as_flown


def test_plan_json_holds_everything(
    asked: tuple[Path, Asked, FlightPlanned], tmp_path: Path
) -> None:
    _, _, planned = asked
    write_plan(planned, tmp_path / "plan.json")
    again = read_plan(tmp_path / "plan.json")
    write_plan(again, tmp_path / "again.json")
    assert (tmp_path / "again.json").read_text() == (tmp_path / "plan.json").read_text()
    np.testing.assert_array_equal(again.lines.mdb_m, planned.lines.mdb_m)
    assert again.measurements.points == planned.measurements.points


@pytest.mark.statistical
@pytest.mark.parametrize(("pattern", "count"), [("single", 60), ("strip", 25)])
def test_errors_are_as_large_as_predicted(pattern: str, count: int) -> None:
    """All priors drawn, the real likelihood minimised: chi-square of each distance."""
    case = plan_case(pattern, 11, lines=4)  # type: ignore[arg-type]
    low, high = case.scene.area_m.min(axis=0), case.scene.area_m.max(axis=0)
    share = np.array([[[0.1, 0.1], [0.4, 0.1]], [[0.6, 0.9], [0.9, 0.8]], [[0.1, 0.9], [0.2, 0.5]]])
    ends = low + share * (high - low)
    flown_case = case.scene, case.cameras, case.wanted
    sigma = predict_values(*flown_case, ends).sigma
    found = errors(flown_case, ends, count, np.random.default_rng(5))
    assert len(found) == count
    # Distances of one survey go together: one of them is judged in each bound.
    square = np.sum((found / sigma) ** 2, axis=0)
    low_bound, high_bound = (float(chi2.ppf(p, count)) for p in (1e-5, 1 - 1e-5))
    assert ((square > low_bound) & (square < high_bound)).all()
