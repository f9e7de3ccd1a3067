"""Ctrl+C at any moment of real commands: one line, status 130, nothing half-written."""

from __future__ import annotations

import os
import select
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from pick_pages import small_project
from small_projects import write_small_survey

from uavgram.cli import main

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals of Linux and macOS")

LONGEST_WAIT_S = 120.0
LINE = "uavgram: interrupted; no result is half written\n"
# It says so from within `main`: before that the process is Python's, which answers in its own way.
BEGIN = """
import os, sys
from uavgram.cli import main
def look(event, about):
    if event == "import" and about[0] == "uavgram.cli.start":
        os.write(1, b"!")
sys.addaudithook(look)
sys.exit(main())
"""
ENDS = "uavgram: interrupted; the command was done already\n"


class Ended(NamedTuple):
    status: int
    said: str


def start(*command: object, code: str = BEGIN) -> subprocess.Popen[str]:
    """A command in a group of its own, once its first line is at work."""
    process = subprocess.Popen(
        [sys.executable, "-P", "-c", code, *map(str, command)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert process.stdout is not None
    assert select.select([process.stdout], [], [], LONGEST_WAIT_S)[0]
    return process


ENDING_S = 0.1
"""Within so long of a strike, a process that ends well and silently had ended before."""


def struck(process: subprocess.Popen[str], after_s: float) -> Ended | None:
    """How it ended when Ctrl+C came so late; None where it had ended before."""
    with process:
        try:
            process.wait(after_s)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGINT)  # as a terminal does: workers get it too
            struck_at = time.monotonic()
            _, said = process.communicate(timeout=LONGEST_WAIT_S)
            is_over = time.monotonic() - struck_at < ENDING_S
            if not (is_over and process.returncode == 0 and not said):
                return Ended(process.returncode, said)
        return None


def lasts_s(*command: object) -> float:
    began = time.monotonic()
    with start(*command) as process:
        process.communicate(timeout=LONGEST_WAIT_S)
    return time.monotonic() - began


@pytest.fixture(scope="module")
def survey(tmp_path_factory: pytest.TempPathFactory) -> Path:
    project = write_small_survey(tmp_path_factory.mktemp("struck") / "survey")
    assert main(["run", str(project)]) == 0
    return project.parent


def strike_often(command: list[object], times: int) -> None:
    """Strike at moments spread over the whole command, a little at random."""
    rng = np.random.default_rng(34)
    whole_s = lasts_s(*command)
    struck_at = 0
    for k in range(times):
        ended = struck(start(*command), whole_s * (k + rng.random()) / times)
        struck_at += ended is not None
        if ended is not None:
            assert ended.said in {LINE, ENDS}
            assert ended.status == 130
    assert struck_at  # the first at least: how long the others take depends on the machine


def test_help_can_be_broken_off_while_it_loads() -> None:
    strike_often(["--help"], 5)


def test_a_log_can_be_broken_off(repository: Path) -> None:
    strike_often(["log", repository / "logs" / "twin_short.tlog"], 5)


def test_a_run_can_be_broken_off_and_keeps_its_results(survey: Path) -> None:
    before = sorted(path.name for path in survey.rglob("*"))
    strike_often(["run", survey / "project.yaml"], 4)
    assert sorted(path.name for path in survey.rglob("*")) == before


def test_a_second_ctrl_c_does_not_break_off_the_end_of_the_page(survey: Path) -> None:
    command = [sys.executable, "-m", "uavgram", "pick", survey, "--no-browser"]
    with subprocess.Popen(
        list(map(str, command)),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        assert process.stdout is not None
        assert any("http://" in line for line in process.stdout)
        time.sleep(0.2)  # until the server waits for requests
        for _ in range(2):
            os.killpg(process.pid, signal.SIGINT)
            time.sleep(0.02)
        _, said = process.communicate(timeout=LONGEST_WAIT_S)
    assert (process.returncode, said) == (130, "uavgram: ended; everything is saved\n")


def test_a_calibration_can_be_broken_off(tmp_path: Path) -> None:
    board = ["--board", "chessboard:9x6:25mm", "--output", tmp_path / "out"]
    ended = struck(start("calibrate", tmp_path, *board), 0.05)
    assert ended is None or ended == Ended(130, LINE)


def test_a_batch_can_be_broken_off_while_its_workers_load(survey: Path, tmp_path: Path) -> None:
    for name in "ab":
        shutil.copytree(survey, tmp_path / "surveys" / name)
    breaks = []
    for after_s in (1.0, 1.6, 2.2, 3.0):
        out = tmp_path / f"out-{after_s}"
        batch = start("batch", tmp_path / "surveys", "--workers", 2, "--output", out)
        breaks.append(struck(batch, after_s))
    assert set(breaks) <= {None, Ended(130, LINE)}
    assert any(breaks)  # whether the later ones come in time depends on the machine


CONVERTS = """
import os, sys, signal, uavgram.cli.entry as entry
from uavgram.errors import UavgramError
from uavgram.cli import main
class Late:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)
        for _ in range(1000): pass
def turned(_):
    try:
        os.kill(os.getpid(), signal.SIGINT)
        for _ in range(1000): pass
    except BaseException as fault:
        raise {fault}("a library could not be loaded") from fault
def dropped(_):
    late = Late()
    del late
    for _ in range(10_000_000): len("x")
def done(_):
    import atexit
    atexit.register(lambda: (os.kill(os.getpid(), signal.SIGINT), [0 for _ in range(1000)]))
    return 0
def failed(_):
    done(_)
    raise UavgramError("the message")
entry.app = {what}
os.write(1, b"!")
sys.exit(main())
"""


@pytest.mark.parametrize("fault", ["ImportError", "SystemError", "UavgramError", "SystemExit"])
def test_what_a_library_makes_of_it_is_still_ctrl_c(fault: str) -> None:
    with start(code=CONVERTS.format(what="turned", fault=fault)) as process:
        _, said = process.communicate(timeout=LONGEST_WAIT_S)
    assert (process.returncode, said) == (130, LINE)


def test_where_nothing_can_be_raised_it_is_raised_a_moment_later() -> None:
    with start(code=CONVERTS.format(what="dropped", fault="")) as process:
        _, said = process.communicate(timeout=LONGEST_WAIT_S)
    assert (process.returncode, said) == (130, LINE)


TWICE = """
import os, shutil, signal, sys, uavgram.cli.entry as entry
from uavgram.cli import main
from uavgram.io.outputs import stage_output
def strike():
    os.kill(os.getpid(), signal.SIGINT)
    for _ in range(1000): pass
remove = shutil.rmtree
def interrupted_remove(*of, **how):
    strike()
    remove(*of, **how)
def twice(_):
    with stage_output(output) as folder:
        (folder / "half").touch()
        shutil.rmtree = interrupted_remove
        strike()
entry.app = twice
os.write(1, b"!")
sys.exit(main())
"""


def test_a_second_ctrl_c_leaves_nothing_of_the_first_one_behind(tmp_path: Path) -> None:
    with start(code=f"output = {str(tmp_path)!r}\n{TWICE}") as process:
        _, said = process.communicate(timeout=LONGEST_WAIT_S)
    assert (process.returncode, said) == (130, LINE)
    assert list(tmp_path.iterdir()) == []


EARLY = """
import os, signal, sys
from uavgram.cli import main
def strike(event, about):
    if event == "import" and about[0] in {"uavgram.cli.start", "uavgram.cli.interrupt"}:
        os.kill(os.getpid(), signal.SIGINT)
        for _ in range(1000): pass
sys.addaudithook(strike)
os.write(1, b"!")
sys.exit(main())
"""


def test_a_second_ctrl_c_before_anything_is_loaded_gives_one_line_too() -> None:
    with start(code=EARLY) as process:
        _, said = process.communicate(timeout=LONGEST_WAIT_S)
    assert (process.returncode, said) == (130, LINE)


WITHIN = """
import os, shutil, signal, sys, uavgram.cli.entry as entry
from uavgram.cli import main
from uavgram.io.outputs import stage_output
def strike_within(module, name):
    work = getattr(module, name)
    def struck(*of, **how):
        os.kill(os.getpid(), signal.SIGINT)
        for _ in range(1000): pass
        return work(*of, **how)
    setattr(module, name, struck)
def once(_):
    with stage_output(output) as folder:
        (folder / "new").touch()
        for _ in range(10_000_000): len("x")
strike_within({where})
entry.app = once
os.write(1, b"!")
sys.exit(main())
"""


@pytest.mark.parametrize(("where", "kept"), [("os, 'close'", []), ("shutil, 'rmtree'", ["new"])])
def test_a_context_is_set_up_and_put_away_whole(
    tmp_path: Path, where: str, kept: list[str]
) -> None:
    code = f"output = {str(tmp_path)!r}\n{WITHIN.format(where=where)}"
    with start(code=code) as process:
        _, said = process.communicate(timeout=LONGEST_WAIT_S)
    assert (process.returncode, said) == (130, LINE)
    assert [path.name for path in tmp_path.iterdir()] == kept


@pytest.mark.parametrize(
    ("what", "ended"), [("done", Ended(130, ENDS)), ("failed", Ended(1, "uavgram: the message\n"))]
)
def test_while_python_puts_things_away_there_is_one_line_too(what: str, ended: Ended) -> None:
    with start(code=CONVERTS.format(what=what, fault="")) as process:
        _, said = process.communicate(timeout=LONGEST_WAIT_S)
    assert (process.returncode, said) == ended


def test_a_command_in_the_background_that_ignores_ctrl_c_goes_on_ignoring_it() -> None:
    code = f"import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)\n{BEGIN}"
    process = start("--version", code=code)
    os.killpg(process.pid, signal.SIGINT)
    with process:
        _, said = process.communicate(timeout=LONGEST_WAIT_S)
    assert (process.returncode, said) == (0, "")


def test_a_page_in_the_background_that_is_ended_gives_the_true_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The shell lets such a job ignore Ctrl+C, but the web server ends at the signal."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    code = f"import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)\n{BEGIN}"
    process = start("pick", small_project(tmp_path / "flight"), "--no-browser", code=code)
    with process:
        assert process.stdout is not None
        while "Ctrl+C" not in process.stdout.readline():
            pass
        os.kill(process.pid, signal.SIGINT)
        shown, said = process.communicate(timeout=LONGEST_WAIT_S)
    assert (process.returncode, said) == (130, "uavgram: ended; everything is saved\n")
    assert "no tab" not in shown
