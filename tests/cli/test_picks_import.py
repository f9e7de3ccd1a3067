"""`uavgram picks import` through the command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from uavgram.cli import main
from uavgram.io.tables.known import read_known_points
from uavgram.io.tables.picks import read_picks
from uavgram.pipeline.measure.inputs import read_inputs

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
