"""What other programs need of the commands: JSON, silence, and exit statuses."""

from __future__ import annotations

import csv
import importlib
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from csv_rows import read_rows, write_rows
from small_projects import Command, Project

import uavgram
from uavgram.config.camera import load_camera
from uavgram.io.tables.csv_tables import Columns, is_formula, read_table
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs

run_module = importlib.import_module("uavgram.pipeline.measure.run")


def test_run_prints_what_results_json_holds(project: Project, command: Command) -> None:
    done = command("run", project.path, "--json", "--quiet", "--fail-on", "red")
    assert (done.status, done.stderr) == (0, "")
    told = json.loads(done.stdout)
    assert done.stdout.isascii()
    results = Path(told.pop("results"))
    assert results == project / "out" / "results.json"
    assert told.pop("output") == str(project / "out")
    assert told.pop("written_beside") == {}
    whole = json.loads(results.read_text(encoding="utf-8"))
    assert {*told} == {"schema", "name", "verdict", "measurements", "checks", "messages"}
    assert told == {key: whole[key] for key in told}


def test_a_verdict_that_is_as_bad_fails_and_the_results_are_written(
    project: Project, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = read_rows(project / "lines.csv")
    for row in rows:  # all 6 % too long: nothing shows whether the log is wrong instead
        row["length_m"] = str(float(row["length_m"]) * 1.06)
    write_rows(project / "lines.csv", rows)
    computed = compute(read_inputs(project.path))
    monkeypatch.setattr(run_module, "compute", lambda *_args, **_named: computed)
    results = project / "out" / "results.json"
    for options, status in ((["--fail-on", "amber"], 3), (["--fail-on", "red"], 3), ([], 0)):
        results.unlink()
        done = command("run", project.path, "--quiet", *options)

        assert json.loads(results.read_text(encoding="utf-8"))["verdict"]["level"] == "red"
        assert (done.status, done.stdout) == (status, "")
        (line,) = done.stderr.splitlines()  # who reads nothing else reads this
        assert line.startswith("uavgram: Verdict: red")
    # A reader that leaves early does not make a bad survey pass.
    words = [sys.executable, "-m", "uavgram", "run", str(project.path), "--json"]
    process = subprocess.Popen([*words, "--fail-on", "red"], stdout=subprocess.PIPE)
    assert process.stdout is not None
    process.stdout.close()
    assert process.wait() == 3


def test_check_prints_its_photos(project: Project, command: Command) -> None:
    done = command("check", project.path, "--json")
    assert (done.status, done.stderr) == (0, "")
    told = json.loads(done.stdout)
    assert [photo["image"] for photo in told["photos"]][:2] == ["IMG_0001.jpg", "IMG_0002.jpg"]
    first = told["photos"][0]
    assert (first["width_px"], first["height_px"], first["matched"]) == (400, 300, True)
    assert first["event"]["number"] == 1
    assert "time-aligned" in {message["code"] for message in told["messages"]}


def test_camera_prints_its_parameters_and_differences(project: Project, command: Command) -> None:
    path = project / "camera.yaml"
    camera = load_camera(path)
    told = json.loads(command("camera", path, "--json").stdout)
    assert list(told["parameters"].values()) == camera.parameters.tolist()
    assert list(told["parameters"])[:4] == ["fx", "fy", "cx", "cy"]
    np.testing.assert_array_equal(told["covariance"], camera.covariance)

    told = json.loads(command("camera", path, "--compare", path, "--json").stdout)
    np.testing.assert_allclose(told["difference_px"], 0.0, atol=1e-6)
    assert told["compared_with"] == str(path)


def test_log_prints_json_in_ascii_and_quiet_keeps_only_that(
    project: Project, command: Command
) -> None:
    log = project / "flight.tlog"
    assert command("log", log, "--quiet").stdout == ""
    assert command("--quiet", "check", project.path).stdout == ""
    assert command("check", project.path).stdout  # and is as before afterwards
    told = command("log", log, "--json", "--quiet").stdout
    assert json.loads(told)["path"] == str(log)
    assert told.isascii()


def test_exit_statuses(project: Project, command: Command) -> None:
    assert command("check", project.path, "--quiet").status == 0
    problem = command("check", project / "absent.yaml", "--quiet")
    assert problem.status == 1
    assert problem.stderr.startswith("uavgram: ")
    assert command("check", "--jsno").status == 2
    assert command("run", project.path, "--fail-on", "yellow").status == 2


# A survey whose names a spreadsheet would run: its tables do not, and its photos are named.


COMMAND = "=cmd|' /C calc'!A0"


def test_measurements_csv_runs_nothing_and_keeps_the_name(project: Project) -> None:
    project.cell("measure.csv", 1, "name", COMMAND)
    old = (project / "picks.csv").read_text().splitlines()[1].split(",")[0]
    (project / "photos" / old).rename(project / "photos" / f"={old}")
    text = (project / "picks.csv").read_text().replace(old, f"={old}")
    (project / "picks.csv").write_text(text)
    result = uavgram.run(project.path)
    assert result.measurements.name[0] == COMMAND
    path = project.out / "measurements.csv"
    with path.open(encoding="utf-8", newline="") as stream:
        assert not any(is_formula(cell) for row in csv.reader(stream) for cell in row)
    read = read_table(path, Columns(text=("name", "kind"), others=True))
    assert read.text["name"] == result.measurements.name
    (said,) = [m.text for m in result.messages if m.code == "photo-name-formula"]
    assert said.startswith(
        f"1 of the photos' names begin as a formula does (the first is '={old}')"
    )
