"""`camera: unknown`: whole surveys with a camera that nobody knows, against their truth."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Protocol

import numpy as np
import pytest
import yaml
from camera_facts import CameraFacts
from camera_photos import camera_photo
from flight_projects import Truth
from scipy.stats import norm

import uavgram
from uavgram.errors import InputError
from uavgram.io.photos.metadata import APP1, build_jpeg, parse_jpeg
from uavgram.io.results.results_json import write_results
from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result
from uavgram.pipeline.check import check
from uavgram.views.report import render_annex


class TwinOf(Protocol):
    def __call__(self, name: str, **changes: object) -> tuple[Path, Truth]: ...


FEW = 12
"""Measurements of a twin that are judged: each costs time for its second order."""


@pytest.fixture
def twin_of(data_dir: Path, tmp_path: Path) -> TwinOf:
    """A twin's project with an unknown camera and some of its measurements."""

    def make(name: str, **changes: object) -> tuple[Path, Truth]:
        source = data_dir / name
        project = yaml.safe_load((source / "project.yaml").read_text())
        for key in ("log", "picks", "lines", "images"):
            project[key] = str(source / project[key])
        header, *rows = (source / "measure.csv").read_text().splitlines()
        step = len(rows) // FEW
        (tmp_path / "measure.csv").write_text("\n".join([header, *rows[::step][:FEW]]) + "\n")
        project |= {"camera": "unknown", "measure": "measure.csv", **changes}
        project = {key: value for key, value in project.items() if value is not None}
        path = tmp_path / "project.yaml"
        path.write_text(yaml.safe_dump(project))
        truth = json.loads((data_dir / "truth" / f"{name}.json").read_text())
        return path, truth

    return make


def judged(result: Result, truth: Truth) -> Floats:
    """Errors of the measurements, in their sigmas."""
    measured = result.measurements
    true = np.array([truth["measurements"][name] for name in measured.name])
    errors: Floats = (measured.value - true) / measured.sigma
    return errors


def test_a_flight_with_lengths_is_measured_within_its_sigmas_and_learns_the_camera(
    twin_of: TwinOf, tmp_path: Path
) -> None:
    project, truth = twin_of("wind_oblique")
    result = uavgram.run(project, output=None)
    camera = result.shared.intrinsics
    z = judged(result, truth)

    assert result.solution.converged
    # All share one camera, so they are not independent: the largest, for so many.
    assert np.abs(z).max() < norm.isf(0.001 / 2 / FEW)
    assert (result.measurements.sigma < 0.02 * result.measurements.value).all()
    true = np.array(truth["intrinsics"])
    assert (np.abs(camera.value - true) < 3 * camera.sigma).all()
    assert camera.sigma[0] < 0.05 * camera.value[0]
    file = tmp_path / "results.json"
    write_results(result, file)
    said = [m["text"] for m in json.loads(file.read_text())["messages"]]
    (text,) = [text for text in said if text.startswith("Nothing is known of this camera")]
    assert "calibrate it from these photos" in text
    assert "Nothing is known of this camera" in render_annex(result)


@pytest.mark.parametrize("name", ["calm_nadir", "wind_oblique"])
def test_a_strip_without_a_log_comes_to_rest_within_its_sigmas(twin_of: TwinOf, name: str) -> None:
    """Lengths in a few of the photos alone: focal length, heights and tilts change together."""
    project, truth = twin_of(name, log=None, time=None)
    result = uavgram.run(project, output=None)

    assert result.solution.converged
    assert result.solution.variance_factor < 1.3
    assert np.abs(judged(result, truth)).max() < norm.isf(0.001 / 2 / FEW)


def test_a_real_photo_without_tags_has_its_focal_length_from_four_targets(
    data_dir: Path, tmp_path: Path
) -> None:
    folder = data_dir / "narrabeen_mavic"
    still = "snapshotNarrabeen.JPG"
    parsed = parse_jpeg((folder / still).read_bytes())
    assert parsed is not None
    bare = [segment for segment in parsed.segments if segment.marker != APP1]
    (tmp_path / still).write_bytes(build_jpeg(bare, parsed.scan))
    control = json.loads((folder / "control.json").read_text())
    first = np.array(control["points"][0]["xyz"])
    rows = [
        f"{p['id']},{','.join(map(str, np.array(p['xyz']) - first))},0.2" for p in control["points"]
    ]
    text = "\n".join(["label,east_m,north_m,up_m,sigma_m", *rows])
    (tmp_path / "control.csv").write_text(text + "\n")
    seen = next(p for p in control["photos"] if p["file"] == still)["observations"]
    picks = [f"{still},{o['id']},{o['uv'][0]},{o['uv'][1]}" for o in seen]
    (tmp_path / "picks.csv").write_text("\n".join(["image,label,u_px,v_px", *picks]) + "\n")
    project = tmp_path / "project.yaml"
    content = {"images": still, "camera": "unknown", "picks": "picks.csv", "control": "control.csv"}
    project.write_text(yaml.safe_dump(content))
    result = uavgram.run(project, output=None)
    camera = result.shared.intrinsics

    assert result.solution.converged
    assert abs(camera.value[0] - 3120.0) < 2 * camera.sigma[0]  # by resection on the targets
    assert camera.sigma[0] < 0.1 * camera.value[0]  # 20 % before


TWO_PHOTOS = """image,label,u_px,v_px,sigma_px
IMG_0005.jpg,P1,929.36,377.70,
IMG_0005.jpg,P2,1006.14,573.91,
IMG_0005.jpg,P3,1424.14,261.11,
IMG_0005.jpg,P4,1438.36,175.80,
IMG_0005.jpg,P5,863.95,320.83,
IMG_0005.jpg,P6,1111.35,420.35,
IMG_0005.jpg,P7,1512.30,630.78,
IMG_0005.jpg,P8,1492.39,238.36,
IMG_0005.jpg,P9,1204.60,374.21,
IMG_0005.jpg,P11,1270.78,942.09,
IMG_0006.jpg,P1,924.62,743.19,
IMG_0006.jpg,P2,1002.85,939.76,
IMG_0006.jpg,P3,1420.21,622.02,
IMG_0006.jpg,P4,1433.70,534.74,
IMG_0006.jpg,P5,858.22,685.99,
IMG_0006.jpg,P6,1107.00,783.11,
IMG_0006.jpg,P7,1505.34,991.95,
IMG_0006.jpg,P8,1488.34,599.43,
IMG_0006.jpg,P9,1199.50,738.84,
IMG_0006.jpg,P11,1264.90,1301.87,
"""
"""A newcomer's clicks in two photos of a twin, rounded (an outside examination)."""

TAPED_M = {"L1": 6.98, "L2": 2.94, "L3": 8.87, "L4": 13.18}
TRUE_M = {"D1": 19.359, "D3": 19.000}


@pytest.mark.parametrize(
    ("wrong", "codes", "lengths"),
    [
        ({}, (), ()),
        ({"L4": 31.18}, ("line-suspect",), ("L4",)),
        ({"L4": 18.13}, ("line-wrong-digit", "line-left-out"), ("L4",)),
        ({"L4": 43.24}, ("line-suspect",), ("L4",)),
        ({"L1": 8.87, "L3": 6.98}, ("lines-exchanged",), ("L1", "L3")),
    ],
    ids=["right", "digits exchanged", "digits rotated", "feet", "readings exchanged"],
)
def test_a_length_that_nothing_else_checks_is_named_and_no_camera(
    data_dir: Path,
    tmp_path: Path,
    wrong: dict[str, float],
    codes: tuple[str, ...],
    lengths: tuple[str, ...],
) -> None:
    """Four lengths alone place two photos: a wrong one draws them to it, and has no residual."""
    ends = {"L1": "P1,P2", "L2": "P3,P4", "L3": "P5,P6", "L4": "P7,P8"}
    rows = [f"{name},{ends[name]},{m},0.01" for name, m in (TAPED_M | wrong).items()]
    (tmp_path / "lines.csv").write_text("\n".join(["name,from,to,length_m,sigma_m", *rows]) + "\n")
    (tmp_path / "picks.csv").write_text(TWO_PHOTOS)
    requests = "name,kind,points,parameters\nD1,distance,P1;P8,\nD3,distance,P11;P9,\n"
    (tmp_path / "measure.csv").write_text(requests)
    photos = [str(data_dir / "street_nadir" / "photos" / f"IMG_000{k}.jpg") for k in (5, 6)]
    tables = {name: f"{name}.csv" for name in ("picks", "lines", "measure")}
    project = tmp_path / "project.yaml"
    project.write_text(yaml.safe_dump({"images": photos, "camera": "unknown", **tables}))
    result = uavgram.run(project, output=None)
    measured, verdict = result.measurements, result.verdict
    assert verdict is not None
    first = verdict.reasons[:1] if wrong else ()

    assert tuple(one.cause in codes for one in first) == (True,) * bool(wrong)
    assert tuple(name for one in first for name in one.lengths) == lengths
    assert not any("camera file" in one.text for one in verdict.reasons)
    true = np.array([TRUE_M[name] for name in measured.name])
    assert (np.abs(measured.value - true) < 3.0 * measured.sigma).all()


def test_what_the_photos_say_is_used_where_they_say_something(tmp_path: Path) -> None:
    camera_photo(tmp_path / "a.jpg", make="DJI", model="FC220", focal=(47, 10))
    (tmp_path / "picks.csv").write_text("image,label,u_px,v_px\na.jpg,p,20,10\n")
    seen = []
    for camera in ("auto", "unknown"):
        (tmp_path / "project.yaml").write_text(
            f"images: a.jpg\ncamera: {camera}\npicks: picks.csv\n"
        )
        checked = check(tmp_path / "project.yaml")
        assert {"camera-assumed"} == {m.code for m in checked.messages if "camera" in m.code}
        seen.append(checked.inputs.calibration)
    np.testing.assert_array_equal(seen[0].parameters, seen[1].parameters)
    np.testing.assert_array_equal(seen[0].covariance, seen[1].covariance)


@pytest.mark.parametrize(
    ("other", "words"),
    [
        ({"size": (300, 400)}, "b.jpg: is turned by 90 degrees (300 x 400 px"),
        ({"make": "Parrot", "model": "BEBOP 2"}, "b.jpg: comes from another camera"),
    ],
)
def test_photos_that_no_one_camera_can_have_taken_are_refused(
    tmp_path: Path, other: CameraFacts, words: str
) -> None:
    camera_photo(tmp_path / "a.jpg")
    camera_photo(tmp_path / "b.jpg", **other)
    (tmp_path / "picks.csv").write_text("image,label,u_px,v_px\na.jpg,p,20,10\n")
    project = tmp_path / "project.yaml"
    project.write_text("images: '*.jpg'\ncamera: unknown\npicks: picks.csv\n")
    with pytest.raises(InputError) as refused:
        check(project)
    assert words in str(refused.value)
