"""configs/demo.yaml is the built-in survey, written out for people to copy."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import pytest

from uavgram.errors import InputError
from uavgram.synthetic.scenario import Scenario
from uavgram.synthetic.scenario_file import load_repeated, load_scenario


def test_the_file_that_people_copy_is_the_built_in_survey(repository: Path) -> None:
    assert load_scenario(repository / "configs" / "demo.yaml") == Scenario()


def test_every_number_of_the_built_in_survey_is_written_in_the_file(repository: Path) -> None:
    text = (repository / "configs" / "demo.yaml").read_text(encoding="utf-8")
    for group in (*("site", "ground", "camera", "flight", "errors", "stated", "habits", "road"),):
        for name in vars(getattr(Scenario(), group)):
            assert f"  {name}:" in text, name
    for name in vars(Scenario()).keys() - {"plan"}:  # of which configs/plan.yaml tells
        assert f"\n{name}:" in text, name


def test_a_class_of_telemetry_fills_what_is_not_written(tmp_path: Path) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_text("telemetry: rtk\nerrors:\n  position_bias_m: [0.5, 0.6]\n", encoding="utf-8")
    read, usual = load_scenario(path), Scenario()
    assert read.errors.position_bias_m == (0.5, 0.6)
    assert read.errors.position_drift_m < usual.errors.position_drift_m
    assert read.stated.position_bias_sigma_m < usual.stated.position_bias_sigma_m
    assert read.errors.attitude_deg == usual.errors.attitude_deg


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("telemetry: gps\n", "telemetry"),
        ("flight:\n  pattern: poses\n", "poses"),
        ("habits:\n  raised: [{label: Z9, height_m: 1.0}]\n", "Z9"),
        ("habits:\n  wrong_lengths: [{name: Z9, by_m: 1.0}]\n", "Z9"),
        ("ground:\n  shape: hill\n", "shape"),
        ("errors:\n  readout_ms: fast\n", "readout_ms"),
        ("camera:\n  file: a.yaml\n  drone: DJI Mini\n", "give one of the two"),
        ("points: [{label: A, x_m: 0, y_m: 0}]\n", "lines and measurements are the demo's"),
        ("road: {debris: [[0, 0], [1, 1]]}\n", "debris must name four corners, or none"),
        ("lines: [{name: L1, start: R1, end: R1}]\n", "'L1' must go from one point to another"),
        (
            "lines: [{name: L, start: R1, end: R2}, {name: L, start: R3, end: R4}]\n",
            "lines: names given twice: L",
        ),
        ("flight: {start_utc: yesterday}\n", "start_utc must be such as 2026-"),
        ("camera: {parameters: [0, 1, 0, 0, 0, 0, 0, 0, 0]}\n", "fx and fy must be greater"),
        ("errors: {lost_exposure: 14}\n", "must lie between 0 and 13, or be null"),
    ],
)
def test_what_a_scenario_cannot_be_is_refused_in_words(
    tmp_path: Path, text: str, named: str
) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=named):
        load_scenario(path)


def test_shorter_flights_than_the_demos_lose_no_photo_that_they_do_not_have(
    tmp_path: Path,
) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_text("flight: {photos_per_strip: 3}\nerrors: {pick_px: 0.5}\n", encoding="utf-8")
    short = load_scenario(path)
    assert short.lost_exposure is None
    assert short.errors.pick_px == 0.5
    path.write_text("flight: {photos_per_strip: 6}\n", encoding="utf-8")
    assert load_scenario(path).lost_exposure == Scenario().lost_exposure == 9


def test_of_a_road_only_what_differs_is_written(tmp_path: Path) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_text("road: {vehicles: [], debris: []}\n", encoding="utf-8")
    road = load_scenario(path).road
    assert (road.vehicles, road.debris, road.width_m) == ((), (), 7.0)


def test_a_wrong_value_is_named_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_text("name: mine\nflight:\n  height_m: -3.0\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"scenario.yaml:[23]: .*height_m"):
        load_scenario(path)


def test_an_unknown_key_is_named_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_text("name: mine\nflight:\n  hight_m: 30.0\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"scenario.yaml:3: .*hight_m"):
        load_scenario(path)


MANY = 100_000
LISTS = {
    "points": "points: [{item}]",
    "lines": "lines: [{item}]",
    "measurements": "measurements: [{item}]",
    "control": "control: [{item}]",
    "points of a measurement": "measurements: [{{name: a, kind: area, points: [{item}]}}]",
    "parameters": "camera: {{parameters: [{item}]}}",
    "poses": "flight: {{pattern: poses, poses: [{item}]}}",
    "plates": "plates: {{at: [{item}]}}",
    "raised": "habits: {{raised: [{item}]}}",
    "debris": "road: {{debris: [{item}]}}",
    "a skid mark": "road: {{skid_marks: [[{item}]]}}",
    "area": "plan: {{area: [{item}]}}",
    "no go": "plan: {{area: [[0, 0], [9, 0], [9, 9]], no_go: [[{item}]]}}",
    "wanted": "plan: {{area: [[0, 0], [9, 0], [9, 9]], wanted: [{item}]}}",
    "heights": "plan: {{area: [[0, 0], [9, 0], [9, 9]], heights_m: [{item}]}}",
}


@pytest.mark.parametrize("text", LISTS.values(), ids=LISTS)
@pytest.mark.parametrize("load", [load_scenario, load_repeated])
def test_a_list_without_end_is_refused_at_once_with_its_line_and_the_limit(
    tmp_path: Path, load: Callable[[Path], object], text: str
) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_text("name: a\n" + text.format(item=", ".join(["1"] * MANY)), encoding="utf-8")
    began = time.process_time()
    with pytest.raises(InputError, match=r"yaml:2: more than 2000 items in its lists.*shorten"):
        load(path)
    assert time.process_time() - began < 5.0  # reading all of it took 23 s


def test_many_short_lists_are_as_many_items_as_a_long_one(tmp_path: Path) -> None:
    path = tmp_path / "scenario.yaml"
    marks = ", ".join(["[[0, 0], [1, 1]]"] * 300)
    path.write_text(f"road: {{skid_marks: [{marks}]}}", encoding="utf-8")
    with pytest.raises(InputError, match="more than 2000 items"):
        load_scenario(path)


@pytest.mark.parametrize("name", ["heights_m", "pitches_deg", "frames", "patterns"])
def test_choices_of_a_plan_are_few_as_each_is_flown_with_each_other(
    tmp_path: Path, name: str
) -> None:
    one = {"heights_m": "20", "pitches_deg": "-60", "frames": "3", "patterns": "single"}[name]
    path = tmp_path / "scenario.yaml"
    text = "plan: {{area: [[0, 0], [9, 0], [9, 9]], {}: [{}]}}"
    path.write_text(text.format(name, ", ".join([one] * 30)), encoding="utf-8")
    assert load_scenario(path).plan is not None
    path.write_text(text.format(name, ", ".join([one] * 31)), encoding="utf-8")
    with pytest.raises(InputError, match=rf"yaml:1: .*{name} may name at most 30 \(got 31\)"):
        load_scenario(path)
