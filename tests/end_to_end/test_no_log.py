"""Lengths alone: one photo, the lengths on the ground, no flight log."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from csv_rows import read_rows
from flight_projects import Truth, copy_project

import uavgram
from uavgram.model.result.result import Result

Run = tuple[Result, Path, Truth]
"""A result, the folder of its files, and the truth."""

# One frame of each twin that shows all six lengths.
FRAMES = [("calm_nadir", "IMG_0045.jpg"), ("wind_oblique", "IMG_0030.jpg")]


@pytest.fixture(scope="module", params=FRAMES, ids=lambda pair: pair[0])
def run(
    request: pytest.FixtureRequest,
    data_dir: Path,
    tmp_path_factory: pytest.TempPathFactory,
    truth: Callable[[str], Truth],
) -> Run:
    name, image = request.param
    folder = tmp_path_factory.mktemp(f"{name}_alone")
    source = data_dir / name
    lines = (source / "picks.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    kept = [line for line in lines if line.startswith(("image", image))]
    (folder / "picks.csv").write_text("".join(kept), encoding="utf-8")
    project = copy_project(
        source,
        folder,
        log=None,
        time=None,
        images=str(source / "photos" / image),
        picks="picks.csv",
    )
    return uavgram.run(project), folder / "out", truth(name)


def test_the_frame_is_refined_in_a_gauge_of_its_own(run: Run) -> None:
    result, _, _ = run
    assert result.world.gauge == "plane"
    assert result.frames.status == ("refined",)
    assert not result.has_seed.any()
    np.testing.assert_allclose(result.frames.refined.center_world_m[0, :2], 0, atol=1e-9)
    up_of_image = -result.frames.refined.world_from_camera[0][:, 1]
    assert up_of_image[0] == pytest.approx(0, abs=1e-9)
    assert up_of_image[1] > 0
    # On z = 0 up to the ground's own roughness.
    np.testing.assert_allclose(result.points.position_world_m[:, 2], 0, atol=0.02)


def test_distances_are_right_within_three_sigma(run: Run) -> None:
    result, _, known = run
    rows = result.measurements
    true = np.array([known["measurements"][name] for name in rows.name])
    seen = np.isfinite(rows.value)
    assert seen.sum() >= 29
    z = (rows.value - true)[seen] / rows.sigma[seen]
    # One pose serves all: a few independent errors, none of them beyond 3 sigma.
    assert np.abs(z).max() <= 3
    assert np.mean(np.abs(rows.value / true - 1)[seen]) < 0.01


def test_the_camera_stands_as_high_as_it_did(run: Run) -> None:
    result, _, known = run
    frame = known["frames"][result.frames.frame_id[0]]
    ground = known["ground"]
    center = np.array(frame["center_world_m"])
    rise = np.dot(ground["slope"], center[:2] - ground["pivot"])
    height = center[2] - ground["height_m"] - rise
    assert result.frames.refined.center_world_m[0, 2] == pytest.approx(height, rel=0.01)


def test_measurements_that_the_photo_does_not_show_are_null(run: Run) -> None:
    result, _, _ = run
    shown = set(result.points.label)
    rows = result.measurements
    for points, value in zip(rows.points, rows.value, strict=True):
        assert np.isfinite(value) == (set(points) <= shown)


def test_nothing_is_said_about_places_on_the_earth(run: Run) -> None:
    result, out, _ = run
    content = json.loads((out / "results.json").read_text(encoding="utf-8"))
    for key in ("latitude_deg", "longitude_deg", "height_m"):
        assert content["world"][key] is None
    assert set(content["clock"].values()) == {None}
    for key in ("boresight_deg", "lever_arm_m", "position_bias_m", "heading_bias_deg"):
        assert content["shared"][key] is None
    assert all(point["latitude_deg"] is None for point in content["points"])
    assert any(message.code == "gauge-plane" for message in result.messages)


def test_points_geojson_is_empty_and_says_why(run: Run) -> None:
    _, out, _ = run
    content = json.loads((out / "points.geojson").read_text(encoding="utf-8"))
    assert content["features"] == []
    assert "no geographic position" in content["message"]


def test_every_output_is_there_and_reads_back(run: Run) -> None:
    result, out, _ = run
    names = {path.name for path in out.iterdir()}
    assert names == {
        *("results.json", "recording.rrd", "report.html", "report-annex.html", "run.jsonl"),
        "measurements.csv",
        *("points.geojson", "survey.gpkg", "survey.kml", "survey_local.dxf", "colmap"),
        *("survey.qgs", "ground.tif"),
    }
    loaded = uavgram.load_results(out / "results.json")
    np.testing.assert_array_equal(loaded.measurements.value, result.measurements.value)
    values = [row["value"] for row in read_rows(out / "measurements.csv")]
    assert [value == "" for value in values] == np.isnan(result.measurements.value).tolist()


def test_three_lengths_are_warned_of(data_dir: Path, tmp_path: Path) -> None:
    """Three lengths leave the pose ambiguous; four unconnected ones do not."""
    source = data_dir / "calm_nadir"
    for name, starts in (("picks", ("image", "IMG_0045")), ("lines", ("name", "L1", "L2", "L3"))):
        lines = (source / f"{name}.csv").read_text(encoding="utf-8").splitlines(keepends=True)
        text = "".join(line for line in lines if line.startswith(starts))
        (tmp_path / f"{name}.csv").write_text(text, encoding="utf-8")
    project = copy_project(
        source, tmp_path, log=None, time=None, picks="picks.csv", lines="lines.csv"
    )
    result = uavgram.run(project, output=None)
    told = {message.code for message in result.messages if message.level == "warning"}
    assert "three-lengths" in told
    # Here, as in about half of all scenes, they have a second solution: it is handed on.
    assert "ambiguous-pose" in told
    (other,) = result.solution.alternatives
    assert len(other.values) == len(result.measurements.value)
    # Values that it changes are marked, and their intervals contain it, as it fits as well.
    rows = result.measurements
    low, high = rows.interval_95.T
    there = np.array(other.values)
    assert rows.is_ambiguous.any()
    marked = [values[0] for values in rows.alternative_values if values]
    np.testing.assert_array_equal(marked, there[rows.is_ambiguous])
    assert np.all(((low <= there) & (there <= high))[rows.is_ambiguous])
    # Its difference counts by its odds, which are between 1 in 40 and even.
    share = (rows.sigma / np.abs(there - rows.value))[rows.is_ambiguous]
    assert np.all(share > np.sqrt(1.0 / 40.0))


def test_neither_log_nor_lengths_is_an_error(data_dir: Path, tmp_path: Path) -> None:
    project = copy_project(data_dir / "calm_nadir", tmp_path, log=None, time=None, lines=None)
    with pytest.raises(uavgram.UavgramError, match="length"):
        uavgram.run(project, output=None)
