"""Photos of a calibration board as files: one clear message for each that does not belong."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from uavgram.errors import InputError
from uavgram.io.photos import board_photos as calibration_photos
from uavgram.io.photos.board_photos import CalibrationFiles, find_calibration_photos, read_grey
from uavgram.io.photos.camera_tags import read_all_camera_tags
from uavgram.model.camera.tags import CameraTags


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Four small photos, all different."""
    for k in range(4):
        photo = np.full((48, 64), 40 * k, np.uint8)
        photo[5, 7] = 255
        assert cv2.imwrite(str(tmp_path / f"{k}.png"), photo)
    return tmp_path


def find(folder: Path) -> CalibrationFiles:
    return find_calibration_photos([str(folder / "*.png")])


def test_photos_are_found_once_in_the_order_of_their_names(folder: Path) -> None:
    files = find_calibration_photos([str(folder / "2.png"), str(folder / "*.png")])
    assert [path[-5:] for path in files.path] == ["0.png", "1.png", "2.png", "3.png"]
    assert (files.width_px, files.height_px) == (64, 48)
    assert [digest.path for digest in files.digest] == list(files.path)
    assert files.setting[0].camera == ""
    assert files.setting[0].focal_length_mm is None


def test_grey_values_are_those_of_the_file(folder: Path) -> None:
    grey = read_grey(folder / "1.png")
    assert grey.shape == (48, 64)
    assert grey[5, 7] == 255
    assert grey[0, 0] == 40


@pytest.mark.parametrize("content", [b"", b"no photo", b"\xff\xd8\xff\xe0 cut"])
def test_what_is_no_photo_is_named(folder: Path, content: bytes) -> None:
    (folder / "1.png").write_bytes(content)
    with pytest.raises(InputError, match="no photo") as caught:
        read_grey(folder / "1.png")
    assert caught.value.path.endswith("1.png")
    with pytest.raises(InputError, match="no photo"):
        find(folder)


def test_a_missing_photo_is_named(folder: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        read_grey(folder / "9.png")
    with pytest.raises(InputError, match="matches no file"):
        find_calibration_photos([str(folder / "*.jpg")])


def test_one_photo_is_too_few(folder: Path) -> None:
    with pytest.raises(InputError, match="1 of the 3 photos"):
        find_calibration_photos([str(folder / "1.png")])


def test_a_copy_is_named_with_its_original(folder: Path) -> None:
    shutil.copy(folder / "1.png", folder / "5.png")
    with pytest.raises(InputError, match=r"copy of .*1\.png") as caught:
        find(folder)
    assert caught.value.path.endswith("5.png")


def test_mixed_sizes_are_refused(folder: Path) -> None:
    cv2.imwrite(str(folder / "4.png"), np.zeros((64, 48), np.uint8))
    with pytest.raises(InputError, match="48 x 64 pixels") as caught:
        find(folder)
    assert caught.value.path.endswith("4.png")


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("model", "FC220", "another camera"),
        ("serial", "B2", "serial number"),
        ("focal_mm", 4.7, "focal length of 4.7 mm"),
    ],
)
def test_two_cameras_or_zooms_are_refused(
    folder: Path, monkeypatch: pytest.MonkeyPatch, field: str, value: str | float, words: str
) -> None:
    from dataclasses import replace

    other: dict[str, Any] = {field: value}

    def tagged(paths: Iterable[str]) -> tuple[CameraTags, ...]:
        tags = [
            replace(tag, make="DJI", model="FC300X", serial="A1", focal_mm=3.61)
            for tag in read_all_camera_tags(paths)
        ]
        return (*tags[:2], replace(tags[2], **other), tags[3])

    monkeypatch.setattr(calibration_photos, "read_all_camera_tags", tagged)
    with pytest.raises(InputError, match=words) as caught:
        find(folder)
    assert caught.value.path.endswith("2.png")


def test_a_drones_photos_tell_camera_and_lens(data_dir: Path) -> None:
    files = find_calibration_photos([str(data_dir / "phantom3_lenscalib" / "*.jpg")])
    assert len(files.path) == 6
    assert (files.width_px, files.height_px) == (4000, 2250)
    assert files.setting[0].camera == "DJI FC300X"
    assert files.setting[0].focal_length_mm == pytest.approx(3.61)
    assert files.setting[0].focal_length_35mm == 20
