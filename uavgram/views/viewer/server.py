"""Rerun viewer as a program of its own, on a screen or in a browser of this machine."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from urllib.parse import quote

from uavgram.errors import InputError, UavgramError
from uavgram.input_files import opened
from uavgram.views.viewer import process as viewer_process
from uavgram.views.viewer.proxy import LOOPBACK, ViewerProxy

MAGIC = (b"RRF2", b"RRIO", b"RRF0", b"RRF1")
START_S = 30.0
"""Longest wait for the viewer's server."""

_POLL_S = 0.05

_NO_ANALYTICS = {"CI": "1"}
"""Environment in which Rerun reports nothing about its use, and keeps no file of it.

It is that of automatic tests. The alternative, `rerun analytics disable`, would change the user's
own viewers.
"""

_FORCED = {"FORCE_RERUN_ANALYTICS"}


def open_viewer(recording: Path) -> None:
    """Open a recording in the viewer that came with rerun-sdk; return when it is closed.

    The viewer listens on this machine only.

    Raises
    ------
    InputError
        If there is no such file, or it is no recording.
    UavgramError
        If the viewer could not run, for example without a screen.
    """
    _check(recording)
    viewer = _start(["--bind", LOOPBACK, "--", str(recording)])
    try:
        status = viewer.wait()
    finally:
        _end(viewer)
    if status:
        raise UavgramError(
            f"the Rerun viewer ended with status {status}; it needs a screen and a graphics driver "
            f"(try in a browser: uavgram view {recording} --web)"
        )


class RecordingServer:
    """Viewer's server of one recording, in a process of its own, for this machine alone.

    Parameters
    ----------
    recording
        The file.

    Attributes
    ----------
    address
        Address to open in a browser.

    Raises
    ------
    InputError
        If there is no such file, or it is no recording.
    UavgramError
        If the server could not run.
    """

    def __init__(self, recording: Path) -> None:
        _check(recording)
        page, data = _free_ports(2)
        self._gate: ViewerProxy | None = None
        where = ("--web-viewer-port", str(page), "--port", str(data))
        self._process = _start(["--serve-web", "--bind", LOOPBACK, *where], RUST_LOG="error")
        try:
            self._wait_for_start(page, data)
        except BaseException:
            self.stop()
            raise
        self._gate = ViewerProxy(page, recording)
        home = f"http://{LOOPBACK}:{self._gate.server_port}"
        self.address = f"{home}?url={quote(home + self._gate.way, safe='')}&theme=dark"

    @property
    def is_up(self) -> bool:
        """Return whether it still runs."""
        return self._process.poll() is None

    def _wait_for_start(self, *ports: int) -> None:
        if not all(_is_up(self._process, port) for port in ports):
            raise UavgramError(
                "the Rerun viewer's server did not start: see its messages above, and "
                "check that rerun-sdk is installed completely"
            )

    def wait(self) -> int:
        """Wait until it ends; return its exit status."""
        return self._process.wait()

    def stop(self) -> None:
        """Stop it, and all that it started."""
        if self._gate is not None:
            self._gate.close()
            self._gate = None
        _end(self._process)


def serve_viewer(recording: Path, started: Callable[[str], None]) -> None:
    """Serve a recording to browsers of this machine, until Ctrl-C or until the server ends.

    Parameters
    ----------
    recording
        The file.
    started
        Called with the address once it can be opened.

    Raises
    ------
    InputError
        If there is no such file, or it is no recording.
    UavgramError
        If the server could not run.
    """
    server = RecordingServer(recording)
    try:
        started(server.address)
        status = server.wait()
    finally:
        server.stop()
    if status:
        raise UavgramError(f"the Rerun viewer's server ended with status {status}")


def _start(arguments: list[str], **environment: str) -> subprocess.Popen[bytes]:
    """Start the viewer's program; it ends with this process, in any way."""
    # -P: no file of the working directory is taken for a module of the program.
    command = [sys.executable, "-P", viewer_process.__file__, *arguments]
    given = {name: value for name, value in os.environ.items() if name not in _FORCED}
    # In a session or group of its own: Ctrl-C reaches this process alone.
    return subprocess.Popen(  # noqa: S603  (our own interpreter)
        command,
        stdin=subprocess.PIPE,
        env=given | _NO_ANALYTICS | environment,
        start_new_session=True,  # Windows has no sessions, the others no such flag
        creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
    )


def _end(process: subprocess.Popen[bytes]) -> None:
    """Stop the viewer's program, and the viewer that it runs."""
    if process.stdin is not None:
        process.stdin.close()
    try:
        process.wait(2.0 * viewer_process.END_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _check(recording: Path) -> None:
    with opened(recording) as stream:
        head = stream.read(4)
    if head not in MAGIC:
        raise InputError(recording, "is not a Rerun recording (.rrd)")


def _free_ports(count: int) -> list[int]:
    """Find ports of this machine that are free, all different."""
    held = [socket.create_server((LOOPBACK, 0)) for _ in range(count)]
    ports = [one.getsockname()[1] for one in held]
    for one in held:
        one.close()
    return ports


def _is_up(server: subprocess.Popen[bytes], port: int) -> bool:
    """Wait until the port answers; return False if the server ends, or does not answer in time."""
    end = time.monotonic() + START_S
    while server.poll() is None and time.monotonic() < end:
        try:
            with socket.create_connection((LOOPBACK, port), timeout=1.0):
                return True
        except OSError:
            time.sleep(_POLL_S)
    return False
