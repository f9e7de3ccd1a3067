"""The examples of the manual run, and the notebook is the script that it is made of."""

from __future__ import annotations

import contextlib
import importlib
import io
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

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


@pytest.mark.parametrize("name", sorted(set(SHOWN) - {"survey"}))  # that is a notebook: see below
def test_an_example_runs_anywhere_and_writes_into_a_folder_of_its_own(
    name: str, repository: Path, tmp_path: Path
) -> None:
    tracked = ["git", "status", "--porcelain", "docs/examples", "configs", "logs"]
    before = subprocess.run(tracked, cwd=repository, capture_output=True, check=False).stdout
    ran = subprocess.run(
        [sys.executable, EXAMPLES / f"{name}.py"],
        cwd=tmp_path,
        env={**os.environ, "MPLBACKEND": "agg", "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        encoding="utf-8",
        check=False,
    )
    after = subprocess.run(tracked, cwd=repository, capture_output=True, check=False).stdout

    assert ran.returncode == 0, ran.stderr
    assert SHOWN[name] in ran.stdout
    assert {path.name for path in tmp_path.iterdir()} <= {
        f"uavgram-example-{name.replace('_', '-')}"
    }
    assert after == before


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


def test_the_cells_of_the_notebook_print_what_it_shows(
    repository: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As Jupyter runs them: one after another, in the notebook's folder."""
    for part in ("configs", "logs", "docs/examples"):
        shutil.copytree(repository / part, tmp_path / part, ignore=shutil.ignore_patterns("out"))
    here = tmp_path / "docs" / "examples"
    monkeypatch.chdir(here)
    monkeypatch.setenv("MPLBACKEND", "agg")
    names: dict[str, Any] = {}
    for cell in json.loads((here / "survey.ipynb").read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            printed = io.StringIO()
            with contextlib.redirect_stdout(printed):
                exec("".join(cell["source"]), names)  # noqa: S102  (our own words)
            assert printed.getvalue() == "".join(
                line for output in cell["outputs"] for line in output["text"]
            )

    assert (here / "uavgram-example-survey" / "survey.png").is_file()
