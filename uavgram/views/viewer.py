"""The Rerun viewer as a program of its own, on a screen or in a browser of this machine."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from uavgram.errors import InputError, UavgramError

MAGIC = (b"RRF2", b"RRIO", b"RRF0", b"RRF1")
LOOPBACK = "127.0.0.1"
START_S = 30.0
"""Longest wait for the viewer's server."""

_POLL_S = 0.05


def open_viewer(recording: Path) -> None:
    """Open a recording in the viewer that came with rerun-sdk; return when it is closed.

    The viewer listens on this machine only.

    Raises
    ------
    InputError
        There is no such file, or it is no recording.
    UavgramError
        The viewer could not run, for example without a screen.
    """
    _check(recording)
    command = [sys.executable, "-m", "rerun", "--bind", LOOPBACK, str(recording)]
    status = subprocess.run(command, check=False).returncode  # noqa: S603  (our own interpreter)
    if status:
        raise UavgramError(
            f"the Rerun viewer ended with status {status}; it needs a screen and a graphics driver "
            f"(try in a browser: uavgram view {recording} --web)"
        )


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
        There is no such file, or it is no recording.
    UavgramError
        The server could not run.
    """
    _check(recording)
    page, data = _free_ports(2)
    command = [
        *(sys.executable, "-m", "rerun", "--serve-web", "--bind", LOOPBACK),
        *("--web-viewer-port", str(page), "--port", str(data), str(recording)),
    ]
    quiet = os.environ | {"RUST_LOG": "error"}
    # In a session of its own: what it starts ends with it, and Ctrl-C comes to us alone.
    with subprocess.Popen(command, env=quiet, start_new_session=True) as server:  # noqa: S603
        try:
            if not all(_is_up(server, port) for port in (page, data)):
                raise UavgramError(
                    "the Rerun viewer's server did not start: see what it said above, and check "
                    "that rerun-sdk is installed whole"
                )
            source = f"rerun%2Bhttp%3A%2F%2F{LOOPBACK}%3A{data}%2Fproxy"
            started(f"http://{LOOPBACK}:{page}?url={source}&theme=dark")
            status = server.wait()
        finally:
            with suppress(ProcessLookupError):  # it has ended
                os.killpg(server.pid, signal.SIGTERM)
    if status:
        raise UavgramError(f"the Rerun viewer's server ended with status {status}")


def _check(recording: Path) -> None:
    try:
        with recording.open("rb") as stream:
            head = stream.read(4)
    except OSError as fault:
        raise InputError(recording, f"cannot be read: {fault.strerror}") from fault
    if head not in MAGIC:
        raise InputError(recording, "is not a Rerun recording (.rrd)")


def _free_ports(count: int) -> list[int]:
    """Ports of this machine that nobody listens on, all different."""
    held = [socket.create_server((LOOPBACK, 0)) for _ in range(count)]
    ports = [one.getsockname()[1] for one in held]
    for one in held:
        one.close()
    return ports


def _is_up(server: subprocess.Popen[bytes], port: int) -> bool:
    """Wait until the port answers; False if the server ends, or does not answer in time."""
    end = time.monotonic() + START_S
    while server.poll() is None and time.monotonic() < end:
        try:
            with socket.create_connection((LOOPBACK, port), timeout=1.0):
                return True
        except OSError:
            time.sleep(_POLL_S)
    return False
