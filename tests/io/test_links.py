"""Links in somebody's unpacked folder: nothing is written where they lead."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from uavgram.errors import OutputError
from uavgram.io.outputs import PREFIX, replace_bytes, staged_output


@pytest.fixture
def victim(tmp_path: Path) -> Iterator[Path]:
    (tmp_path / "elsewhere").mkdir()
    path = tmp_path / "elsewhere" / "victim"
    path.write_text("precious")
    yield path
    assert path.read_text() == "precious"
    assert [one.name for one in path.parent.iterdir()] == ["victim"]


@pytest.fixture
def out(tmp_path: Path) -> Path:
    folder = tmp_path / "project" / "out"
    folder.mkdir(parents=True)
    return folder


def write_into(folder: Path, name: str) -> None:
    folder.mkdir()
    (folder / name).write_text("new")


def test_a_file_is_replaced_and_not_written_through_links(out: Path, victim: Path) -> None:
    (out / "a.csv").symlink_to(victim)
    (out / ".a.csv.unfinished").symlink_to(victim)
    replace_bytes(out / "a.csv", b"new")
    assert not (out / "a.csv").is_symlink()
    assert (out / "a.csv").read_bytes() == b"new"


def test_results_replace_links_and_folders_that_lead_elsewhere_are_refused(
    out: Path, victim: Path
) -> None:
    (out / "results.json").symlink_to(victim)
    with staged_output(out) as staging:
        (staging / "results.json").write_text("new")
    assert (out / "results.json").read_text() == "new"
    (out / "colmap").symlink_to(victim.parent)
    with (
        pytest.raises(OutputError, match=r"out/colmap: is a link that leads out.*remove the link"),
        staged_output(out) as staging,
    ):
        write_into(staging / "colmap", "victim")


@pytest.mark.parametrize("name", ["../../elsewhere/victim", "/{victim}", "over/victim"])
def test_what_looks_like_a_killed_run_moves_and_removes_nothing_elsewhere(
    out: Path, victim: Path, name: str
) -> None:
    """A hidden folder in an archive names files of its own choice as half moved."""
    stale = out / f"{PREFIX}forged"
    (stale / "files").mkdir(parents=True)
    (stale / "files" / "waits").write_text("x")
    (out / "over").symlink_to(victim.parent)
    (stale / "moving.txt").write_text(f"waits\n{name.format(victim=victim)}\n.")
    with staged_output(out) as staging:
        (staging / "results.json").write_text("new")
    assert not stale.exists()


@pytest.mark.parametrize("inside", ["files", "earlier", ""])
def test_a_forged_killed_run_takes_no_files_from_elsewhere(
    out: Path, victim: Path, inside: str
) -> None:
    stale = out / f"{PREFIX}forged"
    (stale if inside else out / "other").mkdir()
    for name in {"files", "earlier"} - {inside}:
        folder = (stale if inside else out / "other") / name
        folder.mkdir(parents=True)
        (folder / "waits").write_text("x")
    if inside:
        (stale / inside).symlink_to(victim.parent)
    else:
        stale.symlink_to(victim.parent)
    if inside:
        (stale / "moving.txt").write_text("waits\nvictim\n.")
    with staged_output(out) as staging:
        (staging / "results.json").write_text("new")
    assert not (out / "victim").exists()


def test_a_folder_that_holds_the_photos_takes_no_results(tmp_path: Path, out: Path) -> None:
    photos = tmp_path / "project" / "photos"
    photos.mkdir()
    photo = photos / "P1.jpg"
    photo.write_bytes(b"a photo")
    (out / "by-a-link").symlink_to(photos)
    for folder in (photos, out / "by-a-link", photos / ".." / "photos"):
        with (
            pytest.raises(OutputError, match="holds the photos themselves"),
            staged_output(folder, photos=[photo]),
        ):
            pass
    with (
        pytest.raises(OutputError, match="project/photos: holds the photos themselves"),
        staged_output(photos.parent, photos=[photo]) as staging,
    ):
        write_into(staging / "photos", "P2.jpg")
    assert os.listdir(photos) == ["P1.jpg"]  # noqa: PTH208
