"""The files that a plan is handed on as."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from planned_sample import sample_plan

from uavgram.errors import UavgramError
from uavgram.io.results.command_json import read_plan
from uavgram.model.naming import IMPERIAL
from uavgram.synthetic.plan.run import PlanOutputs, write_outputs
from uavgram.synthetic.scenario import Scenario

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
