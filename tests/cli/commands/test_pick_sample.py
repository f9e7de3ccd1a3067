"""`uavgram pick --sample` says where the sample is, and where the readings of its tape are."""

from __future__ import annotations

from pathlib import Path

import pytest

from uavgram.cli import main
from uavgram.cli.commands import pick as command
from uavgram.synthetic.accident_scene import SAMPLE_MARK


def test_the_readings_of_the_tape_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "sample"
    folder.mkdir()
    (folder / "project.yaml").write_text(f"{SAMPLE_MARK} as it was made.\n")
    monkeypatch.setattr(command, "_find_running_page", lambda *_, **__: True)

    assert main(["pick", "--sample", str(folder)]) == 0
    assert str(folder / "taped.txt") in capsys.readouterr().out
