"""A project with `known: known.csv`, from the file to results.json, report and messages."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from pyproj import Transformer
from scipy.stats import norm
from small_projects import Command, Project

import uavgram
from uavgram.errors import InputError
from uavgram.estimation.reliability.stated_values import explain_coordinates
from uavgram.model.arrays import Floats
from uavgram.model.survey import Geodetic, World
from uavgram.pipeline.check import check
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.pipeline.measure.pose import transform_known
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


# A known azimuth has all that other known things have: residual, test, report, messages.


def with_azimuth(project: Project, error: float, sigma: float = 0.2) -> float:
    """Give the project the azimuth of two of its points, and return the true one."""
    points = json.loads((project / "truth.json").read_text())["points"]
    ahead = np.subtract(points["R3"], points["R1"])
    true = float(np.degrees(np.arctan2(ahead[0], ahead[1])) % 360.0)
    text = f"name,kind,points,value,sigma\nwall,azimuth,R1;R3,{true + error:.6f},{sigma}\n"
    (project / "known.csv").write_text(text)
    project.set(known="known.csv")
    return true


def test_it_is_tested_and_reported_like_all_known_things(project: Project) -> None:
    true = with_azimuth(project, 0.0)
    result = uavgram.run(project.path)
    known = result.known
    report = "".join((project.out / f"report{part}.html").read_text() for part in ("", "-annex"))

    assert (known.kind, known.unit, known.status) == (("azimuth",), ("deg",), ("used",))
    assert known.adjusted[0] == pytest.approx(true, abs=4 * known.adjusted_sigma[0])
    # One number: w = v / (sigma sqrt(r)), and the bias that is found with 80 % (Baarda 1968).
    redundancy = 1.0 - (known.adjusted_sigma[0] / 0.2) ** 2
    assert known.redundancy[0] == pytest.approx(redundancy, rel=1e-6)
    w = known.residual[0] / (0.2 * np.sqrt(redundancy))
    assert known.w[0] == pytest.approx(w, rel=1e-6)
    detectable = 0.2 * (norm.isf(0.0005) + norm.ppf(0.8)) / np.sqrt(redundancy)
    assert known.mdb[0] == pytest.approx(detectable, rel=1e-6)
    assert "azimuth" in report


def test_a_wrong_one_is_named(project: Project) -> None:
    with_azimuth(project, 6.0)
    result = uavgram.run(project.path, output=None)
    texts = [one.text for one in result.messages if one.code.startswith("known-")]

    assert result.known.status[0] in ("suspect", "removed")
    assert any("azimuth 'wall' ('R1', 'R3')" in text for text in texts)


def test_without_a_world_it_is_idle(project: Project) -> None:
    with_azimuth(project, 0.0)
    project.set(log=None)
    result = uavgram.run(project.path, output=None)
    (message,) = (one for one in result.messages if one.code == "known-idle")

    assert result.known.status == ("idle",)
    assert "nothing else determines where north is. It takes the flight log" in message.text


# Known points in the world of the flight.


WORLD = World(origin=Geodetic(47.3, 8.55, 400.0), height_datum="msl", gauge="world")


@pytest.mark.parametrize("role", ["control", "check"])
def test_a_point_with_latitude_and_longitude_exchanged_is_a_mistake(
    project: Project, role: str
) -> None:
    rows = "label,latitude_deg,longitude_deg,height_m,sigma_m\nA,47.301,8.55,400,1\n"
    (project / "points.csv").write_text(rows)
    project.set(**{role: "points.csv"})
    right = read_inputs(project.path)
    known, _ = transform_known(right, getattr(right, role), WORLD)
    assert known.world_m[0] == pytest.approx([0.0, 111.2, 0.0], abs=0.1)

    (project / "points.csv").write_text(f"{rows}B,8.55,47.301,400,1\n")
    wrong = read_inputs(project.path)
    with pytest.raises(InputError, match=r"point 'B' .* latitude and longitude exchanged"):
        transform_known(wrong, getattr(wrong, role), WORLD)


@pytest.mark.parametrize("crs", ["auto", "EPSG:25832"])
@pytest.mark.parametrize("role", ["control", "check"])
def test_a_point_with_easting_and_northing_exchanged_is_a_mistake(
    project: Project, role: str, crs: str
) -> None:
    to_map = Transformer.from_crs("EPSG:4326", "EPSG:25832", always_xy=True)
    east, north = to_map.transform(8.55, 47.301)
    longitude, latitude = to_map.transform(north, east, direction="INVERSE")
    rows = "label,latitude_deg,longitude_deg,height_m,sigma_m\nA,47.301,8.55,400,1\n"
    (project / "points.csv").write_text(f"{rows}B,{latitude},{longitude},400,1\n")
    project.set(**{role: "points.csv", "crs": crs})
    wrong = read_inputs(project.path)
    with pytest.raises(InputError, match=r"point 'B' .* easting and northing exchanged"):
        transform_known(wrong, getattr(wrong, role), WORLD)


def test_all_points_with_exchanged_coordinates_are_named(project: Project) -> None:
    rows = "label,latitude_deg,longitude_deg,height_m,sigma_m\n"
    rows += "".join(f"{label},8.55,47.30{k},400,1\n" for k, label in enumerate("ABC"))
    (project / "points.csv").write_text(rows)
    project.set(control="points.csv")
    wrong = read_inputs(project.path)
    with pytest.raises(InputError, match=r"points 'A', 'B' and 'C' are far .*: correct their rows"):
        transform_known(wrong, wrong.control, WORLD)


@pytest.mark.parametrize("role", ["control", "check"])
def test_check_refuses_what_a_run_refuses(project: Project, role: str) -> None:
    home = check(project.path).posed.world.origin
    assert home is not None
    rows = "label,latitude_deg,longitude_deg,height_m,sigma_m\n"
    (project / "points.csv").write_text(
        f"{rows}A,{home.latitude_deg + 1.0},{home.longitude_deg},400,1\n"
    )
    project.set(**{role: "points.csv"})
    with pytest.raises(InputError, match="far from where the survey is"):
        check(project.path)


def test_points_that_are_all_of_another_place_are_a_mistake(project: Project) -> None:
    rows = (
        "label,latitude_deg,longitude_deg,height_m,sigma_m\nA,46.3,8.55,400,1\nB,46.4,8.6,400,1\n"
    )
    (project / "points.csv").write_text(rows)
    project.set(control="points.csv")
    wrong = read_inputs(project.path)
    with pytest.raises(InputError, match=r"all known points are far .* 'A' by 111 km"):
        transform_known(wrong, wrong.control, WORLD)


def test_local_coordinates_that_are_exchanged_are_named_by_where_the_points_were_found() -> None:
    found = np.array([110.0, -40.0, 1.0])
    assert "east and north exchanged" in explain_coordinates(np.array([-39.0, 111.0, 1.2]), found)
    assert explain_coordinates(np.array([111.0, -60.0, 1.2]), found) == ""
