"""Folders that a page may show: below the roots, neither hidden nor behind links."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from uavgram.errors import InputError
from uavgram.io.browse import Browsable, find_home_and_drives


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


@pytest.mark.parametrize(
    "inside", ["..", "../secret", "way out", "way out/..", ".ssh", "Fälle/../../secret", "no", "A"]
)
def test_nothing_else_can_be_asked_for(home: Path, inside: str) -> None:
    folders = Browsable([home])
    with pytest.raises(InputError):
        folders.folders_in(home / inside)
    with pytest.raises(InputError):
        folders.checked(Path(f"{home}/{inside}"))


def test_a_folder_that_becomes_a_link_is_refused(home: Path) -> None:
    folders = Browsable([home])
    found = next(one.path for one in folders.folders_in(home) if one.path.name == "empty")
    found.rmdir()
    found.symlink_to(home.parent / "secret")
    with pytest.raises(InputError, match="link"):
        folders.checked(found)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_what_may_not_be_read_is_one_message(home: Path) -> None:
    (home / "empty").chmod(0)
    with pytest.raises(InputError, match="cannot be read"):
        Browsable([home]).folders_in(home / "empty")


def test_drives_are_found_where_each_system_mounts_them() -> None:
    assert find_home_and_drives("darwin", {})[0] == Path.home()
    assert find_home_and_drives("linux", {"USER": "nobody-at-all"})[0] == Path.home()
    assert find_home_and_drives("win32", {})[0] == Path.home()
