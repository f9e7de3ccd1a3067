"""Files that patterns name: within bounds, and files indeed."""

from __future__ import annotations

import fnmatch
import os
import re
from collections.abc import Iterable
from pathlib import Path

import pytest
from pick_pages import small_project

from uavgram.cli import main
from uavgram.errors import InputError
from uavgram.io import files as photo_files
from uavgram.io.files import digest_file, digest_inputs, find_matching_files


@pytest.fixture
def project(tmp_path: Path) -> Path:
    return small_project(tmp_path / "flight")


def test_a_pipe_among_the_photos_is_named_as_one(
    project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("picks", "lines", "measure"):
        text = project.read_text(encoding="utf-8").replace(f"{name}: {name}.csv\n", "")
        project.write_text(
            text + ("picks: picks.csv\n" if name == "picks" else ""), encoding="utf-8"
        )
    (project.parent / "picks.csv").write_text("image,label,u_px,v_px\n", encoding="utf-8")
    os.mkfifo(project.parent / "photos" / "P3.jpg")
    assert main(["check", str(project)]) == 1
    assert "P3.jpg: is a FIFO (a pipe between programs), no file" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("/dev/null", "/dev/null: is a device, no file"),
        (".", "is a folder, no file"),
        ("gone.jpg", "gone.jpg: is a link to a file that is not there"),
        ("absent.jpg", "absent.jpg: matches no file (capitals count); correct it"),
    ],
)
def test_what_is_no_file_is_named_as_what_it_is(tmp_path: Path, name: str, said: str) -> None:
    (tmp_path / "gone.jpg").symlink_to("nowhere.jpg")
    with pytest.raises(InputError) as caught:
        find_matching_files(str(tmp_path / name), "correct it")
    assert said in str(caught.value)


def test_folders_that_a_wildcard_meets_are_passed_over(tmp_path: Path) -> None:
    (tmp_path / "more").mkdir()
    (tmp_path / "a.jpg").touch()
    (tmp_path / "more" / "b.jpg").touch()
    found = find_matching_files(str(tmp_path / "**"), "")
    assert [path.name for path in found] == ["a.jpg", "b.jpg"]


def test_pipes_in_place_of_tables_logs_and_projects_do_not_hold_anyone_up(
    project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = project.parent
    os.mkfifo(folder / "flight.BIN")
    project.write_text(project.read_text(encoding="utf-8") + "\nlog: flight.BIN\n")
    assert main(["check", str(project)]) == 1
    assert "'flight.BIN' is a FIFO" in capsys.readouterr().err
    project.unlink()
    for name in ("tape.csv", "camera.json", "x.jpg", "flight.tlog"):
        os.mkfifo(folder / name)
    assert main(["new", str(folder)]) == 0
    project.unlink()
    os.mkfifo(project)
    assert main(["check", str(project)]) == 1
    assert "project.yaml: is a FIFO" in capsys.readouterr().err


@pytest.mark.parametrize(
    "command", ["log F", "camera F", "picks import F.txt --output p.csv", "camera F.jpg"]
)
def test_no_command_waits_for_a_pipe(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    command: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("F", "F.txt", "F.jpg"):
        os.mkfifo(name)
    assert main(command.split()) == 1
    assert "is a FIFO (a pipe between programs), no file" in capsys.readouterr().err


@pytest.mark.parametrize("pattern", ["**", "**/*.jpg", "deep/**/*.jpg", "*"])
def test_a_pattern_beyond_reason_ends_early(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, pattern: str
) -> None:
    (tmp_path / "deep").mkdir()
    for k in range(12):
        (tmp_path / f"{k}.txt").touch()
        (tmp_path / "deep" / f"{k}.txt").touch()
    monkeypatch.setattr(photo_files, "MAX_ENTRIES", 10)
    with pytest.raises(InputError, match=r"more than 10 files.* such as photos/\*\.jpg"):
        find_matching_files(str(tmp_path / pattern), "")


def test_a_circle_of_links_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("one", "two"):
        (tmp_path / name).symlink_to(tmp_path, target_is_directory=True)
    monkeypatch.setattr(photo_files, "MAX_ENTRIES", 1000)
    with pytest.raises(InputError, match="looks through more than 1,000"):
        find_matching_files(str(tmp_path / "**" / "*.jpg"), "")


def test_new_in_a_folder_of_everything_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for k in range(12):
        (tmp_path / f"{k}.txt").touch()
    monkeypatch.setattr(photo_files, "MAX_ENTRIES", 10)
    assert main(["new", str(tmp_path)]) == 1
    assert "holds more than 10 files: name the folder of one flight" in capsys.readouterr().err


def test_invisible_characters_in_a_project_are_told_by_line(
    project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = project.read_text(encoding="utf-8")
    project.write_text(f"{text}\noperator: \u202eecila\n", encoding="utf-8")
    assert main(["check", str(project)]) == 1
    assert "operator: holds the invisible character U+202E" in capsys.readouterr().err


def test_the_digest_is_that_of_fips_180(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"abc")

    digest = digest_file(path)
    # NIST FIPS 180-2, appendix B.1
    assert digest.sha256 == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    assert digest.size_bytes == 3
    assert digest.path == str(path)


def test_paths_inside_the_project_are_relative_and_each_file_stands_once(tmp_path: Path) -> None:
    inside, outside = tmp_path / "project" / "photos" / "a.jpg", tmp_path / "camera.yaml"
    inside.parent.mkdir(parents=True)
    inside.touch()
    outside.touch()

    digests = digest_inputs([inside, outside, inside], tmp_path / "project")
    assert [d.path for d in digests] == ["photos/a.jpg", str(outside)]


def test_a_missing_file_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        digest_file(tmp_path / "absent")


def test_capitals_count_on_every_system(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def as_on_windows(names: Iterable[str], pattern: str) -> list[str]:
        rule = re.compile(fnmatch.translate(pattern), re.IGNORECASE)
        return [name for name in names if rule.match(name)]

    monkeypatch.setattr(fnmatch, "filter", as_on_windows)
    for name in ("a.JPG", "b.JPG", "c.jpg"):
        (tmp_path / name).write_bytes(b"")
    found = find_matching_files(str(tmp_path / "*.JPG"), "")
    assert [path.name for path in found] == ["a.JPG", "b.JPG"]
    with pytest.raises(InputError, match="capitals count"):
        find_matching_files(str(tmp_path / "*.jpeg"), "")
