"""`ties` of project.yaml: a file, `auto`, or nothing."""

from __future__ import annotations

from pathlib import Path

import pytest

from uavgram.config.project import load_project
from uavgram.errors import InputError


def project(folder: Path, more: str) -> Path:
    for name in ("camera.yaml", "picks.csv"):
        (folder / name).touch()
    path = folder / "project.yaml"
    path.write_text(f"images: '*.jpg'\ncamera: camera.yaml\npicks: picks.csv\n{more}")
    return path


def test_a_project_need_not_name_any(tmp_path: Path) -> None:
    assert load_project(project(tmp_path, "")).ties is None


def test_a_file_becomes_absolute_and_auto_stays(tmp_path: Path) -> None:
    (tmp_path / "t.csv").touch()

    assert load_project(project(tmp_path, "ties: t.csv\n")).ties == str(tmp_path / "t.csv")
    assert load_project(project(tmp_path, "ties: auto\n")).ties == "auto"


def test_a_file_that_is_missing_says_who_makes_it(tmp_path: Path) -> None:
    path = project(tmp_path, "ties: ties.csv\n")

    with pytest.raises(InputError, match=r":4: .*no such file 'ties.csv'.*`uavgram picks ties`"):
        load_project(path)
    assert load_project(path, unfinished=True).ties == str(tmp_path / "ties.csv")


def test_an_empty_name_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="ties"):
        load_project(project(tmp_path, "ties: ''\n"))
