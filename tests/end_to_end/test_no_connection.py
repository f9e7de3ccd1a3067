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

import httpx
import pytest
import yaml
from pick_pages import small_project
from small_recording import write_small_recording

from uavgram.cli.entry import app

UAVGRAM = ("-m", "uavgram")
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


def traced(folder: Path, *program: str) -> subprocess.Popen[str]:
    assert STRACE is not None
    calls = "trace=connect,sendto,sendmsg,sendmmsg"
    trace = [STRACE, "-f", "--seccomp-bpf", "-qq", "-e", calls, "-o", str(folder / "trace")]
    return subprocess.Popen(
        [*trace, sys.executable, "-P", *program],
        env=os.environ | {"HOME": str(folder), "DISPLAY": "", "WAYLAND_DISPLAY": ""},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        cwd=folder,
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


def test_the_viewer_calls_nobody_and_leaves_no_trace_of_its_use(tmp_path: Path) -> None:
    analytics_agreed_to(tmp_path)
    kept = tmp_path / ".local/share/rerun/analytics"
    recording = write_small_recording(tmp_path / "a.rrd")
    with traced(
        tmp_path, *UAVGRAM, "view", str(recording)
    ) as viewer:  # without a screen it ends at once
        assert "needs a screen" in viewer.communicate(timeout=120)[0]
    assert strangers(tmp_path / "trace") == []
    with traced(tmp_path, *UAVGRAM, "view", str(recording), "--web") as viewer:
        try:
            assert viewer.stdout is not None
            line = viewer.stdout.readline()
            assert line.startswith("open http://127.0.0.1:"), line
        finally:
            os.killpg(viewer.pid, signal.SIGTERM)
    assert strangers(tmp_path / "trace") == []
    assert [path.name for path in kept.iterdir()] == ["1.json"]


COMMANDS = """
import json, sys
from uavgram.cli import main
done = [(arguments[0], main(arguments)) for arguments in json.loads(sys.argv[1])]
print(json.dumps(done))
"""


def small_demo(configs: Path, folder: Path) -> Path:
    """The built-in survey with nine small photos."""
    scenario = yaml.safe_load((configs / "demo.yaml").read_text(encoding="utf-8"))
    camera = scenario["camera"]
    camera.update(width_px=400, height_px=300)
    for name in ("parameters", "sigma"):
        camera[name] = [x / 5 if k < 4 else x for k, x in enumerate(camera[name])]
    scenario["flight"]["photos_per_strip"] = 5
    scenario["errors"]["lost_exposure"] = 6
    path = folder / "demo.yaml"
    path.write_text(yaml.safe_dump(scenario), encoding="utf-8")
    return path


def test_no_command_calls_anybody(repository: Path, data_dir: Path, tmp_path: Path) -> None:
    for name in ("configs", "logs"):
        shutil.copytree(repository / name, tmp_path / name)
    shutil.copytree(tmp_path / "configs" / "photos", tmp_path / "others" / "photos")
    board = [str(data_dir / "opencv_chess" / f"left{k:02}.jpg") for k in range(1, 6)]
    marked = tmp_path / "gcp_list.txt"
    marked.write_text("EPSG:25832\n565000 5330000 520 10.25 20.5 a.jpg A\n", encoding="utf-8")
    survey = str(tmp_path / "configs" / "project.yaml")
    calls = [
        ["check", survey],
        ["run", survey],
        ["rectify", survey, "--frame", "IMG_0043.jpg", "--pixel-size", "0.2"],
        ["geotag", survey],
        ["explain", "pick-suspect"],
        ["demo", "--scenario", str(small_demo(tmp_path / "configs", tmp_path))],
        ["new", str(tmp_path / "others")],
        ["log", str(tmp_path / "logs" / "twin_short.BIN")],
        ["camera", str(tmp_path / "configs" / "camera.yaml"), "--to", "opencv"],
        ["calibrate", *board, "--board", "chessboard:9x6:25mm", "--coefficients", "3"],
        ["picks", "import", str(marked), "--output", "picks.csv"],
        ["targets", "print", "--plates", "1", "--side-m", "0.12", "--output", "plates.pdf"],
        ["plan", str(tmp_path / "configs" / "plan.yaml")],
        ["simulate", str(tmp_path / "configs" / "single_photo.yaml"), "--repetitions", "2"],
        ["study", "lengths", "--repetitions", "20", "--workers", "1"],
        ["batch", survey, "--workers", "1"],
        ["shortcut", "--folder", str(tmp_path)],
    ]
    elsewhere = {"view", "pick"}  # they serve until they are ended: below
    assert {arguments[0] for arguments in calls} | elsewhere == {
        name for name in app if not name.startswith("-")
    }
    with traced(tmp_path, "-c", COMMANDS, json.dumps(calls)) as program:
        said = program.communicate(timeout=300)[0]
    done = json.loads(said.splitlines()[-1])
    assert done == [[arguments[0], 0] for arguments in calls], said
    assert strangers(tmp_path / "trace") == []


def test_the_picking_page_calls_nobody(tmp_path: Path) -> None:
    project = str(small_project(tmp_path / "survey"))
    with traced(tmp_path, *UAVGRAM, "pick", project) as program:
        try:
            assert program.stdout is not None
            line = program.stdout.readline()
            address = line.removeprefix("Picking page: ").strip()
            with httpx.Client(timeout=60, follow_redirects=True) as browser:
                assert "uavgram" in browser.get(address).text
        finally:
            os.killpg(program.pid, signal.SIGINT)
        program.communicate(timeout=60)
    assert strangers(tmp_path / "trace") == []


def test_a_call_elsewhere_would_be_seen(tmp_path: Path) -> None:
    """Reserved addresses (RFC 5737, RFC 3849); connecting a datagram socket sends nothing."""
    call = "import socket; socket.socket({}, socket.SOCK_DGRAM).connect(({!r}, 9))"
    calls = (("socket.AF_INET", "192.0.2.1"), ("socket.AF_INET6", "2001:db8::1"))
    for family, address in calls:
        with traced(tmp_path, "-c", call.format(family, address)) as program:
            program.communicate(timeout=60)
        (line,) = strangers(tmp_path / "trace")
        assert address in line
