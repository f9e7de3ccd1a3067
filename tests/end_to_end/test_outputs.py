"""The output folder: every file that is promised, and all of them telling the same."""

from __future__ import annotations

import hashlib
import json
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from csv_rows import read_rows
from flight_projects import Demo

import uavgram

Content = dict[str, Any]
"""Of results.json."""

FILES = {
    "results.json", "recording.rrd", "report.html", "report-annex.html", "points.geojson",
    "measurements.csv", "run.jsonl", "survey.gpkg", "survey.qgs", "ground.tif", "survey.kml",
    "survey_local.dxf", "survey_map.dxf", "colmap", "opendronemap",
}  # fmt: skip

POSE = {"center_world_m": (3,), "world_from_camera": (3, 3), "covariance": (6, 6)}
# The promised keys, by hand: what others read must not change with the writer.
TOP = {
    "schema", "provenance", "world", "clock", "shared", "frames", "points", "lines", "picks",
    "measurements", "measurement_correlation", "checks", "solution", "messages",
}  # fmt: skip
PROVENANCE = {
    "program",
    "version",
    "created_utc",
    "inputs",
    "options",
    "seed",
    "packages",
    "made_by",
}
WORLD = {"latitude_deg", "longitude_deg", "height_m", "height_datum", "gauge"}
SHARED = {
    "boresight_deg", "lever_arm_m", "position_bias_m", "heading_bias_deg", "plane", "intrinsics",
    "readout_s", "tape_scale",
}  # fmt: skip
RECORDS = {
    "frames": {"frame_id", "time_utc_s", "status", "reason", "seed", "refined"},
    "points": {
        "label", "position_world_m", "covariance_m2", "ellipse_95", "latitude_deg",
        "longitude_deg", "frames",
    },
    "lines": {
        "name", "from", "to", "length_m", "sigma_m", "adjusted_m", "adjusted_sigma_m",
        "residual_m", "w", "redundancy", "mdb_m", "status",
    },
    "picks": {"image", "label", "residual_px", "w", "redundancy", "status"},
    "measurements": {"name", "kind", "points", "value", "sigma", "unit", "interval_95"},
    "messages": {"level", "code", "text"},
}  # fmt: skip
SOLUTION = {
    "degrees_of_freedom", "variance_factor", "chi2_probability", "iterations", "converged",
    "alternatives",
}  # fmt: skip
WORDS = {
    "frames": {"refined", "seeded", "unmatched", "rejected"},
    "lines": {"used", "suspect", "removed", "checked", "unseen"},
}


@pytest.fixture(scope="module")
def content(demo: Demo) -> Content:
    known: Content = json.loads((demo.out / "results.json").read_text(encoding="utf-8"))
    return known


def test_every_promised_file_is_there_and_nothing_else(demo: Demo) -> None:
    assert {path.name for path in demo.out.iterdir()} == FILES


def test_results_have_every_promised_key(content: Content) -> None:
    assert content["schema"] == 1
    assert content.keys() >= TOP
    assert content["provenance"].keys() >= PROVENANCE
    assert content["world"].keys() >= WORLD
    assert content["clock"].keys() >= {"offset_s", "sigma_s"}
    assert content["shared"].keys() == SHARED
    assert content["solution"].keys() >= SOLUTION
    for table, keys in RECORDS.items():
        assert content[table], table
        for record in content[table]:
            assert record.keys() >= keys, table
    points, lines = ([c for c in content["checks"] if key in c] for key in ("mahalanobis", "z"))
    assert points
    assert lines
    assert all(c.keys() >= {"label", "error_m", "sigma_m", "mahalanobis"} for c in points)
    assert all(c.keys() >= {"name", "error_m", "sigma_m", "z"} for c in lines)


def test_shared_unknowns_have_value_and_sigma(content: Content) -> None:
    shared = content["shared"]
    estimates = [shared[key] for key in SHARED - {"plane", "tape_scale"}]
    assert shared["tape_scale"].keys() == {""}  # the one tape, which has no name
    estimates.append(shared["tape_scale"][""])
    estimates += [shared["plane"]["height_m"], shared["plane"]["slope_deg"]]
    for estimate in estimates:
        assert np.shape(estimate["value"]) == np.shape(estimate["sigma"])
        assert np.all(np.array(estimate["sigma"]) >= 0)


def test_tables_have_the_promised_shapes_and_words(content: Content) -> None:
    for frame in content["frames"]:
        for pose in (frame["seed"], frame["refined"]):
            assert {key: np.shape(pose[key]) for key in POSE} == POSE
    for point in content["points"]:
        assert np.shape(point["position_world_m"]) == (3,)
        assert np.shape(point["covariance_m2"]) == (2, 2)
        assert point["ellipse_95"].keys() >= {"semi_major_m", "semi_minor_m", "azimuth_deg"}
    count = len(content["measurements"])
    assert np.shape(content["measurement_correlation"]) == (count, count)
    for table, words in WORDS.items():
        assert {record["status"] for record in content[table]} <= words
    assert content["world"]["height_datum"] in ("msl", "ellipsoid")
    assert content["world"]["gauge"] == "world"


def test_the_ellipse_is_that_of_the_covariance_at_95_percent(content: Content) -> None:
    for point in content["points"]:
        eigen = np.linalg.eigvalsh(point["covariance_m2"])
        axes = [point["ellipse_95"]["semi_minor_m"], point["ellipse_95"]["semi_major_m"]]
        np.testing.assert_allclose(axes, 2.4477 * np.sqrt(eigen), rtol=1e-4)


def test_provenance_names_every_input_by_its_digest(demo: Demo, content: Content) -> None:
    inputs = content["provenance"]["inputs"]
    photos = {f"photos/{path.name}" for path in (demo.folder / "photos").iterdir()}
    tables = {f"{name}.csv" for name in ("picks", "lines", "measure", "check")}
    assert set(inputs) == {"project.yaml", "camera.yaml", "flight.tlog"} | tables | photos
    for name, digest in inputs.items():
        data = (demo.folder / name).read_bytes()
        assert digest == {"sha256": hashlib.sha256(data).hexdigest(), "bytes": len(data)}


def test_measurements_csv_says_the_same_as_results_json(demo: Demo, content: Content) -> None:
    rows = read_rows(demo.out / "measurements.csv")
    assert [row["name"] for row in rows] == [m["name"] for m in content["measurements"]]
    for row, measurement in zip(rows, content["measurements"], strict=True):
        low, high = measurement["interval_95"]
        whole = {"value": measurement["value"], "lower_95": low, "upper_95": high}
        for name, number in {**whole, "sigma": measurement["sigma"]}.items():
            assert abs(float(row[name]) - number) <= 0.0005 * measurement["sigma"]
            assert len(row[name].partition(".")[2]) == len(row["sigma"].partition(".")[2])
        assert len(row["sigma"].replace(".", "").lstrip("0")) <= 4
        assert row["points"].split(";") == measurement["points"]
        assert (row["kind"], row["unit"]) == (measurement["kind"], measurement["unit"])


def test_points_geojson_says_the_same_as_results_json(demo: Demo, content: Content) -> None:
    features = json.loads((demo.out / "points.geojson").read_text(encoding="utf-8"))["features"]
    places = {
        f["properties"]["label"]: f["geometry"]["coordinates"][:2]
        for f in features
        if f["properties"]["type"] == "point"
    }
    assert places == {
        p["label"]: [p["longitude_deg"], p["latitude_deg"]] for p in content["points"]
    }


def test_the_runs_own_log_is_json_lines_in_order(demo: Demo, content: Content) -> None:
    lines = (demo.out / "run.jsonl").read_text(encoding="utf-8").splitlines()
    records = [json.loads(line) for line in lines]
    times = [datetime.fromisoformat(record["time_utc"]) for record in records]
    assert times == sorted(times)
    assert all(record["seconds"] >= 0 for record in records if record["event"] == "step")
    told = [record["text"] for record in records if record["event"] == "message"]
    assert told == [message["text"] for message in content["messages"]]


def test_options_and_inputs_name_no_place_of_this_machine(content: Content) -> None:
    options = content["provenance"]["options"]
    assert options["images"] == ["photos/*.jpg"]
    assert (options["picks"], options["camera"], options["output"]) == (
        "picks.csv",
        "camera.yaml",
        "out",
    )
    named = [*content["provenance"]["inputs"], *map(str, options.values())]
    assert not [name for name in named if name.startswith("/")]


def test_the_same_run_twice_gives_the_same_results(demo: Demo, tmp_path: Path) -> None:
    uavgram.run(demo.project, output=tmp_path)
    texts = []
    for path in (demo.out / "results.json", tmp_path / "results.json"):
        text = path.read_text(encoding="utf-8")
        created = json.loads(text)["provenance"]["created_utc"]
        assert text.count(created) == 1
        texts.append(text.replace(created, ""))
    # A change of folder is a change of the options; nothing else may differ.
    assert texts[0] == texts[1]
    assert (demo.out / "points.geojson").read_bytes() == (tmp_path / "points.geojson").read_bytes()
