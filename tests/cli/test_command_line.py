"""The command line: what it prints, where, and with which exit status."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from cyclopts import App
from small_projects import Command, Project

from uavgram.cli import main
from uavgram.cli.application import Decimal

ESCAPE = "\x1b"


def test_run_prints_the_measurements_worst_first_and_then_the_messages(
    project: Project, command: Command
) -> None:
    done = command("run", project.path)
    assert (done.status, done.stderr) == (0, "")
    assert ESCAPE not in done.stdout
    table, said = done.stdout.split("\n\n", 1)
    shares = [
        row.split("%")[0].split()[-1]
        for row in table.splitlines()[2:]
        if "%" in row and "km/h" not in row
    ]
    assert len(shares) >= 7
    assert shares == sorted(shares, key=float, reverse=True)
    assert said.count("Verdict: ") == 1
    assert "info: Camera clock minus UTC is +2.60" in said
    assert said.splitlines()[-1].startswith("Verdict: ")


def test_verbose_says_the_steps_on_stderr(project: Project, command: Command) -> None:
    done = command("run", project.path, "-v")
    assert done.status == 0
    steps = done.stderr.splitlines()
    for step in ("read the inputs", "adjust and measure", "write results.json"):
        assert step in steps
    assert steps.index("read the inputs") < steps.index("write results.json")
    assert "ezdxf" not in done.stderr  # what libraries report of themselves
    assert "DXF" not in done.stderr.replace("survey_", "")
    assert ESCAPE not in done.stderr
    assert "±" in done.stdout


def test_output_goes_where_it_is_asked_to(project: Project, command: Command) -> None:
    before = project.outputs()
    assert command("run", project.path, "--output", project / "else" / "where").status == 0
    assert (project / "else" / "where" / "results.json").is_file()
    assert project.outputs() == before


def test_check_lists_photos_and_writes_nothing(project: Project, command: Command) -> None:
    before = project.outputs()
    done = command("check", project.path)
    assert (done.status, done.stderr) == (0, "")
    assert done.stdout.splitlines()[-1] == "every input can be read"
    assert sum(line.startswith("IMG_") for line in done.stdout.splitlines()) == 13
    assert project.outputs() == before


def test_log_says_what_is_in_it(project: Project, command: Command) -> None:
    done = command("log", project / "flight.tlog")
    assert (done.status, done.stderr) == (0, "")
    for word in ("2026-05-09", "CAMERA_FEEDBACK", "ATTITUDE"):
        assert word in done.stdout
    assert ESCAPE not in done.stdout


@pytest.mark.parametrize("name", ["twin_short.tlog", "twin_short.BIN"])
def test_log_reads_both_formats(repository: Path, command: Command, name: str) -> None:
    done = command("log", repository / "logs" / name)
    assert done.status == 0
    assert "2026-11-21" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["rnu", "project.yaml"], "Did you mean"),
        (["run", "a.yaml", "b.yaml"], "'b.yaml': this command does not take that"),
        (["run", "a.yaml", "--outptu", "x"], "Did you mean"),
        (["run", "a.yaml", "--output"], "--output"),
        (["demo", "--seed", "many"], "--seed takes a whole number, not 'many'"),
        (["demo", "--seed", "-1"], "--seed"),
        (["rectify", "--pixel-size", "12,001"], "--pixel-size"),
        (["log"], "FILE is missing"),
        (["view"], "is missing"),
    ],
)
def test_wrong_usage_is_status_2_on_stderr(
    command: Command,
    arguments: list[str],
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    done = command(*arguments)
    assert done.status == 2
    assert done.stdout == ""
    assert done.stderr.startswith("uavgram: ")
    assert said in done.stderr.splitlines()[0]
    known = f" {arguments[0]}" if arguments[0] != "rnu" else ""
    assert done.stderr.endswith(f"Try: uavgram{known} --help\n")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["run", "check", "rectify", "geotag"])
def test_without_a_project_here_the_way_to_one_is_told(
    command: Command, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for arguments in ([name], [name, tmp_path]):
        done = command(*arguments)
        assert (done.status, done.stdout) == (1, "")
        assert "project.yaml: there is no such file" in done.stderr
        assert "uavgram new" in done.stderr


def test_a_folder_means_the_project_in_it_and_nothing_the_present_one(
    project: Project, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(project.folder)
    named = command("check", project.path)
    assert command("check").stdout == command("check", project.folder).stdout == named.stdout
    assert named.status == 0


def test_the_table_stops_after_as_many_rows_as_asked_and_says_how_to_see_the_rest(
    project: Project, command: Command
) -> None:
    done = command("run", project.path, "--rows", "3")
    table, _, said = done.stdout.partition("\n\n")
    assert len(table.splitlines()) == 2 + 3 + 1
    assert "... and 8 more" in table
    assert "--rows 0" in table
    assert str(project.out / "measurements.csv") in table
    assert " fx " not in said  # what the camera learnt is for -v


def test_a_decimal_comma_is_a_point_where_it_can_mean_nothing_else() -> None:
    seen = []
    probe = App(name="probe", result_action="return_value")

    @probe.command
    def take(*, size: Decimal) -> None:
        seen.append(size)

    for typed in ("1,5", "1.5", "0,125"):
        probe(["take", "--size", typed])
    assert seen == [1.5, 1.5, 0.125]


def test_what_may_be_thousands_is_asked_about(command: Command) -> None:
    said = command("rectify", "--pixel-size", "12,001").stderr
    assert "is it 12.001 or 12001? Write it without a comma" in said


def test_shell_completion_can_be_installed(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    script = tmp_path / "uavgram.bash"
    assert command("--install-completion", "--shell", "bash", "--output", script).status == 0
    assert "rectify" in script.read_text()


def test_a_mistyped_command_is_suggested(command: Command) -> None:
    assert "Did you mean run?" in command("rnu", "project.yaml").stderr


@pytest.mark.parametrize(
    "arguments",
    [["run", "no.yaml"], ["check", "no.yaml"], ["log", "no.tlog"], ["view", "no.rrd"]],
)
def test_a_file_that_is_not_there_is_status_1(command: Command, arguments: list[str]) -> None:
    done = command(*arguments)
    assert done.status == 1
    assert done.stdout == ""
    assert arguments[1] in done.stderr
    assert done.stderr.count("\n") == 1


def test_help_names_every_command(command: Command) -> None:
    done = command("--help")
    assert done.status == 0
    for name in ("run", "demo", "check", "log", "view"):
        assert f" {name} " in done.stdout
    assert ESCAPE not in done.stdout


def test_version_is_that_of_the_package(command: Command) -> None:
    from importlib.metadata import version

    assert command("--version").stdout.strip() == version("uavgram")


def test_the_module_runs_too_with_status_and_plain_text(project: Project) -> None:
    """In a process of its own: exit statuses, pipes instead of a terminal."""
    arguments = [sys.executable, "-m", "uavgram"]
    good = subprocess.run([*arguments, "check", project.path], capture_output=True, check=False)
    assert good.returncode == 0
    assert b"every input can be read" in good.stdout
    assert ESCAPE.encode() not in good.stdout + good.stderr
    bad = subprocess.run([*arguments, "run", "no.yaml"], capture_output=True, check=False)
    assert bad.returncode == 1
    assert bad.stderr.startswith(b"uavgram: ")
    wrong = subprocess.run([*arguments, "rnu"], capture_output=True, check=False)
    assert wrong.returncode == 2


def test_a_reader_that_leaves_early_is_no_error(repository: Path) -> None:
    """As `uavgram log FILE | head -1` does."""
    log = repository / "logs" / "twin_short.tlog"
    process = subprocess.Popen(
        [sys.executable, "-m", "uavgram", "log", log],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    assert process.stderr.read() == b""
    process.stderr.close()
    assert process.wait() == 0


@pytest.mark.parametrize(("output", "status"), [(">&-", 0), (">/dev/full", 1)])
def test_output_that_goes_nowhere_is_no_traceback(
    repository: Path, output: str, status: int
) -> None:
    """As under a scheduler that closes it, or with a full disk behind it."""
    log = repository / "logs" / "twin_short.tlog"
    command = f'"{sys.executable}" -m uavgram log "{log}" {output}'
    done = subprocess.run(command, shell=True, capture_output=True, check=False)  # noqa: S602
    assert done.returncode == status
    assert b"Traceback" not in done.stderr
    assert done.stderr.count(b"\n") == status
    assert not status or b"standard output takes no text" in done.stderr


def test_a_terminal_without_special_characters_shows_others(project: Project) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "uavgram", "run", project.path],
        capture_output=True,
        check=False,
        env=os.environ | {"PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"},
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"skid left" in done.stdout


def test_a_scenario_that_is_none_is_told_by_file_and_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario = tmp_path / "scene.yaml"
    scenario.write_text("name: x\nsede: 3\n", encoding="utf-8")
    status = main(["demo", "--scenario", str(scenario), "--output", str(tmp_path / "demo")])

    assert status == 1
    assert "scene.yaml:2: sede" in capsys.readouterr().err
    assert not (tmp_path / "demo").exists()


@pytest.mark.parametrize(
    ("typed", "opened"),
    [
        ([], None),
        (["case"], "case"),
        (["./run", "--no-browser"], "run"),
        (["case/project.yaml"], "case/project.yaml"),
        (["pick", "case"], "case"),
        (["--port", "8123", "case"], "case"),
        (["--no-browser"], None),
    ],
    ids=range(7),
)
def test_without_a_command_the_page_opens(
    typed: list[str], opened: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from uavgram.cli import entry
    from uavgram.cli.commands import picks

    (tmp_path / "case").mkdir()
    (tmp_path / "run").mkdir()
    (tmp_path / "case" / "project.yaml").write_text("name: case\n")
    monkeypatch.chdir(tmp_path)
    served: list[Path | None] = []
    monkeypatch.setattr(picks, "_serve", lambda wanted, *_, **__: served.append(wanted))
    monkeypatch.setattr(picks, "_find_running_page", lambda *_, **__: False)
    assert entry.run_command(typed) == 0
    assert served == [None if opened is None else Path(opened)]


def test_a_command_wins_over_a_folder_of_its_name(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "check").mkdir()
    monkeypatch.chdir(tmp_path)
    done = command("check")
    assert done.status == 1
    assert "project.yaml: there is no such file" in done.stderr


def test_a_mistyped_folder_is_answered_with_its_neighbours(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "Holiday").mkdir()
    monkeypatch.chdir(tmp_path)
    for typed in ("./holidy", "holidy"):
        done = command(typed)
        assert done.status == 2
        first = done.stderr.splitlines()[0]
        assert f"{typed!r} is neither a command nor a folder or file" in first
        assert "Did you mean Holiday?" in first
    assert "Did you mean" not in command("nothing/like/it").stderr


@pytest.mark.parametrize("words", [[], ["run"], ["check"], ["pick"]])
def test_a_photo_or_log_in_place_of_a_project_leads_to_its_folder(
    command: Command, tmp_path: Path, repository: Path, words: list[str]
) -> None:
    photo = tmp_path / "photo.jpg"
    photo.write_bytes(cv2.imencode(".jpg", np.zeros((30, 40, 3), np.uint8))[1].tobytes())
    done = command(*words, photo)
    assert done.status == 1
    assert "photo.jpg: is a photo: name the project file (project.yaml), or the fo" in done.stderr
    done = command(*words, repository / "logs" / "twin_short.BIN")
    assert "is no text file: name the project file" in done.stderr
    text = tmp_path / "demo.out"
    text.write_text("run: 3 of 4: done\n", encoding="utf-8")
    assert "demo.out: is no project file: name the project file" in command(*words, text).stderr


def test_an_option_without_its_value_says_which_it_takes(command: Command) -> None:
    for option in ("--pdf", "--plan"):
        done = command("run", option)
        assert done.status == 2
        assert f"{option} takes a value after it: a4 or letter" in done.stderr
    done = command("picks", "import", "gcp_list.txt")
    assert "--output is missing: state it, with its value" in done.stderr
