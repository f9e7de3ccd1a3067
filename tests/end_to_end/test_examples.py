"""The examples of the manual run, and the notebook is the script that it is made of."""

from __future__ import annotations

import importlib
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"
SHOWN = {
    "survey": "verdict: amber",
    "batch": "0 2",
    "study": "lengths used",
    "own_observation": "longer_by  0.794",
    "own_log": "positions: 101 from place",
}


def test_every_example_has_something_to_show() -> None:
    assert {path.stem for path in EXAMPLES.glob("*.py")} == set(SHOWN)


@pytest.mark.parametrize("name", SHOWN)
def test_an_example_runs(name: str, repository: Path, tmp_path: Path) -> None:
    for folder in ("configs", "logs"):
        leave = shutil.ignore_patterns("out")
        shutil.copytree(repository / folder, tmp_path / folder, ignore=leave)
    ran = subprocess.run(
        [sys.executable, EXAMPLES / f"{name}.py"],
        cwd=tmp_path,
        env={**os.environ, "MPLBACKEND": "agg", "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        encoding="utf-8",
        check=False,
    )

    assert ran.returncode == 0, ran.stderr
    assert SHOWN[name] in ran.stdout


def test_the_notebook_is_its_script_executed(
    repository: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(repository / "docs")
    maker = importlib.import_module("make_notebook")
    cells = maker.cells((EXAMPLES / "survey.py").read_text(encoding="utf-8"))
    notebook = json.loads((EXAMPLES / "survey.ipynb").read_text(encoding="utf-8"))

    assert [(one["cell_type"], "".join(one["source"])) for one in notebook["cells"]] == cells
    shown = [one["outputs"] for one in notebook["cells"] if one["cell_type"] == "code"]
    assert "verdict: amber\n" in shown[3][0]["text"]
