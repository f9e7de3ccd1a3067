"""Commands call nobody: every connection that they open stays on this machine."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from pick_pages import small_project
from small_recording import write_small_recording

STRACE = shutil.which("strace")
pytestmark = pytest.mark.skipif(STRACE is None, reason="needs strace: apt install strace")

ADDRESS = re.compile(r'inet_addr\("([\d.]+)"\)|inet_pton\(AF_INET6, "([^"]+)"')
LOOPBACK = re.compile(r"127\.|::1$|0\.0\.0\.0$|::ffff:127\.")


def strangers(trace: Path) -> list[str]:
    """Calls to addresses that are none of this machine's own."""
    return [
        line
        for line in trace.read_text(errors="replace").splitlines()
        for found in ADDRESS.finditer(line)
        if not LOOPBACK.match(found[1] or found[2])
    ]


def traced(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    calls = "trace=connect,sendto,sendmsg,sendmmsg"
    trace = [STRACE, "-f", "--seccomp-bpf", "-qq", "-e", calls, "-o", str(folder / "trace")]
    return subprocess.Popen(
        [*trace, sys.executable, "-P", "-m", "uavgram", *arguments],
        env=os.environ | {"HOME": str(folder), "DISPLAY": "", "WAYLAND_DISPLAY": ""},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )


def analytics_agreed_to(folder: Path) -> None:
    """As Rerun's first start leaves it; it sends from the second one on."""
    config, kept = folder / ".config" / "rerun", folder / ".local" / "share" / "rerun" / "analytics"
    config.mkdir(parents=True)
    kept.mkdir(parents=True)
    (kept / "1.json").touch()
    agreed = {
        "analytics_enabled": True,
        "analytics_id": "0" * 32,
        "metadata": {},
        "config_file_path": str(config / "analytics.json"),
        "data_dir_path": str(kept),
    }
    (config / "analytics.json").write_text(json.dumps(agreed))


def test_the_viewer_calls_nobody_and_leaves_no_trace_of_its_use(tmp_path):
    analytics_agreed_to(tmp_path)
    kept = tmp_path / ".local/share/rerun/analytics"
    recording = write_small_recording(tmp_path / "a.rrd")
    with traced(tmp_path, "view", str(recording)) as viewer:  # without a screen it ends at once
        assert "needs a screen" in viewer.communicate(timeout=120)[0]
    assert strangers(tmp_path / "trace") == []
    with traced(tmp_path, "view", str(recording), "--web") as viewer:
        try:
            line = viewer.stdout.readline()
            assert line.startswith("open http://127.0.0.1:"), line
        finally:
            os.killpg(viewer.pid, signal.SIGTERM)
    assert strangers(tmp_path / "trace") == []
    assert [path.name for path in kept.iterdir()] == ["1.json"]


def test_a_check_calls_nobody(tmp_path):
    with traced(tmp_path, "check", str(small_project(tmp_path / "survey"))) as program:
        assert "picks.csv" in program.communicate(timeout=300)[0]  # there is none yet
    assert strangers(tmp_path / "trace") == []
