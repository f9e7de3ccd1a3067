"""`uavgram plan` through the command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from small_projects import Command

from uavgram.io.area_file import read_areas
from uavgram.io.results.command_json import read_plan
from uavgram.synthetic.scenario_file import read_world

FILES = {
    "field_sheet.html",
    "mission.plan",
    "mission.waypoints",
    "plan.geojson",
    "plan.json",
    "plan.kml",
    "plan.rrd",
    "scenario.yaml",
}
SITE = "site: {latitude_deg: 47.0, longitude_deg: 8.0, scene_east_m: 0, scene_north_m: 0}\n"
MISSIONS = {"mission.plan", "mission.waypoints"}
PLAN = """
name: yard
plan:
  area: {area}
  patterns: [single]
  heights_m: [40]
  pitches_deg: [-90]
"""
SQUARE = "[[-10, -8], [10, -8], [10, 8], [-10, 8]]"


def scenario(folder: Path, text: str) -> Path:
    path = folder / "yard.yaml"
    path.write_text(text)
    return path


def test_all_files_are_written_and_the_screen_says_what_to_do(
    command: Command, tmp_path: Path
) -> None:
    path = scenario(tmp_path, SITE + PLAN.format(area=SQUARE))
    done = command("plan", path, "--output", tmp_path / "out")
    assert done.status == 0, done
    assert {one.name for one in (tmp_path / "out").iterdir()} == FILES
    for said in ("Lay and tape", "1 photo", "40 m above the ground", "expect", "L4", *FILES):
        assert said in done.stdout
    planned = read_plan(tmp_path / "out" / "plan.json")
    assert len(planned.lines.name) >= 4
    assert read_areas(tmp_path / "out" / "plan.geojson").areas
    world = read_world(tmp_path / "out" / "scenario.yaml")  # it makes sense, without errors too
    assert len(world.scenario.flight.poses) == len(planned.frames.name)


def test_without_a_site_no_mission_is_written_nor_an_earlier_one_left(
    command: Command, tmp_path: Path
) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    for name in MISSIONS:
        (folder / name).write_text("of another place")
    path = scenario(tmp_path, PLAN.format(area=SQUARE))
    done = command("plan", path, "--output", folder)

    assert done.status == 0, done
    assert {one.name for one in folder.iterdir()} == FILES - MISSIONS
    assert "no mission file was written" in done.stdout


def test_an_area_from_a_map_is_where_it_lies(command: Command, tmp_path: Path) -> None:
    ring = [[8.0, 47.0], [8.0003, 47.0], [8.0003, 47.0002], [8.0, 47.0002], [8.0, 47.0]]
    (tmp_path / "area.geojson").write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    path = scenario(tmp_path, PLAN.format(area="area.geojson").replace("[40]", "[50]"))
    done = command("plan", path, "--output", tmp_path / "out")
    assert done.status == 0, done
    planned = read_plan(tmp_path / "out" / "plan.json")
    assert planned.site.latitude_deg == pytest.approx(47.0001, abs=1e-4)
    assert planned.site.longitude_deg == pytest.approx(8.00015, abs=1e-4)


def test_latitude_before_longitude_is_noticed_beside_the_site(
    command: Command, tmp_path: Path
) -> None:
    ring = [[47.0, 8.0], [47.0, 8.0003], [47.0002, 8.0003], [47.0002, 8.0], [47.0, 8.0]]
    (tmp_path / "area.geojson").write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    site = "site: {latitude_deg: 47.001, longitude_deg: 8.001}\n"
    path = scenario(tmp_path, PLAN.format(area="area.geojson") + site)
    done = command("plan", path, "--output", tmp_path / "out")
    assert done.status == 1, done
    assert "area.geojson: has latitude and longitude in the wrong order" in done.stderr


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("name: yard\n", "has no section `plan:`"),
        (PLAN.format(area="[]"), "encloses no ground"),
        (PLAN.format(area="[[0, 0], [10, 0], [20, 0]]"), "encloses no ground"),
        (PLAN.format(area="[[0, 0], [10, 10], [10, 0], [0, 10]]"), "crosses itself"),
        (PLAN.format(area="nowhere.kml"), "nowhere.kml"),
        (PLAN.format(area=SQUARE) + "  longest_tape_m: 2.0\n", "longest_tape_m"),
        (
            PLAN.format(area=SQUARE) + "  shortest_line_m: 14.9\n  longest_tape_m: 14.95\n",
            "no line",
        ),
        (PLAN.format(area=SQUARE) + "  wanted: [{name: a, points: [P1, P99]}]\n", "'P99'"),
        (PLAN.format(area=SQUARE).replace("-90", "-10"), "pitches_deg"),
        (PLAN.format(area=SQUARE).replace("40", "4"), "min_height_m"),
        (PLAN.format(area="[[-90, -90], [90, -90], [90, 90], [-90, 90]]"), "smaller"),
        (PLAN.format(area=SQUARE) + "  tape: 4\n", "tape"),
        (PLAN.format(area=SQUARE) + "  longest_tape_m: 0\n", "longest_tape_m must be greater than"),
        (
            PLAN.format(area=SQUARE) + "  lines: 0\ntelemetry: none\n",
            "positions of the photos are not",
        ),
        (PLAN.format(area=SQUARE) + "  wanted: [{name: a, points: [P1]}]\n", "needs 2 labels"),
        (
            PLAN.format(area=SQUARE)
            + "  wanted: [{name: a, kind: skid_speed, points: [P1, P2]}]\n",
            "needs mu and mu_sigma",
        ),
        (
            PLAN.format(area=SQUARE) + "  wanted: [{name: far, points: [P1, [300, 0]]}]\n",
            "outside of the area (far 2)",
        ),
        (PLAN.format(area=SQUARE) + "site: {latitude_deg: 151.2}\n", "latitude_deg must lie"),
        (PLAN.format(area=SQUARE) + "camera: {drone: Wright Flyer}\n", "Wright Flyer"),
    ],
)
def test_what_cannot_be_planned_is_said_by_file(
    command: Command, tmp_path: Path, text: str, said: str
) -> None:
    path = scenario(tmp_path, text)
    done = command("plan", path, "--output", tmp_path / "out")
    assert done.status == 1, done
    assert said in done.stderr
    assert "yard.yaml" in done.stderr or "nowhere.kml" in done.stderr
    assert not (tmp_path / "out").exists()
