"""`uavgram simulate`: what it writes and says, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from uavgram.cli import main
from uavgram.synthetic.study import list_studies


def test_a_scenario_is_repeated_and_told(
    repository: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario, output = repository / "configs" / "single_photo.yaml", tmp_path / "out"
    words = ["simulate", str(scenario), "--repetitions", "3", "--output", str(output)]
    assert main([*words, "--seed", "5"]) == 0
    told = capsys.readouterr().out
    assert "P to Q" in told
    assert "3 of 3 repetitions gave a result" in told
    first = json.loads((output / "simulation.json").read_text(encoding="utf-8"))
    assert main([*words, "--seed", "5"]) == 0
    assert json.loads((output / "simulation.json").read_text(encoding="utf-8")) == first
    assert main([*words, "--seed", "6"]) == 0
    other = json.loads((output / "simulation.json").read_text(encoding="utf-8"))
    assert other["draws"]["value"] != first["draws"]["value"]


@pytest.mark.parametrize(
    ("words", "named"),
    [
        ([], "nothing to repeat"),
        (["{clean}", "--compare"], "nothing amiss"),
        (["--from", "{clean}", "--photos"], "--photos is for scenarios"),
        (["{missing}"], "missing.yaml"),
    ],
)
def test_what_cannot_be_repeated_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], named: str
) -> None:
    clean = tmp_path / "clean.yaml"
    clean.write_text("name: clean\n", encoding="utf-8")
    places = {"clean": str(clean), "missing": str(tmp_path / "missing.yaml")}
    output = tmp_path / "out"
    status = main(["simulate", *(w.format(**places) for w in words), "--output", str(output)])
    assert status == 1
    assert named in capsys.readouterr().err
    assert not output.exists()


# `uavgram study`.


def test_a_study_is_made_and_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "out"
    asked = ["study", "camera", "--repetitions", "40", "--workers", "1", "--output", str(folder)]
    assert main(asked) == 0
    assert sorted(one.name for one in folder.iterdir()) == [
        *("camera.png", "camera.svg", "study.html", "study.json")
    ]
    record = json.loads((folder / "study.json").read_text(encoding="utf-8"))
    cells = record["studies"][0]["cells"]
    assert "20°, one length and the log" in {one["curve"] for one in cells}
    assert all(one["repetitions"] == 40 for one in cells)
    assert "Focal length and principal point" in capsys.readouterr().out


def test_the_studies_are_the_questions_of_the_thesis_and_the_methods() -> None:
    assert list_studies("all") == ("lengths", "picks", "view", "camera", "methods")


def test_an_unknown_study_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["study", "lenghts", "--output", str(tmp_path / "out")]) == 1
    told = capsys.readouterr().err
    assert "did you mean 'lengths'?" in told
    assert not (tmp_path / "out").exists()
