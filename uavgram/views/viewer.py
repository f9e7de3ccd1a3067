"""Rerun viewer on a screen, or in a browser of this machine through a gate before its own server.

As delivered, the viewer's page fetches a font, asks for a newer version and reports its use, all
from servers elsewhere. The gate forwards the responses of the viewer's own server, without links
to other servers and with a content security policy by which the browser refuses every other
request. It also serves the recording itself, to that page only: the viewer's own port would give
it to any page of the browser, and to any user of the machine, that guesses the port.
"""

from __future__ import annotations

import hmac
import io
import os
import re
import secrets
import shutil
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, BinaryIO
from urllib.parse import quote

from uavgram.errors import InputError, UavgramError
from uavgram.input_files import opened
from uavgram.views import viewer_process

LOOPBACK = "127.0.0.1"
RECORDING = "recording.rrd"
FETCH_S = 30.0
HEADERS_S = 10.0
"""Time limit for headers; a browser of this machine sends them within milliseconds."""
WRITE_S = 15.0
"""Time limit for a reader to take the next `PIECE_BYTES`; slower ones are disconnected."""
PIECE_BYTES = 1 << 18
MAX_AT_ONCE = 64
POLICY = (
    "default-src 'none'; script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval'; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Permissions of the viewer's page: to run its own code, and to fetch from its own server."""

HEADERS = {
    "content-security-policy": POLICY,
    "x-content-type-options": "nosniff",
    "cross-origin-resource-policy": "same-origin",
    "x-dns-prefetch-control": "off",
    "referrer-policy": "no-referrer",
}
_LINKS_AWAY = re.compile(rb"<link\b[^>]*https?://[^>]*>")
_HANDED_ON = ("content-type", "content-encoding", "rerun-final-length")
_OWN_SITE = {"same-origin", "none"}  # https://www.w3.org/TR/fetch-metadata/; none: typed in


class ViewerProxy(ThreadingHTTPServer):
    """Server on a port of its own before the viewer's.

    Parameters
    ----------
    page_port
        Port of the viewer's own server.
    recording
        The file to show.
    """

    daemon_threads = True
    request_queue_size = 2 * MAX_AT_ONCE

    def __init__(self, page_port: int, recording: Path) -> None:
        super().__init__((LOOPBACK, 0), _Handler)
        self.page_port, self.recording = page_port, recording
        # Other users of this machine can call the port, so the path of the recording is a secret.
        self.way = f"/{secrets.token_urlsafe(32)}/{RECORDING}"
        self._page: dict[str, tuple[dict[str, str], bytes]] = {}
        self._asking = threading.Lock()
        self._free = threading.Semaphore(MAX_AT_ONCE)
        self._thread = threading.Thread(target=self.serve_forever, daemon=True)
        self._thread.start()

    def process_request(self, request: Any, client_address: Any) -> None:  # noqa: ANN401
        """Answer in a thread of its own; a request beyond the limit is closed at once."""
        if self._free.acquire(blocking=False):
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:  # noqa: ANN401
        """Answer, and make room for the next."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:  # noqa: ANN401
        """Report an error, except for a reader that has disconnected."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)

    def page_file(self, name: str) -> tuple[dict[str, str], bytes]:
        """Return headers and content of a file of the viewer's page, cached for all readers.

        Raises
        ------
        OSError
            If the viewer's server has no such file, or does not answer.
        """
        with self._asking:
            if name not in self._page:
                source = f"http://{LOOPBACK}:{self.page_port}/{name}"
                with urllib.request.urlopen(source, timeout=FETCH_S) as answer:
                    given, body = answer.headers, answer.read()
                if given.get_content_type() == "text/html":
                    body = _LINKS_AWAY.sub(b"", body)
                headers = {key: given[key] for key in _HANDED_ON if key in given}
                self._page[name] = headers, body
            return self._page[name]

    def close(self) -> None:
        """Stop the server."""
        self.shutdown()
        self._thread.join()
        self.server_close()


class _Handler(BaseHTTPRequestHandler):
    """Handler that forwards the viewer's files, and serves the recording."""

    server: ViewerProxy

    def setup(self) -> None:
        """Set the time limit for reads and writes."""
        super().setup()
        self.connection.settimeout(WRITE_S)

    def handle_one_request(self) -> None:
        """Answer a request that is complete in time."""
        self._overdue = threading.Timer(HEADERS_S, self._hang_up)
        self._overdue.daemon = True
        self._overdue.start()
        try:
            super().handle_one_request()
        finally:
            self._overdue.cancel()

    def parse_request(self) -> bool:
        """Read the headers; afterwards the time limit is off."""
        whole = super().parse_request()
        self._overdue.cancel()
        return whole

    def _hang_up(self) -> None:
        with suppress(OSError):  # it is gone already
            self.connection.shutdown(socket.SHUT_RDWR)

    def do_GET(self) -> None:
        """Answer one request."""
        path = self.path.partition("?")[0]
        host = f"{LOOPBACK}:{self.server.server_port}"
        if self.headers.get("host") != host:  # a foreign name that resolves to this machine
            self.send_error(HTTPStatus.FORBIDDEN)
        elif not hmac.compare_digest(path.encode(), self.server.way.encode()):
            self._hand_on(path)
        elif self.headers.get("sec-fetch-site", "none") not in _OWN_SITE:
            self.send_error(HTTPStatus.FORBIDDEN)
        else:
            self._recording()

    def _recording(self) -> None:
        try:
            stream = self.server.recording.open("rb")
        except OSError:
            self.send_error(HTTPStatus.NOT_FOUND)
            return
        with stream:
            size = os.fstat(stream.fileno()).st_size
            self._answer(stream, {"content-type": "application/octet-stream"}, size)

    def _hand_on(self, path: str) -> None:
        try:
            headers, body = self.server.page_file(path.lstrip("/"))
        except urllib.error.HTTPError as fault:
            fault.close()
            self.send_error(fault.code)
        except OSError:
            self.send_error(HTTPStatus.BAD_GATEWAY)
        else:
            self._answer(io.BytesIO(body), headers, len(body))

    def _answer(self, content: BinaryIO, headers: dict[str, str], size: int) -> None:
        """Send a piece at a time: each must be taken within `WRITE_S`."""
        self.send_response(HTTPStatus.OK)
        for name, value in {**headers, "content-length": str(size)}.items():
            self.send_header(name, value)
        with suppress(ConnectionError):  # the reader has left
            self.end_headers()
            shutil.copyfileobj(content, self.wfile, PIECE_BYTES)

    def end_headers(self) -> None:
        """End the headers of any answer, refusals too, with the security headers."""
        for name, value in HEADERS.items():
            self.send_header(name, value)
        super().end_headers()

    def log_message(self, *_: object) -> None:
        """Suppress messages."""


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
