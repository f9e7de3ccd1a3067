"""A project with `known: known.csv`, from the file to results.json, report and messages."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from small_projects import Command, Project

import uavgram
from uavgram.model.arrays import Floats
from uavgram.pipeline.pick.live_survey import LiveSurvey, Observations


@pytest.fixture
def truth(project: Project) -> dict[str, Floats]:
    """True places of the points of the simulated survey."""
    points = json.loads((project / "truth.json").read_text())["points"]
    return {label: np.array(place) for label, place in points.items()}


def with_known(project: Project, *rows: str) -> None:
    text = "name,kind,points,value,sigma,use\n" + "\n".join(rows) + "\n"
    (project / "known.csv").write_text(text)
    project.set(known="known.csv")


def apart(truth: dict[str, Floats], a: str, b: str) -> float:
    return float(np.linalg.norm(truth[a] - truth[b]))


def test_a_known_distance_sharpens_what_is_measured_there(
    project: Project, truth: dict[str, Floats], small_survey: Path
) -> None:
    before = uavgram.load_results(small_survey / "out" / "results.json")
    with_known(project, f"skid,distance,P1;P2,{apart(truth, 'P1', 'P2')},0.002,")
    result = uavgram.run(project.path, output=None)
    row = result.measurements.name.index("skid left")

    assert result.known.status == ("used",)
    assert before.measurements.sigma[row] > 0.005
    assert result.measurements.sigma[row] == pytest.approx(0.002, rel=0.1)
    assert result.measurements.value[row] == pytest.approx(apart(truth, "P1", "P2"), abs=0.006)
    assert "known.csv" in [one.path for one in result.provenance.inputs]


def test_every_status_comes_back_from_results_json(
    project: Project, truth: dict[str, Floats], command: Command
) -> None:
    with_known(
        project,
        f"skid,distance,P1;P2,{apart(truth, 'P1', 'P2')},0.02,",
        f"wrong,distance,R1;R3,{apart(truth, 'R1', 'R3') + 0.25},0.02,",
        f"in feet,distance,R3;R5,{apart(truth, 'R3', 'R5') / 0.3048},0.02,",
        f"withheld,distance,R4;R5,{apart(truth, 'R4', 'R5')},0.02,check",
        "ghost,right_angle,R1;R2;X9,,1,",
        "flat,coplanar,R1;R2;R3;R4,,0.02,",
    )
    done = command("run", project.path)
    result = uavgram.load_results(project.out / "results.json")
    known = json.loads((project.out / "results.json").read_text())["known"]
    rows = {one["name"]: one for one in known}

    assert done.status == 0
    assert [one["status"] for one in known] == [
        *("used", "suspect", "removed", "checked", "unseen", "idle")
    ]
    assert result.known.name == tuple(rows)
    assert rows["flat"]["value"] is rows["ghost"]["adjusted"] is None
    assert rows["wrong"]["residual"] == rows["wrong"]["adjusted"] - rows["wrong"]["value"]
    assert abs(rows["withheld"]["w"]) < 4
    assert 0 < rows["skid"]["redundancy"] < 1
    assert rows["skid"]["mdb"] > 0.02
    assert "The known distance 'wrong' ('R1', 'R3') does not fit: given " in done.stdout
    assert "The known distance 'in feet' ('R3', 'R5') was left out: given " in done.stdout
    assert "The right angle 'ghost' ('R1', 'R2', 'X9') is not used: no usable pick" in done.stdout
    assert "The plane 'flat' ('R1', 'R2', 'R3', 'R4') is not used" in done.stdout
    report = "".join((project.out / f"report{part}.html").read_text() for part in ("", "-annex"))
    assert "Other known values, and how well they fit" in report
    assert "The known distance &#39;wrong&#39; (" in report.split("</header>")[0]


def test_the_same_value_counts_once(project: Project) -> None:
    header, first, *_ = (project / "lines.csv").read_text().splitlines()
    line = dict(zip(header.split(","), first.split(","), strict=True))
    row = f"distance,{line['to']};{line['from']},{line['length_m']},{line['sigma_m']},"
    with_known(
        project, f"again,{row}", "square,right_angle,R1;R2;R3,,90,", "sq,right_angle,R3;R2;R1,,90,"
    )
    result = uavgram.run(project.path, output=None)
    (said,) = [m.text for m in result.messages if m.code == "known-duplicate"]

    assert f"'again' is the length {line['name']!r} again; 'sq' is 'square' again" in said
    assert result.known.status == ("removed", "used", "removed")


def test_check_reads_it_and_names_what_is_wrong(project: Project, command: Command) -> None:
    with_known(project, "ghost,distance,R1;R99,3,0.1,")
    done = command("check", project.path)
    assert done.status == 0
    assert "Point 'R99' of known thing 'ghost' is never picked" in done.stdout

    with_known(project, "lane,distence,R1;R2,3.5,0.1,")
    done = command("check", project.path)
    assert done.status == 1
    assert "known.csv:2: unknown kind 'distence': did you mean 'distance'?" in done.stderr

    project.set(known="missing.csv")
    assert "missing.csv" in command("check", project.path).stderr


def test_the_picking_page_adjusts_with_it(project: Project, truth: dict[str, Floats]) -> None:
    with_known(project, f"skid,distance,P1;P2,{apart(truth, 'P1', 'P2')},0.002,")
    live = LiveSurvey.open(project.path)
    inputs = live.inputs
    observed = Observations(picks=inputs.picks, lines=inputs.lines, requests=inputs.requests)
    adjusted = live.adjust(observed)
    moved = live.update_linearly(adjusted, observed)

    assert adjusted.result.known.status == ("used",)
    assert moved is not None
    np.testing.assert_allclose(moved.value, adjusted.result.measurements.value, rtol=1e-9)
