"""A plan from its scenario: what it promises is what the simulated survey keeps."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from mission_files import by_plan, by_pymavlink, stations
from plan_draws import errors
from plan_scenes import plan_case
from planned_sample import sample_plan
from scipy.stats import chi2

from uavgram.errors import UavgramError
from uavgram.io.results.command_json import read_plan, write_plan
from uavgram.model.arrays import Floats
from uavgram.model.maps import Mission
from uavgram.model.naming import IMPERIAL
from uavgram.model.planned import FlightPlanned, PlannedLines, PlannedPlates, PlanRequest
from uavgram.stages.products.planned_layers import flight_mission
from uavgram.synthetic.plan.plan import (
    PlanOutputs,
    has_no_site,
    list_remarks,
    make_flown_scenario,
    make_plan,
    plan,
    write_outputs,
)
from uavgram.synthetic.plan.scene import Asked, read_scene
from uavgram.synthetic.plan.survey import predict_values
from uavgram.synthetic.scenario import Scenario
from uavgram.synthetic.scenario_file import format_scenario, load_scenario
from uavgram.synthetic.simulate import predict_sigmas
from uavgram.synthetic.survey import ScenarioWorld
from uavgram.views.flight_plan import corners_on_earth

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


# The files that a plan is handed on as.


PLAN = sample_plan()
FILES = {
    *("field_sheet.html", "mission.plan", "plan.geojson", "plan.json", "plan.kml", "plan.rrd"),
    "scenario.yaml",
}


def written(folder: Path, made: PlanOutputs) -> set[str]:
    return set(write_outputs(PLAN, Scenario(), folder, folder / "asked.yaml", made))


def test_every_file_is_written_and_the_plan_comes_back(tmp_path: Path) -> None:
    assert written(tmp_path, PlanOutputs()) == FILES | {"mission.waypoints"}
    assert {one.name for one in tmp_path.iterdir()} == FILES | {"mission.waypoints"}
    again = read_plan(tmp_path / "plan.json")
    assert again.lines.name == PLAN.lines.name
    assert (again.frames.center_world_m == PLAN.frames.center_world_m).all()


def test_for_px4_no_file_begins_on_the_ground(tmp_path: Path) -> None:
    made = PlanOutputs(autopilot="px4", heights="terrain", units=IMPERIAL)
    assert written(tmp_path, made) == FILES
    mission = json.loads((tmp_path / "mission.plan").read_text(encoding="utf-8"))["mission"]
    assert mission["firmwareType"] == 12
    stops = [item for item in mission["items"] if item["command"] == 16]
    assert {item["frame"] for item in stops} == {10}
    assert min(item["params"][6] for item in stops) > 30
    assert "131 ft above the ground" in (tmp_path / "field_sheet.html").read_text(encoding="utf-8")


def test_without_weasyprint_nothing_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "weasyprint", None)
    with pytest.raises(UavgramError, match=r"field_sheet\.pdf needs WeasyPrint"):
        written(tmp_path, PlanOutputs(pdf="a4"))
    assert not list(tmp_path.iterdir())


# What is remarked of plans.


def laid(count: int) -> PlannedLines:
    lines = PLAN.lines
    return replace(lines, **{name: value[:count] for name, value in vars(lines).items()})


@pytest.mark.parametrize(
    ("lines", "photos", "told"),
    [(0, 1, False), (1, 1, True), (2, 1, True), (3, 1, False), (2, 3, False)],
)
def test_few_lines_in_a_single_photo_are_warned_of(lines: int, photos: int, told: bool) -> None:  # noqa: FBT001
    found = list_remarks((laid(lines), PlannedPlates()), PLAN.measurements, 0.5, photos)
    codes = {message.code for message in found}
    assert ("plan-few-lines" in codes) == told


# configs/plan.yaml: what a user copies names every key of a plan, with its real default.


def test_the_example_names_every_key_with_its_default(repository: Path) -> None:
    path = repository / "configs" / "plan.yaml"
    text, request = path.read_text(), load_scenario(path).plan
    assert request is not None
    for field in fields(PlanRequest):
        assert re.search(rf"^  (# )?{field.name}:", text, re.MULTILINE), field.name
    assert request == replace(
        PlanRequest(area=request.area), wanted=request.wanted, area=request.area
    )


def test_a_scenario_with_a_plan_is_written_as_it_was_read(repository: Path, tmp_path: Path) -> None:
    for name in ("plan.yaml", "demo.yaml"):
        scenario = load_scenario(repository / "configs" / name)
        copy = tmp_path / name
        copy.write_text(format_scenario(scenario))
        assert load_scenario(copy) == scenario


# The mission that an autopilot is given: flown by the simulator, it is as exact as was planned.


YARD_SCENARIO = """
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
    path.write_text(YARD_SCENARIO)
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


# A long strip with few photos: their places decide where lines are of use.


STRIP = """
camera: {drone: DJI Phantom 4 Pro}
telemetry: rtk
plan:
  area: [[-100, -8], [100, -8], [100, 8], [-100, 8]]
  patterns: [strip]
  frames: [4]
  heights_m: [50]
  pitches_deg: [-75]
  lines: 4
  longest_tape_m: 30
  wanted: [{name: whole, points: [[-90, 0], [90, 0]]}]
"""
HERE = "site: {latitude_deg: -33.86, longitude_deg: 151.21}\n"


@pytest.fixture(scope="module")
def strip(tmp_path_factory: pytest.TempPathFactory) -> FlightPlanned:
    path = tmp_path_factory.mktemp("strip") / "strip.yaml"
    path.write_text(STRIP, encoding="utf-8")
    scenario = load_scenario(path)
    return make_plan(scenario, read_scene(scenario, path))


def test_one_more_photo_is_told_with_lines_that_suit_it(strip: FlightPlanned) -> None:
    """With the lines where they are, five photos would be 64 % worse than four."""
    (gain,) = (gain for gain in strip.gains if gain.what.startswith("one more photo"))
    assert "other places for the lines" in gain.what
    assert gain.mean_sigma < 1.2 * strip.mean_sigma


def test_metres_from_a_place_that_nobody_named_are_not_to_be_flown(
    strip: FlightPlanned, tmp_path: Path
) -> None:
    (told,) = (message for message in strip.messages if message.code == "plan-nowhere")
    assert "no mission file was written" in told.text
    assert "site: {latitude_deg: ..., longitude_deg" in told.text
    assert corners_on_earth(strip) == ()
    path = tmp_path / "strip.yaml"
    path.write_text(HERE + STRIP, encoding="utf-8")
    assert not has_no_site(read_scene(load_scenario(path), path))
    assert len(corners_on_earth(replace(strip, messages=()))) == 4
