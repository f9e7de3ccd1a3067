"""What serves until it is ended calls nobody: every connection stays on this machine.

The other commands are those of the manual: `test_manual_runs.py`.
"""

from __future__ import annotations

import json
import os
import signal
import sys
from pathlib import Path

import httpx
import pytest
from pick_pages import small_project
from small_recording import write_small_recording
from traced_programs import STRACE, strangers, traced

UAVGRAM = ("-m", "uavgram")
pytestmark = pytest.mark.skipif(STRACE is None, reason="needs strace: apt install strace")


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


def test_the_viewer_calls_nobody_and_leaves_no_trace_of_its_use(tmp_path: Path) -> None:
    analytics_agreed_to(tmp_path)
    kept = tmp_path / ".local/share/rerun/analytics"
    recording = write_small_recording(tmp_path / "a.rrd")
    with traced(
        tmp_path, sys.executable, "-P", *UAVGRAM, "view", str(recording)
    ) as viewer:  # without a screen it ends at once
        assert "needs a screen" in viewer.communicate(timeout=120)[0]
    assert strangers(tmp_path) == []
    with traced(
        tmp_path, sys.executable, "-P", *UAVGRAM, "view", str(recording), "--web"
    ) as viewer:
        try:
            assert viewer.stdout is not None
            line = viewer.stdout.readline()
            assert line.startswith("open http://127.0.0.1:"), line
        finally:
            os.killpg(viewer.pid, signal.SIGTERM)
    assert strangers(tmp_path) == []
    assert [path.name for path in kept.iterdir()] == ["1.json"]


def test_the_picking_page_calls_nobody(tmp_path: Path) -> None:
    project = str(small_project(tmp_path / "survey"))
    with traced(tmp_path, sys.executable, "-P", *UAVGRAM, "pick", project) as program:
        try:
            assert program.stdout is not None
            line = program.stdout.readline()
            address = line.removeprefix("Picking page: ").strip()
            with httpx.Client(timeout=60, follow_redirects=True) as browser:
                assert "uavgram" in browser.get(address).text
        finally:
            os.killpg(program.pid, signal.SIGINT)
        program.communicate(timeout=60)
    assert strangers(tmp_path) == []


def test_a_call_elsewhere_would_be_seen(tmp_path: Path) -> None:
    """Reserved addresses (RFC 5737, RFC 3849); connecting a datagram socket sends nothing."""
    call = "import socket; socket.socket({}, socket.SOCK_DGRAM).connect(({!r}, 9))"
    calls = (("socket.AF_INET", "192.0.2.1"), ("socket.AF_INET6", "2001:db8::1"))
    for family, address in calls:
        with traced(tmp_path, sys.executable, "-c", call.format(family, address)) as program:
            program.communicate(timeout=60)
        (line,) = strangers(tmp_path)
        assert address in line
