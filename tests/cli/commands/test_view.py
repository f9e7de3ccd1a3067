"""`uavgram view` and `uavgram run --view`: which recording is shown, and how it ends."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Never

import pytest
from small_projects import Command, Project

from uavgram.views.viewer import server as viewer


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Recordings that were opened on the screen, without opening any."""
    calls: list[Path] = []
    monkeypatch.setattr(viewer, "open_viewer", calls.append)
    return calls


def test_a_run_opens_the_review_that_it_wrote(
    project: Project, command: Command, shown: list[Path], tmp_path: Path
) -> None:
    assert command("run", project.path, "--view").status == 0
    assert command("run", project.path, "--view", "--output", tmp_path / "other").status == 0
    assert command("run", project.path).status == 0

    assert shown == [project.out / "recording.rrd", tmp_path / "other" / "recording.rrd"]
    assert all(path.is_file() for path in shown)


def test_on_a_screen_the_recording_itself_is_opened(
    project: Project, command: Command, shown: list[Path]
) -> None:
    assert command("view", project.out / "recording.rrd").status == 0
    assert shown == [project.out / "recording.rrd"]


def test_in_a_browser_the_address_is_said_and_ctrl_c_is_the_end(
    project: Project, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    def serve(recording: Path, started: Callable[[str], None]) -> Never:
        assert recording == project.out / "recording.rrd"
        started("http://127.0.0.1:1234?url=x")
        raise KeyboardInterrupt

    monkeypatch.setattr(viewer, "serve_viewer", serve)

    done = command("view", project.out / "recording.rrd", "--web")

    assert done.status == 130
    assert "open http://127.0.0.1:1234?url=x\nCtrl+C ends it" in done.stdout
    assert done.stderr == "uavgram: interrupted; earlier results are as they were\n"


@pytest.mark.parametrize("flags", [[], ["--web"]])
def test_what_is_no_recording_is_one_message(
    project: Project, command: Command, flags: list[str]
) -> None:
    done = command("view", project.path, *flags)

    assert done.status == 1
    assert "project.yaml: is not a Rerun recording" in done.stderr
