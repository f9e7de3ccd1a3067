"""The commands and the Python of README and manual, run as they are written."""

from __future__ import annotations

import contextlib
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from flight_projects import Demo
from manual_pages import ManualPage, manual_pages

from uavgram.cli import main

TUTORIAL = "docs/start.md"
PAGES = {page.name: page for page in manual_pages()}
WITH_COMMANDS = [name for name, page in PAGES.items() if page.run("sh") and name != TUTORIAL]
WITH_PYTHON = [name for name, page in PAGES.items() if page.run("python")]


def prepare(page: ManualPage, demo: Demo, repository: Path, folder: Path) -> Path:
    """The folder that a page starts in."""
    survey = folder / "survey"
    if page.folder == "demo":
        shutil.copytree(demo.folder, survey, ignore=shutil.ignore_patterns("out"))
    elif page.folder == "configs":
        shutil.copytree(repository / "configs", survey, ignore=shutil.ignore_patterns("out"))
        shutil.copytree(repository / "logs", folder / "logs")
    else:
        survey.mkdir()
    return survey


def typed(blocks: list[str], folder: Path, **environment: str) -> str:
    """Type blocks of commands into one shell, and return what it shows."""
    ran = subprocess.run(
        ["bash", "-e", "-c", "\n".join(blocks)],
        cwd=folder,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "COLUMNS": "160", **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        encoding="utf-8",
        check=False,
    )
    assert ran.returncode == 0, ran.stdout
    return ran.stdout


def one_blank(text: str) -> str:
    return re.sub(r"[ \t]+", " ", text)


@pytest.mark.parametrize("name", WITH_COMMANDS)
def test_the_commands_of_a_page_run(
    name: str, demo: Demo, repository: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In this process: the tutorial is typed into a shell."""
    page = PAGES[name]
    monkeypatch.chdir(prepare(page, demo, repository, tmp_path))
    for line in "".join(page.run("sh")).splitlines():
        command, _, file = line.partition(" > ")
        program, *arguments = shlex.split(command, comments=True)

        assert program == "uavgram", line
        with Path(file or os.devnull).open("w") as stream, contextlib.redirect_stdout(stream):
            assert main(arguments) == 0, line


@pytest.mark.parametrize("name", WITH_PYTHON)
def test_the_python_of_a_page_runs(
    name: str,
    demo: Demo,
    repository: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    page = PAGES[name]
    monkeypatch.chdir(prepare(page, demo, repository, tmp_path))
    names: dict[str, Any] = {}
    for block in page.run("python"):
        exec(compile(block, name, "exec"), names)  # noqa: S102  (our own words)

    assert re.search(r"skid left +16\.9", capsys.readouterr().out)
    assert names["again"].measurements.name == names["result"].measurements.name
    assert names["covariance"].shape == (6, 6)


@pytest.fixture(scope="module")
def installed(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, installed beside its dependencies; the clone itself is not in sight."""
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir"]
    subprocess.run([*build, folder, repository], check=True, capture_output=True)
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target"]
    subprocess.run([*pip, folder / "site", *folder.glob("*.whl")], check=True, capture_output=True)
    return folder / "site"


def test_the_tutorial_leads_from_nothing_to_a_report(installed: Path, tmp_path: Path) -> None:
    path = os.pathsep.join([str(installed / "bin"), os.environ["PATH"]])
    environment = {"PATH": path, "PYTHONPATH": str(installed)}
    page = PAGES[TUTORIAL]

    where = typed([f"{sys.executable} -c 'import uavgram; print(uavgram.__file__)'"], tmp_path,
                  **environment)  # fmt: skip
    shown = one_blank(typed(page.run("sh"), tmp_path, **environment))

    assert Path(where.strip()).is_relative_to(installed)
    for block in page.run("text"):
        for line in filter(None, block.splitlines()):
            assert one_blank(line) in shown, line
    report = (tmp_path / "crossing" / "out" / "report.html").read_text(encoding="utf-8")
    results = json.loads((tmp_path / "crossing" / "out" / "results.json").read_text("utf-8"))
    assert "skid left" in report
    assert (tmp_path / "crossing" / "out" / "plan.pdf").is_file()
    # The run with the wrong length is not green and names it; the last run is right again.
    wrong = re.findall(r"^Verdict: (?:red|amber).*$", shown, re.MULTILINE)
    assert "L1 does not fit and was left out" in wrong[-1], wrong
    assert results["verdict"]["level"] == "green"
