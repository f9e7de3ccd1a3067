"""Folders near a project that hold photos: found, whatever else lies there."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from uavgram.errors import InputError
from uavgram.io import folders
from uavgram.io.folders import Browsable, find_flights, find_home_and_drives, find_photo_folders

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
    monkeypatch.setattr(folders, "MAX_SEARCHED_FOLDERS", 1)
    assert [one.path for one in find_photo_folders(project, 3)] == [project]


def test_what_leads_elsewhere_is_not_followed(project: Path, tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    for k in range(3):
        (elsewhere / f"{k}.jpg").write_bytes(PHOTO)
    (project / "link").symlink_to(elsewhere)
    assert "link" not in {one.path.name for one in find_photo_folders(project, 3)}


# Folders that a page may show: below the roots, neither hidden nor behind links.


@pytest.fixture
def home(tmp_path: Path) -> Path:
    home = tmp_path / "home"
    for name in ("Fälle/A/photos", ".ssh", "empty"):
        (home / name).mkdir(parents=True)
    for k in range(3):
        (home / "Fälle" / "A" / "photos" / f"{k}.JPG").write_bytes(b"x")
    (home / "Fälle" / "A" / "photos" / "._0.JPG").write_bytes(b"x")
    (tmp_path / "secret").mkdir()
    (home / "way out").symlink_to(tmp_path / "secret")
    return home


def test_names_and_numbers_of_photos_are_listed(home: Path) -> None:
    folders = Browsable([home, home / "gone"])
    assert folders.roots == (home,)
    assert [one.path.name for one in folders.folders_in(home)] == ["empty", "Fälle"]
    (case,) = folders.folders_in(home / "Fälle")
    assert (case.path.name, case.photos, case.has_project) == ("A", 3, False)
    (home / "Fälle" / "A" / "project.yaml").write_text("")
    assert folders.folders_in(home / "Fälle")[0].has_project


def test_flights_are_found_wherever_they_are_the_newest_first(home: Path) -> None:
    old, new, with_log = home / "Fälle" / "A" / "photos", home / "x" / "y" / "new", home / "z"
    for folder in (new, with_log / "photos"):
        folder.mkdir(parents=True)
        (folder / "1.jpg").write_bytes(b"x")
    (with_log / "flight.BIN").write_bytes(b"x")
    (home / "notes.txt").write_text("")
    (home / "way out").unlink()
    (home / "way out").symlink_to(new)
    for moment, folder in enumerate((old, with_log, new)):
        os.utime(folder, (moment, moment))
    assert [one.path for one in find_flights([home])] == [new, with_log, old]


def test_a_search_for_flights_ends(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(folders, "MAX_SEARCHED_FOLDERS", 3)  # the home, two folders in it
    assert find_flights([home]) == []


@pytest.mark.parametrize(
    "inside", ["..", "../secret", "way out", "way out/..", ".ssh", "Fälle/../../secret", "no", "A"]
)
def test_nothing_else_can_be_asked_for(home: Path, inside: str) -> None:
    folders = Browsable([home])
    with pytest.raises(InputError):
        folders.folders_in(home / inside)
    with pytest.raises(InputError):
        folders.check_folder(Path(f"{home}/{inside}"))


def test_a_folder_that_becomes_a_link_is_refused(home: Path) -> None:
    folders = Browsable([home])
    found = next(one.path for one in folders.folders_in(home) if one.path.name == "empty")
    found.rmdir()
    found.symlink_to(home.parent / "secret")
    with pytest.raises(InputError, match="link"):
        folders.check_folder(found)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_what_may_not_be_read_is_one_message(home: Path) -> None:
    (home / "empty").chmod(0)
    with pytest.raises(InputError, match="cannot be read"):
        Browsable([home]).folders_in(home / "empty")


def test_drives_are_found_where_each_system_mounts_them() -> None:
    assert find_home_and_drives("darwin", {})[0] == Path.home()
    assert find_home_and_drives("linux", {"USER": "nobody-at-all"})[0] == Path.home()
    assert find_home_and_drives("win32", {})[0] == Path.home()
