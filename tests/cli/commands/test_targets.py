"""`uavgram picks targets` and `uavgram targets print` through the command line."""

from __future__ import annotations

import re
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from plate_pictures import photo_of, plate_samples, quad
from small_projects import Command
from textured_ground import NAMES, Textured, write_textured

from uavgram.cli import main
from uavgram.imaging.targets.plates import read_cells
from uavgram.io.outputs import ProjectLock
from uavgram.io.tables.picks import read_picks

CAMERA = """name: small
model: brown
width_px: 120
height_px: 48
parameters: [200, 200, 59.5, 23.5, 0, 0, 0, 0, 0]
sigma: [1, 1, 1, 1, 0.01, 0.01, 0.001, 0.001, 0.001]
"""
PROJECT = """images: "*.png"
camera: camera.yaml
picks: picks.csv
measure: measure.csv
targets: {family: aruco-4x4-50, side_m: 0.5, sigma_m: 0.001}
"""
HAND = (
    "image,label,u_px,v_px,sigma_px,source\na.png,P1,5.25,7.5,0.8,by me\na.png,T3-1,14.5,14.0,1,\n"
)
CORNERS = quad((24.0, 23.5), 20.0, 8.0), quad((88.0, 24.5), 19.0, 50.0)


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """Two plates in one photo, none in another."""
    rng = np.random.default_rng(0)
    plates = zip((3, 11), CORNERS, strict=True)
    halves = [
        plate_samples(
            read_cells("aruco-4x4-50", plate), corner - [64 * (plate > 5), 0], (48, width)
        )
        for (plate, corner), width in zip(plates, (64, 56), strict=True)
    ]
    cv2.imwrite(str(tmp_path / "a.png"), photo_of(np.hstack(halves), rng))
    cv2.imwrite(str(tmp_path / "b.png"), np.full((48, 120), 90, np.uint8))
    for name, text in (("camera.yaml", CAMERA), ("project.yaml", PROJECT), ("picks.csv", HAND)):
        (tmp_path / name).write_text(text, encoding="utf-8")
    (tmp_path / "measure.csv").write_text("name,kind,points\nd,distance,T11;P1\n", encoding="utf-8")
    return tmp_path


def test_corners_are_picked_and_rows_by_hand_stay_to_the_byte(
    project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["picks", "targets", str(project)]) == 0
    told = capsys.readouterr().out
    picks = read_picks(project / "picks.csv")

    assert (project / "picks.csv").read_text(encoding="utf-8").splitlines()[1:3] == [
        "a.png,P1,5.25,7.5,0.8,by me,",
        "a.png,T3-1,14.5,14.0,1,,",
    ]
    found = dict(
        zip(
            picks.label, zip(picks.pixel_px, picks.sigma_px, picks.source, strict=True), strict=True
        )
    )
    assert set(found) == {
        "P1",
        "T3-1",
        "T3-2",
        "T3-3",
        "T3-4",
        "T11-1",
        "T11-2",
        "T11-3",
        "T11-4",
        "T11",
    }
    for corner in range(4):
        pixel, sigma, source = found[f"T11-{corner + 1}"]
        assert source == "target"
        assert np.abs(pixel - CORNERS[1][corner]).max() < 5 * sigma
    # where the centre is asked for, corners and centre together are worth the corners alone
    apart = found["T3-2"][1]
    assert found["T11-2"][1] > 1.2 * apart
    assert "picked by hand" in told
    assert "8 picks of 2 plates" in told


def test_a_second_search_replaces_the_first_and_undo_takes_all_out(project: Path) -> None:
    table = project / "picks.csv"
    assert main(["picks", "targets", str(project)]) == 0
    first = table.read_bytes()
    assert main(["picks", "targets", str(project)]) == 0
    assert table.read_bytes() == first
    assert main(["picks", "targets", str(project), "--undo"]) == 0
    assert read_picks(table).label == ("P1", "T3-1")
    assert table.read_text(encoding="utf-8").splitlines()[1] == "a.png,P1,5.25,7.5,0.8,by me,"


def test_a_dry_run_writes_nothing(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["picks", "targets", str(project), "--dry-run"]) == 0
    assert (project / "picks.csv").read_text(encoding="utf-8") == HAND
    assert "nothing is written" in capsys.readouterr().out


@pytest.mark.parametrize("more", [(), ("--undo",)])
def test_a_project_that_is_open_elsewhere_is_left_alone(
    project: Path, capsys: pytest.CaptureFixture[str], more: tuple[str, ...]
) -> None:
    assert main(["picks", "targets", str(project)]) == 0
    before = (project / "picks.csv").read_bytes()
    lock = ProjectLock(project / "out", "other")
    try:
        assert main(["picks", "targets", str(project), *more]) == 1
    finally:
        lock.release()
    assert "is open in another picking page" in capsys.readouterr().err
    assert (project / "picks.csv").read_bytes() == before


def test_where_nothing_was_picked_the_table_is_made_and_can_be_emptied(project: Path) -> None:
    table = project / "picks.csv"
    table.unlink()
    assert main(["picks", "targets", str(project)]) == 0
    assert set(read_picks(table).source) == {"target"}
    assert main(["picks", "targets", str(project), "--undo"]) == 0
    assert read_picks(table, may_be_empty=True).label == ()
    assert not (project / "out").exists()


def test_a_project_without_targets_says_what_to_add(
    project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = project / "project.yaml"
    file.write_text(PROJECT.rsplit("targets", 1)[0], encoding="utf-8")
    assert main(["picks", "targets", str(project)]) == 1
    assert "names no targets: add" in capsys.readouterr().err


def test_a_plate_is_printed_as_large_as_it_was_asked_for(tmp_path: Path) -> None:
    file = tmp_path / "plates.pdf"
    arguments = ["--output", str(file), "--plates", "4", "--side-m", "0.12", "--paper", "letter"]
    assert main(["targets", "print", *arguments]) == 0
    content = file.read_bytes()
    box = re.search(rb"/MediaBox \[ ([\d. ]+) \]", content)
    assert box is not None
    assert np.allclose([float(n) for n in box[1].split()], [0, 0, 612, 792], atol=0.01)
    drawn = b"".join(_streams(content))
    # of what is drawn with m and l, the closed outlines are the black: its extent in points
    outlines = re.findall(rb"((?:[\d.]+ [\d.]+ [ml]\n)+)h\n", drawn)
    places = [np.array(re.findall(rb"([\d.]+) ([\d.]+) [ml]", one), float) for one in outlines]
    # letters are apart (see _streams); the page itself has five places
    square = [one for one in places if np.isclose(np.diff(one, axis=0), 0).any(axis=1).all()]
    black = max((one for one in square if len(one) > 5), key=np.ptp)
    assert np.allclose(np.ptp(black, axis=0) / 72 * 25.4, 120.0, atol=0.01)


def _streams(content: bytes) -> list[bytes]:
    streams = re.findall(rb"stream\r?\n(.*?)\r?\nendstream", content, re.DOTALL)
    plain = [zlib.decompress(one) for one in streams if one[:1] == b"x"]
    return [one for one in plain if b" d1" not in one]  # glyphs


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--family", "aruco-4x4-5"], "did you mean 'aruco-4x4-50'?"),
        (["--plates", "3-"], "is no number: write 0-3"),
        (["--plates", "50"], "has the plates 0 to 49"),
        (["--paper", "b7"], "choose of a4, letter"),
        (["--side-m", "60"], "at most 10 m"),
    ],
)
def test_what_cannot_be_printed_is_refused(
    arguments: list[str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "plates.pdf"
    assert main(["targets", "print", "--output", str(file), *arguments]) == 1
    assert told in capsys.readouterr().err
    assert not file.exists()


# `uavgram picks targets` for targets without a number, on three small photos of one texture.


SHIFT = 4


def test_a_disc_that_is_picked_once_is_measured_in_the_other_photos(
    tmp_path: Path, command: Command
) -> None:
    project = _with_disc(tmp_path)
    before = project.picks.read_bytes()

    done = command("picks", "targets", project.path)

    assert done.status == 0, done
    rows = {row["image"]: row for row in project.rows() if row["source"] == "target"}
    assert set(rows) == set(NAMES[1:])
    for name, row in rows.items():
        assert row["label"] == "P5"
        off = np.array([float(row["u_px"]), float(row["v_px"])]) - project.pixel_px[name, "P5"]
        assert np.abs(off).max() < min(4.0 * float(row["sigma_px"]), 0.25)
    assert "P5: a round target, found in 2 more photos" in done.stdout
    assert project.rows()[0]["u_px"] == before.decode().splitlines()[1].split(",")[2]

    again = project.picks.read_bytes()
    assert command("picks", "targets", project.path).status == 0
    assert project.picks.read_bytes() == again
    assert command("picks", "targets", project.path, "--undo").status == 0
    assert not [row for row in project.rows() if row.get("source") == "target"]


def test_where_it_is_covered_it_is_not_picked_and_that_is_said(
    tmp_path: Path, command: Command
) -> None:
    project = _with_disc(tmp_path)
    photo = cv2.imread(str(tmp_path / "c.png"), cv2.IMREAD_GRAYSCALE)
    assert photo is not None
    u, v = np.round(project.pixel_px["c.png", "P5"]).astype(int).tolist()
    photo[v - 14 : v + 15, u - 14 : u] = 120
    cv2.imwrite(str(tmp_path / "c.png"), photo)

    done = command("picks", "targets", project.path)

    assert done.status == 0, done
    assert [row["image"] for row in project.rows() if row["source"] == "target"] == ["b.png"]
    assert "looked for but not taken in 1 photos (c.png" in done.stdout


def _with_disc(folder: Path) -> Textured:
    """The project with a disc of a dark rim about one label in every photo."""
    project = write_textured(folder)
    for name in NAMES:
        photo = cv2.imread(str(folder / name), cv2.IMREAD_GRAYSCALE)
        assert photo is not None
        u, v = np.round(project.pixel_px[name, "P5"] * 2**SHIFT).astype(int).tolist()
        for radius, grey in ((11, 20), (8, 235)):
            cv2.circle(photo, (u, v), radius * 2**SHIFT, (grey,), cv2.FILLED, cv2.LINE_AA, SHIFT)
        cv2.imwrite(str(folder / name), cv2.GaussianBlur(photo, (0, 0), 0.6))
    return project
