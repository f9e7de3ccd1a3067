"""`uavgram picks match` through the command line, on three small photos of one texture."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from small_projects import Command
from textured_ground import LABELS, NAMES, Textured, write_textured

from uavgram.errors import UavgramError
from uavgram.io.outputs import ProjectLock


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Textured:
    return write_textured(tmp_path_factory.mktemp("written"), labels=("STRIPE", "CAR"))


@pytest.fixture
def project(written: Textured, tmp_path: Path) -> Textured:
    """A fresh copy."""
    shutil.copytree(written.path.parent, tmp_path / "copy")
    return Textured(tmp_path / "copy" / "project.yaml", written.pixel_px)


def test_points_are_found_to_a_tenth_of_a_pixel_and_what_moved_is_not(
    project: Textured, command: Command
) -> None:
    before = project.picks.read_text()

    done = command("picks", "match", project.path)

    assert done.status == 0, done
    assert project.picks.read_text().splitlines()[0].startswith(before.splitlines()[0])
    rows = [row for row in project.rows() if row["source"] == "match"]
    found = {(row["image"], row["label"]) for row in rows}
    assert found >= {(name, label) for name in NAMES[1:] for label in LABELS}
    assert ("c.png", "CAR") not in found
    off = [
        np.array([float(row["u_px"]), float(row["v_px"])])
        - project.pixel_px[row["image"], row["label"]]
        for row in rows
    ]
    sigma = np.array([float(row["sigma_px"]) for row in rows])
    assert (np.abs(off).max(axis=1) < 4.5 * sigma).all()
    assert (sigma > 0.02).all()
    assert (sigma < 0.3).all()
    first = project.rows()[0]
    assert (rows[0]["from_image"], rows[0]["from_u_px"]) == (NAMES[0], first["u_px"])
    for said in (f"{len(rows)} of", "CAR in c.png", "one photo alone shows: CAR", "b.png"):
        assert said in done.stdout


def test_a_second_search_keeps_the_first_and_undo_gives_the_very_file_back(
    project: Textured, command: Command
) -> None:
    before = project.picks.read_bytes()
    asked = "--labels", "P1, P2", "--photos", "b.png"
    assert command("picks", "match", project.path, *asked).status == 0
    once = project.picks.read_bytes()
    assert once.count(b"match") == 2

    again = command("picks", "match", project.path, *asked).stdout
    assert "new matches: 0, earlier ones kept: 2" in again
    assert "no further search" in again
    assert project.picks.read_bytes() == once
    assert command("picks", "match", project.path, "--undo", "--photos", "c.png").status == 0
    assert project.picks.read_bytes() == once
    assert "picks.csv: 2" in command("picks", "match", project.path, "--undo").stdout
    # The columns of the matches stay, empty: what people wrote is as it was.
    assert [line.rstrip(",") for line in project.picks.read_text().splitlines()[1:]] == (
        before.decode().splitlines()[1:]
    )


def test_accepted_matches_stay_but_for_those_that_fit_no_longer_or_whose_pick_moved(
    project: Textured, command: Command
) -> None:
    assert command("picks", "match", project.path, "--labels", "P1, P2, P3, P4, P5").status == 0
    table = project.picks.read_text().splitlines()
    kept = next(row for row in table if row.startswith("b.png,P1,"))
    moved = next(row for row in table if row.startswith("a.png,P3,"))
    wrong = next(row for row in table if row.startswith("c.png,P2,"))
    u = {row: row.split(",")[2] for row in (kept, moved, wrong)}
    edited = {
        kept: kept.replace(u[kept], f"{float(u[kept]) + 0.05:.2f}"),  # as the page found it
        moved: moved.replace(u[moved], f"{float(u[moved]) + 0.5:.2f}"),
        wrong: wrong.replace(u[wrong], f"{float(u[wrong]) + 20.0:.2f}"),
    }
    project.picks.write_text("\n".join(edited.get(row, row) for row in table) + "\n")

    done = command("picks", "match", project.path, "--labels", "P1, P2, P3")

    assert done.status == 0, done
    now = project.picks.read_text().splitlines()
    assert edited[kept] in now
    assert edited[wrong] not in now
    assert "new matches: 3, earlier ones kept: 3, taken out: 3 (their pick" in done.stdout
    rows = {(row["image"], row["label"]): row for row in project.rows()}
    assert abs(float(rows["c.png", "P2"]["u_px"]) - float(u[wrong])) < 0.1
    assert rows["c.png", "P3"]["from_u_px"] == rows["a.png", "P3"]["u_px"]


def test_a_dry_run_says_what_it_would_find_and_writes_nothing(
    project: Textured, command: Command
) -> None:
    files = {path.name: path.read_bytes() for path in project.path.parent.iterdir()}

    done = command("picks", "match", project.path, "--dry-run", "--labels", "P1")

    assert done.status == 0
    assert "2 of 2" in done.stdout
    assert "nothing was written" in done.stdout
    assert {path.name: path.read_bytes() for path in project.path.parent.iterdir()} == files


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--labels", "p1"), "no label 'p1' is picked: did you mean 'P1'?"),
        (("--photos", "b.jpg"), "the project has no photo 'b.jpg': did you mean 'b.png'?"),
    ],
)
def test_names_that_are_not_there_are_refused_with_what_was_meant(
    project: Textured, command: Command, arguments: tuple[str, ...], said: str
) -> None:
    done = command("picks", "match", project.path, *arguments)

    assert done.status == 1
    assert said in done.stderr


def test_a_project_that_is_open_elsewhere_is_left_alone(
    project: Textured, command: Command
) -> None:
    before = project.picks.read_bytes()
    lock = ProjectLock(project.path.parent / "out", "other")
    try:
        done = command("picks", "match", project.path)
    finally:
        lock.release()

    assert done.status == 1
    assert "is open in another picking page" in done.stderr
    assert project.picks.read_bytes() == before


def test_a_photo_that_cannot_be_read_stops_it_and_nothing_is_written(
    project: Textured, command: Command
) -> None:
    before = project.picks.read_bytes()
    whole = (project.path.parent / "b.png").read_bytes()
    (project.path.parent / "b.png").write_bytes(whole[: len(whole) // 3])

    done = command("picks", "match", project.path)

    assert done.status == 1
    assert "b.png" in done.stderr
    assert project.picks.read_bytes() == before


def test_without_poses_or_lengths_it_says_that_nothing_can_be_looked_for(
    project: Textured, command: Command
) -> None:
    text = project.path.read_text()
    project.path.write_text(
        text.replace("poses: poses.csv\n", "").replace("lines: lines.csv\n", "")
    )

    done = command("picks", "match", project.path)

    assert done.status == 1
    assert "no search is possible yet" in done.stderr


def test_where_only_ties_place_the_photos_points_are_found(
    project: Textured, command: Command
) -> None:
    text = project.path.read_text().replace("poses: poses.csv\n", "ties: auto\n")
    project.path.write_text(text[: text.index("world:")])

    assert command("picks", "ties", project.path).status == 0
    done = command("picks", "match", project.path, "--labels", "P1, P5")

    assert done.status == 0, done
    for row in project.rows():
        place = np.array([float(row["u_px"]), float(row["v_px"])])
        off = place - project.pixel_px[row["image"], row["label"]]
        assert np.abs(off).max() < 0.2
    assert sum(row["source"] == "match" for row in project.rows()) >= 3


def test_the_lock_is_gone_after_a_search(project: Textured, command: Command) -> None:
    assert command("picks", "match", project.path, "--labels", "P1").status == 0
    try:
        ProjectLock(project.path.parent / "out", "other").release()
    except UavgramError as why:
        pytest.fail(str(why))
