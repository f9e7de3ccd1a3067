"""Opening a recording: what is none is named, what cannot run says so, and nobody else can look."""

from __future__ import annotations

import os
import re
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple, Never, TypedDict, Unpack
from urllib.parse import parse_qs, urlsplit

import pytest
from small_recording import write_small_recording

from uavgram.errors import InputError, UavgramError
from uavgram.views import viewer
from uavgram.views import viewer as viewer_gate


class StartOptions(TypedDict):
    """What a process of the viewer is started with."""

    stdin: int
    env: dict[str, str]
    start_new_session: bool
    creationflags: int


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    return write_small_recording(tmp_path / "a.rrd")


@pytest.mark.parametrize("show", [viewer.open_viewer, lambda p: viewer.serve_viewer(p, print)])
def test_what_is_no_recording_is_named(tmp_path: Path, show: Callable[[Path], None]) -> None:
    with pytest.raises(InputError, match=r"gone\.rrd: cannot be read"):
        show(tmp_path / "gone.rrd")
    (tmp_path / "text.rrd").write_text("RRFx: no recording")
    with pytest.raises(InputError, match=r"text\.rrd: is not a Rerun recording"):
        show(tmp_path / "text.rrd")


@pytest.mark.parametrize("status", [0, 1])
def test_the_viewer_listens_on_this_machine_only_and_its_failure_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, status: int
) -> None:
    path = tmp_path / "a.rrd"
    path.write_bytes(b"RRF2 and more")
    calls: list[list[str]] = []
    start = subprocess.Popen

    def popen(command: list[str], **options: Unpack[StartOptions]) -> subprocess.Popen[bytes]:
        calls.append(command)
        return start([sys.executable, "-c", f"raise SystemExit({status})"], **options)

    monkeypatch.setattr(subprocess, "Popen", popen)
    if status:
        with pytest.raises(UavgramError, match=r"needs a screen.*a\.rrd --web"):
            viewer.open_viewer(path)
    else:
        viewer.open_viewer(path)

    assert [call[3:] for call in calls] == [["--bind", "127.0.0.1", "--", str(path)]]
    assert calls[0][1] == "-P"  # no module from the folder that somebody stands in


def processes_of(parent: int) -> list[int]:
    """Its number, and those of all that it started."""
    children = Path(f"/proc/{parent}/task/{parent}/children").read_text().split()
    return [parent, *(pid for child in children for pid in processes_of(int(child)))]


def listening(pids: list[int]) -> set[tuple[str, int]]:
    """(address in hex, port) of every TCP socket that these processes listen on (proc(5))."""
    owned = set()
    for pid in pids:
        for handle in Path(f"/proc/{pid}/fd").iterdir():
            try:
                owned.add(str(handle.readlink()))
            except OSError:
                continue
    found = set()
    for name in ("tcp", "tcp6"):
        for row in Path(f"/proc/net/{name}").read_text().splitlines()[1:]:
            cells = row.split()
            if cells[3] == "0A" and f"socket:[{cells[9]}]" in owned:
                address, port = cells[1].split(":")
                found.add((address, int(port, 16)))
    return found


class Seen(NamedTuple):
    """What was there while the recording was served."""

    pids: list[int]
    sockets: set[tuple[str, int]]
    address: str
    page: bytes
    policy: str
    recording: bytes
    guessed: int
    foreign: list[int]


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="needs Linux's /proc")
def test_in_a_browser_it_is_served_to_this_machine_only_and_ends_whole(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks: list[Seen] = []
    servers: list[subprocess.Popen[bytes]] = []
    start = subprocess.Popen

    def popen(command: list[str], **options: Unpack[StartOptions]) -> subprocess.Popen[bytes]:
        servers.append(start(command, **options))
        return servers[-1]

    monkeypatch.setattr(subprocess, "Popen", popen)

    def started(address: str) -> Never:
        pids = processes_of(servers[0].pid)
        sockets = listening(pids)
        with urllib.request.urlopen(address, timeout=60) as answer:  # noqa: S310
            page, policy = answer.read(), answer.headers["content-security-policy"]
        source = parse_qs(urlsplit(address).query)["url"][0]
        with urllib.request.urlopen(source, timeout=60) as file:  # noqa: S310
            content = file.read()
        others = ({"Host": "evil.example"}, {"Sec-Fetch-Site": "same-site"})
        guessed = status_of(f"http://{urlsplit(address).netloc}/recording.rrd", {})
        foreign = [status_of(source, headers) for headers in others]
        looks.append(Seen(pids, sockets, address, page, policy, content, guessed, foreign))
        raise KeyboardInterrupt  # as Ctrl-C does

    with pytest.raises(KeyboardInterrupt):
        viewer.serve_viewer(recording, started)

    (seen,) = looks
    address = urlsplit(seen.address)
    source = urlsplit(parse_qs(address.query)["url"][0])
    assert source.netloc == address.netloc
    assert re.fullmatch(r"/[-\w]{43}/recording\.rrd", source.path)  # no other user can guess it
    assert seen.guessed == 404
    assert address.hostname == "127.0.0.1"
    assert len(seen.sockets) == 2
    assert {place for place, _ in seen.sockets} == {"0100007F"}  # 127.0.0.1, little-endian
    assert b"<html" in seen.page.lower()
    assert b"<link" in seen.page
    assert not re.search(rb"<link[^>]*https?://", seen.page)  # nothing is fetched elsewhere
    assert "//" not in seen.policy
    assert "connect-src 'self';" in seen.policy
    assert seen.recording == recording.read_bytes()
    assert seen.foreign == [403, 403]
    assert len(seen.pids) == 2
    for port in {address.port, *(port for _, port in seen.sockets)}:  # nothing is left behind
        with pytest.raises(OSError), socket.create_connection(("127.0.0.1", port), timeout=1):
            pass


def test_the_gate_waits_for_no_one_who_says_nothing(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(viewer_gate, "HEADERS_S", 0.2)
    gate = viewer_gate.ViewerProxy(1, recording)
    try:
        with ExitStack() as calls:
            for k in range(viewer_gate.MAX_AT_ONCE + 10):
                call = socket.create_connection(("127.0.0.1", gate.server_port), timeout=30)
                calls.callback(call.close)
                call.sendall(b"GET / HTTP/1.1\r\nHost: x"[: k % 20])
            assert call.recv(1) == b""  # one too many
            time.sleep(0.4)
            address = f"http://127.0.0.1:{gate.server_port}{gate.way}"
            with urllib.request.urlopen(address, timeout=30) as file:
                assert file.read() == recording.read_bytes()
    finally:
        gate.close()


def slow_reader(address: str) -> socket.socket:
    """A connection that asks for an address, and has read no more than the first byte."""
    parts = urlsplit(address)
    assert parts.hostname is not None
    call = socket.socket()
    call.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    call.settimeout(60)
    call.connect((parts.hostname, parts.port))
    call.sendall(f"GET {parts.path} HTTP/1.1\r\nHost: {parts.netloc}\r\n\r\n".encode())
    return call


def resident_mb(pid: int) -> float:
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs Linux's /proc")
def test_slow_readers_share_one_copy_of_what_they_read(recording: Path) -> None:
    """Of the viewer's 43 MB; each had one of its own, and 70 readers took 1.6 GB."""
    with (
        subprocess.Popen(
            [sys.executable, "-P", "-m", "uavgram", "view", str(recording), "--web"],
            stdout=subprocess.PIPE,
            text=True,
        ) as program,
        ExitStack() as calls,
    ):
        calls.callback(program.terminate)
        assert program.stdout is not None
        home = program.stdout.readline().split()[1].partition("?")[0]
        before = resident_mb(program.pid)
        readers = [slow_reader(f"{home}/re_viewer_bg.wasm") for _ in range(20)]
        for reader in readers:
            calls.callback(reader.close)
            assert reader.recv(1) == b"H"
        assert resident_mb(program.pid) - before < 2 * 43 + 30


def test_readers_that_take_nothing_are_let_go(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(viewer_gate, "WRITE_S", 0.2)
    path = tmp_path / "large.rrd"
    with path.open("wb") as stream:
        stream.write(b"RRF2")
        stream.truncate(1 << 26)
    gate = viewer_gate.ViewerProxy(1, path)
    address = f"http://127.0.0.1:{gate.server_port}{gate.way}"
    try:
        with ExitStack() as calls:
            for _ in range(viewer_gate.MAX_AT_ONCE):
                reader = slow_reader(address)
                calls.callback(reader.close)
                assert reader.recv(1) == b"H"
            time.sleep(1.0)
            with urllib.request.urlopen(address, timeout=30) as file:
                assert len(file.read()) == 1 << 26
    finally:
        gate.close()


def test_no_answer_of_the_gate_is_taken_for_another_kind_of_file(recording: Path) -> None:
    gate = viewer_gate.ViewerProxy(1, recording)
    home = f"http://127.0.0.1:{gate.server_port}"
    try:
        with urllib.request.urlopen(home + gate.way, timeout=30) as given:  # noqa: S310
            answers = [given.headers]
        for path, more in (("/", {}), (gate.way, {"Sec-Fetch-Site": "same-site"})):
            request = urllib.request.Request(home + path, headers=more)  # noqa: S310
            with pytest.raises(urllib.error.HTTPError) as refused:
                urllib.request.urlopen(request, timeout=30)  # noqa: S310
            answers.append(refused.value.headers)
            refused.value.close()
    finally:
        gate.close()
    for headers in answers:
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["content-security-policy"] == viewer_gate.POLICY


def test_a_reader_that_left_is_no_fault_of_the_program(
    recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    gate = viewer_gate.ViewerProxy(1, recording)
    try:
        for _ in range(20):  # refused, and reset before the answer is written
            with socket.create_connection(("127.0.0.1", gate.server_port)) as call:
                call.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                call.sendall(b"GET / HTTP/1.1\r\nHost: elsewhere\r\n\r\n")
        time.sleep(0.5)
    finally:
        gate.close()
    assert capsys.readouterr().err == ""


def status_of(address: str, headers: dict[str, str]) -> int:
    """Of a request that is refused."""
    request = urllib.request.Request(address, headers=headers)  # noqa: S310
    with pytest.raises(urllib.error.HTTPError) as refused:
        urllib.request.urlopen(request, timeout=60)  # noqa: S310
    refused.value.close()
    return refused.value.code


def test_a_server_that_ends_at_once_is_told(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(viewer, "sys", type("S", (), {"executable": "/bin/false"}))

    with pytest.raises(UavgramError, match="did not start"):
        viewer.serve_viewer(recording, print)


def test_a_server_that_is_killed_is_told(recording: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    started = threading.Event()
    start = subprocess.Popen

    def popen(command: list[str], **options: Unpack[StartOptions]) -> subprocess.Popen[bytes]:
        code = (
            "import socket, sys, time;"
            "held = [socket.create_server(('127.0.0.1', int(p))) for p in sys.argv[1:]];"
            "time.sleep(60)"
        )
        ports = [command[i + 1] for i, a in enumerate(command) if a.endswith("port")]
        server = start([sys.executable, "-c", code, *ports], **options)

        def kill() -> None:
            started.wait(30)
            os.kill(server.pid, signal.SIGKILL)

        threading.Thread(target=kill, daemon=True).start()
        return server

    monkeypatch.setattr(subprocess, "Popen", popen)

    with pytest.raises(UavgramError, match="ended with status -9"):
        viewer.serve_viewer(recording, lambda _: started.set())


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="needs Linux's /proc")
@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGHUP, signal.SIGKILL])
def test_the_viewer_ends_with_the_program_however_that_ends(
    recording: Path, tmp_path: Path, how: signal.Signals
) -> None:
    (tmp_path / "rerun_cli.py").write_text("raise SystemExit('taken from the folder')")
    home = {"HOME": str(tmp_path), "FORCE_RERUN_ANALYTICS": "1"}
    with subprocess.Popen(
        [sys.executable, "-P", "-m", "uavgram", "view", str(recording), "--web"],
        cwd=tmp_path,
        env=os.environ | home,
        stdout=subprocess.PIPE,
        text=True,
    ) as program:
        assert program.stdout is not None
        assert program.stdout.readline().startswith("open http://127.0.0.1:")
        pids = processes_of(program.pid)
        assert len(pids) == 3
        program.send_signal(how)
        assert program.wait(30) == -how
    latest = time.monotonic() + 30
    while any(is_running(pid) for pid in pids) and time.monotonic() < latest:
        time.sleep(0.02)
    assert [pid for pid in pids if is_running(pid)] == []
    assert not (tmp_path / ".config").exists()  # Rerun's analytics keep a file there


def is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2][0] != "Z"
    except OSError:
        return False
