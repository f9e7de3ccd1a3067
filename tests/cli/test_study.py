"""`uavgram study`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from uavgram.cli import main
from uavgram.synthetic.study import list_studies


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
