"""A calibration beside a project: its folder is new, and the project changes in one line."""

from __future__ import annotations

from pathlib import Path

import pytest
from pick_pages import small_project

from uavgram.config.project import load_project
from uavgram.config.project_text import apply_settings
from uavgram.errors import InputError
from uavgram.io.folders import PhotoFolder
from uavgram.model.board import CalibrationOptions
from uavgram.pipeline import calibrate as calibrate_nearby
from uavgram.pipeline.calibrate import calibrate_folder, find_board_folders, use_camera


@pytest.fixture
def project(tmp_path: Path) -> Path:
    return small_project(tmp_path)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("name: a\ncamera: camera.yaml\nlog: x\n", "name: a\ncamera: new/c.yaml\nlog: x\n"),
        ("camera: unknown\nx: 1\n", "camera: new/c.yaml\nx: 1\n"),
        ("camera: auto   # assumed\n", "camera: new/c.yaml   # assumed\n"),
        ("camera: 'my # cam.yaml'\r\nx: 1\r\n", "camera: new/c.yaml\r\nx: 1\r\n"),
        ('camera: "a b.yaml"', "camera: new/c.yaml"),
        ("a:\n  camera: x\n", "a:\n  camera: x\ncamera: new/c.yaml\n"),
        ("camera:\n  camera.yaml\n", None),
        ("camera: >\n  x\n", None),
        ("name: a\n", "name: a\ncamera: new/c.yaml\n"),
    ],
)
def test_one_line_names_the_camera_and_nothing_else_changes(before: str, after: str | None) -> None:
    assert apply_settings(before, {"camera": "new/c.yaml"}) == after


def test_a_name_that_yaml_would_misread_is_quoted() -> None:
    assert apply_settings("camera: a\n", {"camera": "- #1.yaml"}) == 'camera: "- #1.yaml"\n'


def test_a_calibrated_camera_takes_the_place_of_one_that_nobody_knows(
    project: Path, tmp_path: Path
) -> None:
    text = project.read_text()
    project.write_text(text.replace("camera: camera.yaml", "camera: unknown  # so far"))
    assert load_project(project, unfinished=True).camera_file is None
    use_camera(project, tmp_path / "camera.yaml")
    assert project.read_text() == text.replace("camera.yaml", "camera.yaml  # so far")
    assert load_project(project, unfinished=True).camera_file == str(tmp_path / "camera.yaml")


def test_a_camera_that_is_not_there_leaves_the_project_as_it_was(
    project: Path, tmp_path: Path
) -> None:
    before = project.read_bytes()
    with pytest.raises(InputError, match="no such file"):
        use_camera(project, tmp_path / "gone.yaml")
    assert project.read_bytes() == before


def test_a_project_whose_camera_stands_in_no_line_says_what_to_write(
    project: Path, tmp_path: Path
) -> None:
    project.write_text(project.read_text().replace("camera: camera.yaml", "camera:\n  camera.yaml"))
    with pytest.raises(InputError, match=r"write `camera: calibration/camera\.yaml`"):
        use_camera(project, tmp_path / "calibration" / "camera.yaml")


def test_every_calibration_gets_a_folder_of_its_own(
    project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written = []
    monkeypatch.setattr(calibrate_nearby, "calibrate", lambda *args, **_: written.append(args))
    folder = PhotoFolder(path=tmp_path, files=(tmp_path / "a [1].jpg",), size_px=(4, 3))
    for name in ("", "calibration", "calibration-7", "calibration-x"):
        (tmp_path / name).mkdir(exist_ok=True)
        calibrate_folder(project, folder, "chessboard:9x6:25mm", CalibrationOptions())
    outputs = [args[2].name for args in written]
    assert outputs == ["calibration", "calibration-2", "calibration-8", "calibration-8"]
    assert written[0][0] == [str(tmp_path / "a [[]1].jpg")]


def test_folders_with_too_few_photos_are_not_offered(tmp_path: Path) -> None:
    project = small_project(tmp_path / "flight")  # what lies beside the flight is looked at too
    assert find_board_folders(project) == ()  # two photos
