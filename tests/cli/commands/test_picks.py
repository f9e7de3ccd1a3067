"""`uavgram pick --sample` says where the sample is, and where the readings of its tape are."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml
from small_projects import Command
from textured_ground import LABELS, NAMES, Textured, write_textured
from tied_photos import CAMERA, flight, write_photos

from uavgram.cli import main
from uavgram.cli.commands import picks as pick_commands
from uavgram.errors import UavgramError
from uavgram.io.outputs import ProjectLock
from uavgram.io.tables.known import read_known_points
from uavgram.io.tables.picks import read_picks, read_ties
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.pipeline.measure.pose import pose_frames
from uavgram.pipeline.measure.tie_points import add_found_ties, are_ties_missing
from uavgram.synthetic.accident_scene import SAMPLE_MARK


def test_the_readings_of_the_tape_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "sample"
    folder.mkdir()
    (folder / "project.yaml").write_text(f"{SAMPLE_MARK} as it was made.\n")
    monkeypatch.setattr(pick_commands, "_find_running_page", lambda *_, **__: True)

    assert main(["pick", "--sample", str(folder)]) == 0
    assert str(folder / "taped.txt") in capsys.readouterr().out


# `uavgram picks import` through the command line.


GCP = "EPSG:4326\n11.5 48.1 520 10.25 20.5 a.jpg A\n11.6 48.2 521 30 40 a.jpg B\n"


@pytest.fixture
def files(tmp_path: Path) -> list[str]:
    (tmp_path / "gcp_list.txt").write_text(GCP, encoding="utf-8")
    shapes = [{"label": "C", "points": [[5.5, 6.5]], "shape_type": "point"}]
    content = {"imagePath": "b.jpg", "shapes": shapes, "imageWidth": 60, "imageHeight": 40}
    (tmp_path / "b.json").write_text(json.dumps(content), encoding="utf-8")
    return [str(tmp_path / "gcp_list.txt"), str(tmp_path / "b.json")]


def test_both_kinds_become_one_table_and_one_of_control(
    files: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picks, control = tmp_path / "picks.csv", tmp_path / "control.csv"
    arguments = ["--control", str(control), "--control-sigma-m", "0.03"]
    status = main(["picks", "import", *files, "--output", str(picks), *arguments])

    assert status == 0
    read = read_picks(picks)
    assert read.label == ("A", "B", "C")
    assert read.pixel_px.tolist() == [[10.25, 20.5], [30.0, 40.0], [5.0, 6.0]]
    known = read_known_points(control)
    assert known.label == ("A", "B")
    assert known.coordinates[0] == pytest.approx([48.1, 11.5, 520.0], abs=1e-9)
    assert "3 picks of 3 labels in 2 photos" in capsys.readouterr().out


def test_a_file_that_is_there_is_never_written_over(
    files: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "picks.csv").write_text("mine", encoding="utf-8")

    assert main(["picks", "import", *files, "--output", str(tmp_path / "picks.csv")]) == 1
    assert (tmp_path / "picks.csv").read_text(encoding="utf-8") == "mine"
    assert "is there already" in capsys.readouterr().err


def test_a_control_file_that_is_there_leaves_nothing_written(
    files: list[str], tmp_path: Path
) -> None:
    control = tmp_path / "control.csv"
    control.write_text("mine", encoding="utf-8")
    arguments = ["--control", str(control), "--control-sigma-m", "0.03"]

    assert main(["picks", "import", *files, "--output", str(tmp_path / "p.csv"), *arguments]) == 1
    assert not (tmp_path / "p.csv").exists()
    assert control.read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (["picks", "import", "--output", "p.csv"], 2, "files"),
        (["picks", "import", "x.tif", "--output", "p.csv"], 1, "neither LabelMe"),
        (["picks", "import", "x.json", "--output", "p.csv", "--control", "c.csv"], 1, "together"),
        (["picks", "import", "absent.json", "--output", "p.csv"], 1, "absent.json: cannot be read"),
    ],
)
def test_wrong_use_is_one_clear_message(
    arguments: list[str],
    status: int,
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)

    assert main(arguments) == status
    assert said.lower() in capsys.readouterr().err.lower()


def test_points_to_judge_by_go_to_a_table_of_their_own(
    data_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A real list (Helenenschacht, OpenDroneMap): the truth is the CSV that lies beside it."""
    source = data_dir / "helenenschacht"
    tables = ["--control", str(tmp_path / "control.csv"), "--control-sigma-m", "0.02"]
    arguments = [str(source / "gcp_list.txt"), "--output", str(tmp_path / "picks.csv"), *tables]
    assert main(["picks", "import", *arguments, "--check", "4, 5"]) == 0
    assert "2 check points" in capsys.readouterr().out
    control = read_known_points(tmp_path / "control.csv")
    check = read_known_points(tmp_path / "check.csv")
    assert (control.label, check.label) == (("1", "2", "3"), ("4", "5"))
    theirs = read_known_points(source / "control.csv")
    rows = [theirs.label.index(label) for label in control.label]
    assert control.coordinates.tolist() == theirs.coordinates[rows].tolist()


@pytest.mark.parametrize(
    ("check", "said"), [("C", "has no point 'C', which --check"), ("A,B", "names every point")]
)
def test_a_wrong_choice_of_check_points_writes_nothing(
    files: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str], check: str, said: str
) -> None:
    control = ["--control", str(tmp_path / "control.csv"), "--control-sigma-m", "0.03"]
    arguments = [files[0], "--output", str(tmp_path / "p.csv"), *control, "--check", check]
    assert main(["picks", "import", *arguments]) == 1
    assert said in capsys.readouterr().err
    assert not list(tmp_path.glob("*.csv"))


def test_tables_with_a_header_only_are_filled(files: list[str], tmp_path: Path) -> None:
    picks, control = tmp_path / "picks.csv", tmp_path / "control.csv"
    picks.write_text("note;image;label;u_px;v_px\n\n", encoding="utf-8")
    control.write_text("", encoding="utf-8")
    arguments = ["--control", str(control), "--control-sigma-m", "0.03"]

    assert main(["picks", "import", *files, "--output", str(picks), *arguments]) == 0
    assert read_known_points(control).label == ("A", "B")
    assert picks.read_text().splitlines()[0] == "note;image;label;u_px;v_px"
    assert read_picks(picks).label == ("A", "B", "C")
    assert main(["picks", "import", *files, "--output", str(picks)]) == 1  # filled now


def test_a_new_project_is_written_for_the_list_and_the_import_fills_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from tagged_jpeg import jpeg

    (tmp_path / "a.jpg").write_bytes(jpeg(size=64))
    (tmp_path / "gcp_list.txt").write_text(GCP, encoding="utf-8")
    assert main(["new", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    command = said[said.index("picks import") :].split(";")[0].split()
    assert main(command) == 0

    inputs = read_inputs(tmp_path / "project.yaml")
    assert inputs.picks.label == ("A", "B")
    assert inputs.control.coordinates[:, 2].tolist() == [520.0, 521.0]  # each its own height


# `uavgram picks match` through the command line, on three small photos of one texture.


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


# `uavgram picks ties` through the command line.


OWN = "p0.png,m1,100,120,0.5,mine\np1.png,m1,200,120,0.5,mine\n"
HEADER = "image,tie,u_px,v_px,sigma_px,source\n"


@pytest.fixture(scope="module")
def photos(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("photos")
    write_photos(folder, flight())
    return folder


@pytest.fixture
def tied_project(photos: Path, tmp_path: Path) -> Path:
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


def test_ties_are_written_said_and_taken_back(tied_project: Path, command: Command) -> None:
    table = tied_project.with_name("ties.csv")

    done = command("picks", "ties", tied_project)

    assert done.status == 0, done.stderr
    ties = read_ties(table)
    assert set(ties.image) == {"p0.png", "p1.png", "p2.png"}
    assert (
        f"{len(set(ties.tie))} tie points in 3 photos, {len(ties.tie)} rows, written" in done.stdout
    )
    assert "[ties-found]" in done.stdout
    assert "write `ties: ties.csv` into project.yaml" in done.stdout

    undone = command("picks", "ties", tied_project, "--undo")

    assert undone.status == 0
    assert f"{len(ties.tie)} rows of tie points taken out of {table}" in undone.stdout
    assert table.read_text().splitlines() == ["image,tie,u_px,v_px,sigma_px,source"]


def test_a_dry_run_writes_nothing(tied_project: Path, command: Command) -> None:
    table = tied_project.with_name("ties.csv")
    table.write_text(HEADER + OWN.replace("mine", "tie"), encoding="utf-8")
    before = table.read_bytes()

    done = command("picks", "ties", tied_project, "--dry-run")
    undone = command("picks", "ties", tied_project, "--undo", "--dry-run")

    assert "would be written" in done.stdout
    assert "2 rows of tie points would be taken out" in undone.stdout
    assert table.read_bytes() == before


def test_rows_that_a_person_made_stay(tied_project: Path, command: Command) -> None:
    table = tied_project.with_name("ties.csv")
    table.write_text(HEADER + OWN, encoding="utf-8")

    assert command("picks", "ties", tied_project).status == 0
    assert table.read_text(encoding="utf-8").startswith(HEADER + OWN)
    assert command("picks", "ties", tied_project, "--undo").status == 0
    assert table.read_text(encoding="utf-8") == HEADER + OWN


def test_a_tie_in_a_photo_that_is_not_there_is_refused_with_its_line(
    tied_project: Path, command: Command
) -> None:
    table = tied_project.with_name("ties.csv")
    table.write_text(HEADER + OWN.replace("p1.png", "p7.png"), encoding="utf-8")
    tied_project.write_text(
        tied_project.read_text(encoding="utf-8") + "ties: ties.csv\n", encoding="utf-8"
    )
    tied_project.with_name("picks.csv").write_text(
        "image,label,u_px,v_px\np0.png,A,1,2\n", encoding="utf-8"
    )

    done = command("check", tied_project)

    assert done.status == 1
    assert f"p7.png: is not among the project's photos, though {table.name} (line 3)" in done.stderr


def test_a_tie_outside_its_photo_is_refused(tied_project: Path, command: Command) -> None:
    table = tied_project.with_name("ties.csv")
    table.write_text(HEADER + OWN.replace("200,120", "900,120"), encoding="utf-8")
    tied_project.write_text(
        tied_project.read_text(encoding="utf-8") + "ties: ties.csv\n", encoding="utf-8"
    )
    tied_project.with_name("picks.csv").write_text(
        "image,label,u_px,v_px\np0.png,A,1,2\n", encoding="utf-8"
    )

    done = command("check", tied_project)

    assert done.status == 1
    assert "tie point 'm1' at (900, 120) is outside 'p1.png' (640 x 480 px" in done.stderr


def test_ties_that_are_asked_for_and_missing_are_found_kept_and_read_again(
    tied_project: Path,
) -> None:
    table = tied_project.with_name("ties.csv")
    tied_project.write_text(
        tied_project.read_text(encoding="utf-8") + "ties: auto\n", encoding="utf-8"
    )
    inputs = read_inputs(tied_project, unfinished=True)
    assert are_ties_missing(inputs)

    found = add_found_ties(inputs, pose_frames(inputs), write=True)

    again = read_inputs(tied_project, unfinished=True)
    assert not are_ties_missing(again)
    np.testing.assert_array_equal(again.ties.pixel_px, found.ties.pixel_px)
    assert table in again.files
    assert found.digests[-1] in again.digests
    assert "ties-found" in {message.code for message in found.messages}


@pytest.mark.parametrize("more", [(), ("--undo",)])
def test_tie_points_of_an_open_project_are_left_alone(
    tied_project: Path, command: Command, more: tuple[str, ...]
) -> None:
    table = tied_project.with_name("ties.csv")
    table.write_text(HEADER + "p0.png,t1,100,120,0.5,ties\n", encoding="utf-8")
    before = table.read_bytes()
    lock = ProjectLock(tied_project.parent / "out", "other")
    try:
        done = command("picks", "ties", tied_project, *more)
    finally:
        lock.release()

    assert done.status == 1
    assert "is open in another picking page" in done.stderr
    assert table.read_bytes() == before
