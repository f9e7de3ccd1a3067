"""`uavgram new` beside photos that say where they were taken, and nothing else does."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
import pytest
import tagged_jpeg

from uavgram.cli import main
from uavgram.config.project import load_project
from uavgram.io.photos.metadata import APP1, EXIF_HEAD, XMP_HEAD, Segment, build_jpeg, parse_jpeg
from uavgram.io.photos.tagging import ExifGps, set_gps
from uavgram.model.options import GeodeticOrigin

PIX4D = (
    '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax'
    '-ns#"><rdf:Description xmlns:Camera="http://pix4d.com/camera/1.0/" Camera:Yaw="10" '
    'Camera:Pitch="0" Camera:Roll="0" Camera:VertCS="{}"/></rdf:RDF></x:xmpmeta>'
)
MARKERS = '<?xml version="1.0"?>\n<document version="1.2.0"><chunk/></document>\n'


def placed(folder: Path, count: int, xmp: str | None = None, height_m: float = 500.0) -> Path:
    """Photos 11 m apart, 500 m high, which say so in EXIF."""
    folder.mkdir()
    noise = np.random.default_rng(1).integers(0, 255, (48, 64, 3), dtype=np.uint8)
    plain = parse_jpeg(cv2.imencode(".jpg", noise)[1].tobytes())
    assert plain is not None
    for k in range(count):
        gps = ExifGps(
            latitude_deg=47 + 1e-4 * k,
            longitude_deg=8.0,
            height_m=height_m,
            sigma_horizontal_m=2.0,
        )
        tags = [Segment(APP1, EXIF_HEAD + set_gps(None, gps))]
        tags += [Segment(APP1, XMP_HEAD + xmp.encode())] if xmp else []
        data = build_jpeg([*tags, *plain.segments], plain.scan)
        (folder / f"P{k}.jpg").write_bytes(data)
    return folder


@pytest.mark.parametrize(
    ("count", "xmp", "datum"),
    [
        (3, None, "msl"),
        (2, PIX4D.format(""), "msl"),
        (1, PIX4D.format("ellipsoidal"), "ellipsoid"),
    ],
)
def test_the_places_of_the_photos_are_used_and_the_assumed_ground_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], count: int, xmp: str | None, datum: str
) -> None:
    folder = placed(tmp_path / "flight", count, xmp)
    assert main(["new", str(folder)]) == 0
    said = capsys.readouterr().out
    assert "The photos state where they were taken: `poses: exif` uses that." in said
    assert "60 m ± 40 m was assumed" in said
    assert "nor poses" not in said
    project = load_project(folder / "project.yaml")
    assert project.poses == "exif"
    origin = project.world.origin
    assert isinstance(origin, GeodeticOrigin)
    assert (origin.latitude_deg, origin.longitude_deg, origin.height_m) == (47.0, 8.0, 440.0)
    assert (project.ground.height_sigma_m, project.world.heights) == (40.0, datum)
    assert main(["check", str(folder / "project.yaml")]) == 0


def test_a_height_above_take_off_with_the_wrong_sign_is_reported_and_not_used(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tags = tagged_jpeg.dji(AbsoluteAltitude="+500.00", RelativeAltitude="-60.00").decode()
    folder = placed(tmp_path / "flight", 3, tags)
    assert main(["new", str(folder)]) == 0
    said = capsys.readouterr().out
    assert "the height above take-off that the tags state (-60.0 m)" in said
    origin = load_project(folder / "project.yaml").world.origin
    assert isinstance(origin, GeodeticOrigin)
    assert origin.height_m == 440.0


@pytest.mark.parametrize("height_m", [0.0, -440.0])
def test_an_altitude_that_cannot_be_right_is_named_where_no_home_remains(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], height_m: float
) -> None:
    folder = placed(tmp_path / "flight", 2, tagged_jpeg.dji().decode(), height_m)
    assert main(["new", str(folder)]) == 0
    project = folder / "project.yaml"
    text = re.sub(r"world:\n(?: .*\n)*", "", project.read_text())
    project.write_text(text if "poses: exif" in text else f"{text}poses: exif\n")
    capsys.readouterr()
    assert main(["check", str(folder)]) == 1
    said = capsys.readouterr().err
    assert "P0 and P1 cannot have been taken at the altitude that the tags state" in said
    assert f"({height_m:.1f} m)" in said
    assert "set world.origin" in said


def test_every_table_that_a_new_project_names_is_there(tmp_path: Path) -> None:
    folder = placed(tmp_path / "flight", 2)
    assert main(["new", str(folder)]) == 0
    project = load_project(folder / "project.yaml")
    for name in (project.picks, project.lines, project.measure):
        assert name is not None
        assert (folder / name).is_file()


def test_markers_of_another_program_are_no_camera(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = placed(tmp_path / "flight", 2)
    (folder / "marker.xml").write_text(MARKERS, encoding="utf-8")
    assert main(["new", str(folder)]) == 0
    assert "marker.xml" not in capsys.readouterr().out
    assert main(["camera", str(folder / "marker.xml")]) == 1
    assert "marker.xml: is XML of another program" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "text", "line"),
    [
        ("a.yml", "%YAML:1.0\n---\ncamera_matrix: [1, 2\n", 3),
        ("b.yaml", "width: 3\nK: [1, 2\nz: }", 3),
        ("c.json", '{"K": [1,2}', 1),
        ("d.xml", '<?xml version="1.0"?>\n<opencv_storage><a>1</a>', 2),
    ],
)
def test_a_broken_calibration_is_told_by_its_line_and_without_a_librarys_words(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, text: str, line: int
) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    assert main(["camera", str(tmp_path / name)]) == 1
    said = capsys.readouterr().err
    assert f"{name}:{line}: cannot be read as a calibration file" in said
    assert ".cpp" not in said
    assert "OpenCV(" not in said
