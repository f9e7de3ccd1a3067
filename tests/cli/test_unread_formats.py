"""Formats that are not read: one message with the way out, wherever they are handed in."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from small_projects import Command, Project

DNG = cv2.imencode(".tif", np.zeros((8, 8), np.uint8))[1].tobytes()[:8] + (
    b"\x01\x00\x12\xc6\x01\x00\x04\x00\x00\x00\x01\x04\x00\x00\x00\x00\x00\x00"
)
FILES = {
    "flight.SRT": (
        b"\xef\xbb\xbf1\r\n00:00:00,000 --> 00:00:00,033\r\n[latitude: 47.1]\r\n\r\n",
        "subtitle file",
    ),
    "subtitles.txt": (b"7\n00:00:01,000 --> 00:00:02,000\nF/2.8\n", "subtitle file"),
    "rover.pos": (b"% program   : RTKPOST ver.2.4.3\n% obs start : 2024/02/03\n", "RTKLIB"),
    "events.txt": (b"%  GPST   latitude(deg) longitude(deg)\n2024/02/03 1 2\n", "RTKLIB"),
    "IMG_1.HEIC": (b"\0\0\0\x24ftypheic\0\0\0\0mif1MiHE", "HEIC"),
    "wrongly_named.jpg": (b"\0\0\0\x1cftypmif1\0\0\0\0mif1heic", "HEIC"),
    "DJI_1.DNG": (DNG, "raw photo"),
    "raw.tif": (DNG, "raw photo"),
    "DJI_1.MP4": (b"\0\0\0\x1cftypisom\0\0\x02\0isom", "video"),
    "old.avi": (b"RIFF\x10\x27\0\0AVI LIST", "video"),
    "pointer.jpg": (b"version https://git-lfs.github.com/spec/v1\noid sha256:1f\n", "git lfs pull"),
    "pointer.BIN": (b"version https://git-lfs.github.com/spec/v1\noid sha256:1f\n", "git lfs pull"),
    "._DJI_1.jpg": (b"\0\x05\x16\x07\0\x02\0\0Mac OS X        ", "AppleDouble"),
}


@pytest.mark.parametrize("name", FILES)
def test_one_message_wherever_it_is_handed_in(
    project: Project, command: Command, tmp_path: Path, name: str
) -> None:
    content, said = FILES[name]
    path = tmp_path / name
    path.write_bytes(content)
    photos = {"images": [str(project / "photos" / "*.jpg"), str(path)]}
    ways: dict[str, tuple[object, ...]] = {
        "log": ("log", path),
        "import": ("picks", "import", path, "--output", tmp_path / "p.csv"),
        "new --images": ("new", tmp_path, "--images", name),
    }
    for key, value in ("images", photos["images"]), ("log", str(path)), ("poses", str(path)):
        changed = project / f"with_{key}.yaml"
        shutil.copy(project.path, changed)
        of_file = Project(project.folder)
        of_file.path = changed
        of_file.set(**{key: value} | ({"log": None} if key == "poses" else {}))
        ways[f"{key}:"] = ("check", changed)

    for way, arguments in ways.items():
        done = command(*arguments)
        assert done.status == 1, way
        assert said in done.stderr, (way, done.stderr)
        assert str(path) in done.stderr, way
        assert done.stderr.count("uavgram: ") == 1
        assert len(done.stderr.splitlines()) == 1, (way, done.stderr)
    assert not (tmp_path / "p.csv").exists()


POINTER = FILES["pointer.jpg"][0]


@pytest.mark.parametrize("name", ["project.yaml", "camera.yaml", "picks.csv", "lines.csv"])
def test_a_pointer_in_place_of_a_file_of_the_project_is_named(
    project: Project, command: Command, name: str
) -> None:
    (project / name).write_bytes(POINTER)
    done = command("check", project.path)

    assert done.status == 1
    assert f"{name}: is a pointer of Git LFS" in done.stderr
    assert "git lfs pull" in done.stderr


@pytest.mark.parametrize(
    "arguments",
    [
        ("plan", "a.yaml"),
        ("simulate", "a.yaml"),
        ("camera", "a.json"),
        ("view", "a.rrd"),
        ("picks", "import", "gcp_list.txt", "--output", "p.csv"),
    ],
    ids=lambda arguments: arguments[0],
)
def test_a_pointer_is_named_wherever_a_file_is_read(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...]
) -> None:
    monkeypatch.chdir(tmp_path)
    file = next(name for name in arguments if "." in name)
    (tmp_path / file).write_bytes(POINTER)
    done = command(*arguments)

    assert done.status == 1
    assert "is a pointer of Git LFS" in done.stderr
    assert "git lfs pull" in done.stderr


def test_new_lists_what_it_passed_over_by_kind_and_number(
    small_survey: Path, command: Command, tmp_path: Path
) -> None:
    shutil.copytree(small_survey / "photos", tmp_path / "photos")
    for name in ("a.MP4", "b.MP4"):
        (tmp_path / name).write_bytes(FILES["DJI_1.MP4"][0])
    (tmp_path / "photos" / "._a.jpg").write_bytes(FILES["._DJI_1.jpg"][0])
    (tmp_path / "a.SRT").write_bytes(FILES["flight.SRT"][0])
    (tmp_path / "offer.pdf").write_text("x")
    done = command("new", tmp_path)

    assert done.status == 0
    (line,) = [line for line in done.stdout.splitlines() if "Passed over" in line]
    for counted in ("2 x video", "1 x companion file of macOS", "1 x subtitle", "1 x *.pdf"):
        assert counted in line
    assert "ffmpeg" in line
    assert "AppleDouble" not in (tmp_path / "project.yaml").read_text()


def test_files_that_only_have_the_name_of_a_photo_are_passed_over(
    small_survey: Path, command: Command, tmp_path: Path
) -> None:
    shutil.copytree(small_survey / "photos", tmp_path / "photos")
    first = min((tmp_path / "photos").iterdir())
    for name in ("x1", "x2"):
        first.with_name(f"{name}{first.suffix}").write_bytes(POINTER)
    first.with_name(f"x3{first.suffix}").write_bytes(FILES["._DJI_1.jpg"][0])
    done = command("new", tmp_path)

    assert done.status == 0, done.stderr
    (line,) = [line for line in done.stdout.splitlines() if "Passed over" in line]
    assert "2 x pointer of Git LFS" in line
    assert "1 x companion file of macOS" in line
    assert "git lfs pull" in line
    assert "without ._" not in line

    checked = command("check", tmp_path)
    assert checked.status == 0, checked.stderr
    assert "Passed over: 2 x pointer of Git LFS" in checked.stdout

    (tmp_path / "picks.csv").write_text(f"image,label,u_px,v_px\nx1{first.suffix},A,9,9\n")
    picked = command("check", tmp_path)
    assert picked.status == 1
    assert "git lfs pull" in picked.stderr


def test_a_folder_of_nothing_but_pointers_has_no_photo(command: Command, tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(POINTER)
    done = command("new", tmp_path)

    assert done.status == 1
    assert "holds no photo" in done.stderr
    assert "1 x pointer of Git LFS" in done.stderr


def test_a_folder_without_a_photo_that_is_read_names_those_that_are_not(
    command: Command, tmp_path: Path
) -> None:
    (tmp_path / "a.heic").write_bytes(FILES["IMG_1.HEIC"][0])
    done = command("new", tmp_path)

    assert done.status == 1
    assert "1 x HEIC photo" in done.stderr
    assert "save it as JPEG" in done.stderr


def test_a_jpeg_that_is_named_heic_is_read(project: Project, command: Command) -> None:
    photo = next(project.folder.glob("photos/*.jpg"))
    photo.rename(photo.with_suffix(".HEIC"))
    rows = (project / "picks.csv").read_text()
    (project / "picks.csv").write_text(rows.replace(photo.name, f"{photo.stem}.HEIC"))
    project.set(images="photos/*")

    assert command("check", project.path).status == 0


def test_a_pipe_is_not_waited_for(command: Command, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.srt")

    assert (
        command("picks", "import", tmp_path / "a.srt", "--output", tmp_path / "p.csv").status == 1
    )
