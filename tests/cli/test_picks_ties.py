"""`uavgram picks ties` through the command line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from small_projects import Command
from tied_photos import CAMERA, flight, write_photos

from uavgram.io.outputs import ProjectLock
from uavgram.io.tables.picks import read_ties
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.pipeline.measure.pose import pose_frames
from uavgram.pipeline.measure.tie_points import add_found_ties, are_missing

OWN = "p0.png,m1,100,120,0.5,mine\np1.png,m1,200,120,0.5,mine\n"
HEADER = "image,tie,u_px,v_px,sigma_px,source\n"


@pytest.fixture(scope="module")
def photos(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("photos")
    write_photos(folder, flight())
    return folder


@pytest.fixture
def project(photos: Path, tmp_path: Path) -> Path:
    parameters = CAMERA.parameters.tolist()
    camera = {
        "name": "plain",
        "model": "brown",
        "width_px": CAMERA.width_px,
        "height_px": CAMERA.height_px,
        "parameters": parameters,
        "sigma": [0.5] * 4 + [1e-4] * 5,
    }
    (tmp_path / "camera.yaml").write_text(yaml.safe_dump(camera), encoding="utf-8")
    text = {"images": f"{photos}/p[0-2].png", "camera": "camera.yaml", "picks": "picks.csv"}
    (tmp_path / "project.yaml").write_text(yaml.safe_dump(text), encoding="utf-8")
    return tmp_path / "project.yaml"


def test_ties_are_written_said_and_taken_back(project: Path, command: Command) -> None:
    table = project.with_name("ties.csv")

    done = command("picks", "ties", project)

    assert done.status == 0, done.stderr
    ties = read_ties(table)
    assert set(ties.image) == {"p0.png", "p1.png", "p2.png"}
    assert (
        f"{len(set(ties.tie))} tie points in 3 photos, {len(ties.tie)} rows, written" in done.stdout
    )
    assert "[ties-found]" in done.stdout
    assert "write `ties: ties.csv` into project.yaml" in done.stdout

    undone = command("picks", "ties", project, "--undo")

    assert undone.status == 0
    assert f"{len(ties.tie)} rows of tie points taken out of {table}" in undone.stdout
    assert table.read_text().splitlines() == ["image,tie,u_px,v_px,sigma_px,source"]


def test_a_dry_run_writes_nothing(project: Path, command: Command) -> None:
    table = project.with_name("ties.csv")
    table.write_text(HEADER + OWN.replace("mine", "tie"), encoding="utf-8")
    before = table.read_bytes()

    done = command("picks", "ties", project, "--dry-run")
    undone = command("picks", "ties", project, "--undo", "--dry-run")

    assert "would be written" in done.stdout
    assert "2 rows of tie points would be taken out" in undone.stdout
    assert table.read_bytes() == before


def test_rows_that_a_person_made_stay(project: Path, command: Command) -> None:
    table = project.with_name("ties.csv")
    table.write_text(HEADER + OWN, encoding="utf-8")

    assert command("picks", "ties", project).status == 0
    assert table.read_text(encoding="utf-8").startswith(HEADER + OWN)
    assert command("picks", "ties", project, "--undo").status == 0
    assert table.read_text(encoding="utf-8") == HEADER + OWN


def test_a_tie_in_a_photo_that_is_not_there_is_refused_with_its_line(
    project: Path, command: Command
) -> None:
    table = project.with_name("ties.csv")
    table.write_text(HEADER + OWN.replace("p1.png", "p7.png"), encoding="utf-8")
    project.write_text(project.read_text(encoding="utf-8") + "ties: ties.csv\n", encoding="utf-8")
    project.with_name("picks.csv").write_text(
        "image,label,u_px,v_px\np0.png,A,1,2\n", encoding="utf-8"
    )

    done = command("check", project)

    assert done.status == 1
    assert f"{table}:3: the sighting of tie point 'm1' names the photo 'p7.png'" in done.stderr


def test_a_tie_outside_its_photo_is_refused(project: Path, command: Command) -> None:
    table = project.with_name("ties.csv")
    table.write_text(HEADER + OWN.replace("200,120", "900,120"), encoding="utf-8")
    project.write_text(project.read_text(encoding="utf-8") + "ties: ties.csv\n", encoding="utf-8")
    project.with_name("picks.csv").write_text(
        "image,label,u_px,v_px\np0.png,A,1,2\n", encoding="utf-8"
    )

    done = command("check", project)

    assert done.status == 1
    assert "tie point 'm1' at (900, 120) is outside 'p1.png' (640 x 480 px" in done.stderr


def test_ties_that_are_asked_for_and_missing_are_found_kept_and_read_again(project: Path) -> None:
    table = project.with_name("ties.csv")
    project.write_text(project.read_text(encoding="utf-8") + "ties: auto\n", encoding="utf-8")
    inputs = read_inputs(project, unfinished=True)
    assert are_missing(inputs)

    found = add_found_ties(inputs, pose_frames(inputs), write=True)

    again = read_inputs(project, unfinished=True)
    assert not are_missing(again)
    np.testing.assert_array_equal(again.ties.pixel_px, found.ties.pixel_px)
    assert table in again.files
    assert found.digests[-1] in again.digests
    assert "ties-found" in {message.code for message in found.messages}


@pytest.mark.parametrize("more", [(), ("--undo",)])
def test_a_project_that_is_open_elsewhere_is_left_alone(
    project: Path, command: Command, more: tuple[str, ...]
) -> None:
    table = project.with_name("ties.csv")
    table.write_text(HEADER + "p0.png,t1,100,120,0.5,ties\n", encoding="utf-8")
    before = table.read_bytes()
    lock = ProjectLock(project.parent / "out", "other")
    try:
        done = command("picks", "ties", project, *more)
    finally:
        lock.release()

    assert done.status == 1
    assert "is open in another picking page" in done.stderr
    assert table.read_bytes() == before
