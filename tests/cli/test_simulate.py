"""`uavgram simulate`: what it writes and says, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from uavgram.cli import main


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
