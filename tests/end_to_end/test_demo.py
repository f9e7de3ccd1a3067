"""`uavgram demo`: a survey with known truth, from nothing to results."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from flight_projects import Demo

import uavgram
from uavgram.io.files import photo_files
from uavgram.model.result.result import Result
from uavgram.pipeline.measure.outputs import ReportPictures


@pytest.fixture(scope="module")
def result(demo: Demo) -> Result:
    return uavgram.load_results(demo.out / "results.json")


def is_number(word: str) -> bool:
    return word.lstrip("+-").replace(".", "", 1).isdigit()


def test_it_ends_well_and_says_where_everything_is(demo: Demo) -> None:
    assert demo.status == 0
    assert demo.stderr == ""
    for name in ("results.json", "report.html", "recording.rrd"):
        assert str(demo.out / name) in demo.stdout
        assert (demo.out / name).stat().st_size > 0
    assert f"uavgram view {demo.out / 'recording.rrd'}" in demo.stdout


def test_each_measurement_is_printed_beside_its_truth(demo: Demo) -> None:
    for row in demo.truth["measurements"]:
        line = next(x for x in demo.stdout.splitlines() if x.startswith(row["name"] + "  "))
        numbers = [float(word) for word in line.replace("±", " ").split() if is_number(word)]
        # speeds are shown in km/h, this one with a digit less, as its sigma deserves
        pace, last = (3.6, 0.1) if "km/h" in line else (1.0, 0.01)
        off = min(abs(number - pace * row["value"]) for number in numbers[2:])
        assert off < 0.6 * last, line
        assert "±" in line


def test_each_picture_is_the_part_of_its_photo(demo: Demo, result: Result) -> None:
    assert not any(str(demo.out.parent) in path for path in result.frames.path)
    frames = replace(result.frames, folder=str(demo.out.parent))  # the file does not hold it
    result = replace(result, frames=frames)
    parts = ReportPictures(result)
    for path in filter(parts.needs_photo, photo_files(result.frames)):
        parts.cut_parts(path)
    pictures = parts.pictures()
    assert len(pictures.shown) > 3
    for one in pictures.shown:
        where, photo = one.region, cv2.imread(photo_files(result.frames)[one.region.frame])
        assert photo is not None
        wanted = photo[where.top_px :, where.left_px :][: where.height_px, : where.width_px]
        shown = cv2.imdecode(np.frombuffer(one.jpeg, np.uint8), cv2.IMREAD_COLOR)
        assert shown is not None
        wanted = cv2.resize(wanted, shown.shape[1::-1], interpolation=cv2.INTER_AREA)
        assert np.abs(shown.astype(float) - wanted).mean() < 4.0


def test_measurements_agree_with_the_truth(demo: Demo, result: Result) -> None:
    known = {row["name"]: row["value"] for row in demo.truth["measurements"]}
    rows = result.measurements
    assert set(rows.name) == set(known)
    z = np.array([(rows.value[i] - known[n]) / rows.sigma[i] for i, n in enumerate(rows.name)])
    assert np.abs(z).max() < 4
    lengths = [i for i, kind in enumerate(rows.kind) if kind == "distance"]
    relative = [abs(rows.value[i] / known[rows.name[i]] - 1) for i in lengths]
    assert np.mean(relative) < 0.003


def test_the_withheld_length_and_the_surveyed_points_judge_it(result: Result) -> None:
    assert "checked" in result.lines.status
    assert len(result.line_checks.name) == result.lines.status.count("checked")
    assert np.abs(result.line_checks.z).max() < 4
    assert len(result.point_checks.label) == 4
    assert result.point_checks.mahalanobis.max() < 4


def test_the_cameras_clock_is_found(demo: Demo, result: Result) -> None:
    offset = result.shared.clock_offset_s
    assert offset is not None
    assert offset.value[0] == pytest.approx(demo.truth["clock_offset_s"], abs=0.05)


def test_every_photo_of_the_demo_is_refined(result: Result) -> None:
    assert set(result.frames.status) == {"refined"}
