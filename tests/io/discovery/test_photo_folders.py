"""Folders near a project that hold photos: found, whatever else lies there."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from uavgram.io import discovery
from uavgram.io.discovery import find_photo_folders

PHOTO = cv2.imencode(".jpg", np.zeros((30, 40, 3), np.uint8))[1].tobytes()


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A project's folder beside others, with photos of all sorts."""
    folder = tmp_path / "flights" / "project"
    for place in (
        *(
            "",
            "photos",
            "deep/er/yet",
            "deep/er/yet/too-deep",
            ".hidden",
            "out",
            "calibration/found",
        ),
        *("../board", "../board/inner", "../empty"),
    ):
        (folder / place).mkdir(parents=True, exist_ok=True)
        for k in range(3 if place != "../empty" else 2):
            (folder / place / f"P{k}.JPG").write_bytes(PHOTO)
    (folder / "out" / "results.json").write_text("{}")
    (folder / "calibration" / "calibration.json").write_text("{}")
    (folder / "texts").mkdir()
    for k in range(3):
        (folder / "texts" / f"{k}.jpg").write_text("no photo")
    return folder


def test_folders_in_the_project_and_beside_it_are_found(project: Path) -> None:
    found = {folder.path for folder in find_photo_folders(project, 3)}
    beside = project.parent
    assert found == {
        project,
        project / "photos",
        project / "deep" / "er" / "yet",
        beside / "board",
    }


def test_each_says_how_many_photos_it_holds_and_of_which_size(project: Path) -> None:
    one = next(one for one in find_photo_folders(project, 3) if one.path.name == "photos")
    assert [path.name for path in one.files] == ["P0.JPG", "P1.JPG", "P2.JPG"]
    assert one.size_px == (40, 30)


def test_a_folder_that_is_too_large_is_not_looked_through(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(discovery, "MAX_FOLDERS", 1)
    assert [one.path for one in find_photo_folders(project, 3)] == [project]


def test_what_leads_elsewhere_is_not_followed(project: Path, tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    for k in range(3):
        (elsewhere / f"{k}.jpg").write_bytes(PHOTO)
    (project / "link").symlink_to(elsewhere)
    assert "link" not in {one.path.name for one in find_photo_folders(project, 3)}
