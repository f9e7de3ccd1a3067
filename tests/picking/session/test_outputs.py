"""Results are older than what the page shows where their inputs differ, whoever wrote them."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path

import synthetic_survey
from open_projects import change, opened
from pick_pages import small_project

from uavgram.picking.protocol.messages import Json
from uavgram.picking.session.outputs import Outputs, results_json
from uavgram.picking.session.project import OpenProject


def results_of(folder: Path, *names: str) -> None:
    """As a run in a terminal writes them, with what it read."""
    inputs = {
        name: {"sha256": hashlib.sha256((folder / name).read_bytes()).hexdigest(), "bytes": 1}
        for name in names
    }
    (folder / "out").mkdir(exist_ok=True)
    text = json.dumps({"provenance": {"inputs": inputs}})
    (folder / "out" / "results.json").write_text(text)


def outputs_after_a_look(project: OpenProject, said: list[Json]) -> Json:
    """What the pages are told at the server's next look at the files."""
    said.clear()
    project.outputs.look()
    project.look_outside()
    (message,) = [one for one in said if one["t"] == "outputs"]
    told: Json = message["outputs"]
    return told


def test_a_run_elsewhere_makes_them_current_and_an_edit_makes_them_old(tmp_path: Path) -> None:
    path = small_project(tmp_path)
    (tmp_path / "picks.csv").write_text("image,label,u_px,v_px\nP1.jpg,A,10,20\n")
    read = ("project.yaml", "camera.yaml", "picks.csv", "photos/P1.jpg", "photos/P2.jpg")
    results_of(tmp_path, *read)
    with opened(path) as (project, said):
        begun = project.initial_state()
        assert begun["outputs"]["version"] == begun["version"]
        change(project, "place", image=0, label="A", u_px=11, v_px=21)
        assert outputs_after_a_look(project, said)["version"] is None
        project.picking.save()
        results_of(tmp_path, *read)  # `uavgram run` in a terminal, while the page is open
        assert outputs_after_a_look(project, said)["version"] == 1
    with opened(path) as (project, _):
        begun = project.initial_state()
        assert begun["outputs"]["version"] == begun["version"]
    (tmp_path / "camera.yaml").write_text((tmp_path / "camera.yaml").read_text() + "# note\n")
    with opened(path) as (project, _):
        assert project.initial_state()["outputs"]["version"] is None


def test_a_file_beside_a_locked_one_is_shown_in_its_place(tmp_path: Path) -> None:
    for k, name in enumerate(("report.html", "report.newer.html")):
        (tmp_path / name).write_text(name, encoding="utf-8")
        os.utime(tmp_path / name, (k, k))
    outputs = Outputs(tmp_path)
    assert outputs.read("report.html") == b"report.newer.html"
    assert outputs.list_files() == [{"name": "report.html", "words": "Report: report.newer.html"}]
    os.utime(tmp_path / "report.html", (2, 2))
    assert outputs.read("report.html") == b"report.html"


def test_measurements_keep_the_order_in_which_they_were_typed() -> None:
    result = synthetic_survey.build()
    rows = result.measurements
    names = [one["name"] for one in results_json(result)["measurements"]]
    typed = [name for name, kind in zip(rows.name, rows.kind, strict=True) if kind != "coordinate"]
    assert names[: len(typed)] == typed
    assert sorted(names) == sorted(rows.name)


def test_no_file_of_the_earth_is_offered_where_nothing_ties_the_survey_to_it(
    tmp_path: Path,
) -> None:
    for name in ("survey.kml", "points.geojson", "measurements.csv"):
        (tmp_path / name).write_text("", encoding="utf-8")
    for latitude, count in ((None, 2), (48.0, 4)):
        content = {"world": {"latitude_deg": latitude}, "provenance": {"inputs": {}}}
        (tmp_path / "results.json").write_text(json.dumps(content), encoding="utf-8")
        assert len(Outputs(tmp_path).list_files()) == count
