"""The commands and the Python of README and manual, run as they are written."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest
from flight_projects import Demo, Tutorial
from manual_pages import ManualPage, manual_pages
from traced_programs import STRACE, strangers, traced

from uavgram.cli.entry import app

TUTORIAL = "docs/start.md"
PAGES = {page.name: page for page in manual_pages()}
WITH_COMMANDS = [name for name, page in PAGES.items() if page.run("sh") and name != TUTORIAL]
WITH_PYTHON = [name for name, page in PAGES.items() if page.run("python")]


def prepare(page: ManualPage, demo: Demo, repository: Path, folder: Path) -> Path:
    """The folder that a page starts in."""
    survey = folder / "survey"
    folder.mkdir(parents=True, exist_ok=True)
    if page.folder == "demo":
        shutil.copytree(demo.folder, survey, ignore=shutil.ignore_patterns("out"))
    elif page.folder == "configs":
        shutil.copytree(repository / "configs", survey, ignore=shutil.ignore_patterns("out"))
        shutil.copytree(repository / "logs", folder / "logs")
    else:
        survey.mkdir()
    return survey


def one_blank(text: str) -> str:
    return re.sub(r"[ \t]+", " ", text)


RUN = """
import contextlib, json, os, sys
from uavgram.cli import main
for folder, arguments, file in json.loads(sys.argv[1]):
    os.chdir(folder)
    with open(file or os.devnull, "w") as stream, contextlib.redirect_stdout(stream):
        status = main(arguments)
    if status:
        sys.exit(f"{arguments}: status {status}")
"""


def test_the_commands_of_the_manual_run_and_call_nobody(
    demo: Demo, repository: Path, data_dir: Path, tmp_path: Path
) -> None:
    """In one process, and those of which the manual has none to run; the tutorial has its own."""
    calls = []
    for name in WITH_COMMANDS:
        folder = prepare(PAGES[name], demo, repository, tmp_path / name)
        for line in "".join(PAGES[name].run("sh")).splitlines():
            command, _, file = line.partition(" > ")
            name_of_program, *arguments = shlex.split(command, comments=True)
            assert name_of_program == "uavgram", line
            calls.append((str(folder), arguments, file))
    (tmp_path / "gcp_list.txt").write_text("EPSG:25832\n565000 5330000 520 10.25 20.5 a.jpg A\n")
    board = [str(data_dir / "opencv_chess" / f"left{k:02}.jpg") for k in range(1, 6)]
    others = (
        ["calibrate", *board, "--board", "chessboard:9x6:25mm", "--coefficients", "3"],
        ["picks", "import", "gcp_list.txt", "--output", "picks.csv"],
        ["study", "lengths", "--repetitions", "20", "--workers", "1"],
        ["shortcut", "--folder", str(tmp_path)],
    )
    calls += [(str(tmp_path), arguments, "") for arguments in others]
    with traced(tmp_path, sys.executable, "-P", "-c", RUN, json.dumps(calls)) as program:
        said = program.communicate(timeout=300)[0]

    assert program.returncode == 0, said
    assert strangers(tmp_path) == []
    typed = re.findall(r"^uavgram (\w+)", "".join(PAGES[TUTORIAL].run("sh")), re.MULTILINE)
    serving = {"view", "pick"}  # until they are ended: test_no_connection.py
    assert {arguments[0] for _, arguments, _ in calls} | {*typed} | serving == {
        name for name in app if not name.startswith("-")
    }


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


def test_the_tutorial_leads_from_nothing_to_a_report(tutorial: Tutorial) -> None:
    page, shown = PAGES[TUTORIAL], one_blank(tutorial.shown)

    for block in page.run("text"):
        for line in filter(None, block.splitlines()):
            assert one_blank(line) in shown, line
    out = tutorial.folder / "crossing" / "out"
    assert "skid left" in (out / "report.html").read_text(encoding="utf-8")
    results = json.loads((out / "results.json").read_text("utf-8"))
    # The run with the wrong length is not green and names it; the last run is right again.
    wrong = re.findall(r"^Verdict: (?:red|amber).*$", tutorial.shown, re.MULTILINE)
    assert "L1 does not fit and was left out" in wrong[-1], wrong
    assert results["verdict"]["level"] == "green"


def test_the_commands_of_the_tutorial_call_nobody(tutorial: Tutorial) -> None:
    if STRACE is None:
        pytest.skip("needs strace: apt install strace")
    assert strangers(tutorial.folder) == []
