"""Opening a recording: what is none is named, and a viewer that cannot run says so."""

import subprocess
import sys

import pytest

from uavgram.errors import InputError, UavgramError
from uavgram.views import viewer


def test_what_is_no_recording_is_named(tmp_path):
    with pytest.raises(InputError, match=r"gone\.rrd: cannot be read"):
        viewer.open_viewer(tmp_path / "gone.rrd")
    (tmp_path / "text.rrd").write_text("RRFx: no recording")
    with pytest.raises(InputError, match=r"text\.rrd: is not a Rerun recording"):
        viewer.open_viewer(tmp_path / "text.rrd")


@pytest.mark.parametrize("status", [0, 1])
def test_the_viewer_listens_on_this_machine_only_and_its_failure_is_told(
    tmp_path, monkeypatch, status
):
    recording = tmp_path / "a.rrd"
    recording.write_bytes(b"RRF2 and more")
    calls = []

    def run(command, *, check):
        calls.append(command)
        assert not check
        return subprocess.CompletedProcess(command, status)

    monkeypatch.setattr(viewer.subprocess, "run", run)
    if status:
        with pytest.raises(UavgramError, match="needs a screen"):
            viewer.open_viewer(recording)
    else:
        viewer.open_viewer(recording)

    assert calls == [[sys.executable, "-m", "rerun", "--bind", "127.0.0.1", str(recording)]]
