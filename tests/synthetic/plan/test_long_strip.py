"""A long strip with few photos: their places decide where lines are of use."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from uavgram.model.planned import FlightPlanned
from uavgram.synthetic.plan.make import has_no_site, make_plan
from uavgram.synthetic.plan.scene import read_scene
from uavgram.synthetic.scenario_file import load_scenario
from uavgram.views.flight_plan import corners_on_earth

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
