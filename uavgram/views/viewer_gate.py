"""The web viewer behind a gate: its page may talk to the gate alone, and nobody else to the gate.

As delivered the viewer's page fetches a font, asks for a newer version and reports its use, all
from servers elsewhere. The gate hands on what the viewer's own server says, without the links that
lead away and with a content security policy by which the browser refuses every other request. And
it hands out the recording itself, to that page only: the viewer's own port would give it to any
page of the browser that guesses the port.
"""

from __future__ import annotations

import os
import re
import shutil
import threading
import urllib.error
import urllib.request
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

LOOPBACK = "127.0.0.1"
RECORDING = "/recording.rrd"
FETCH_S = 30.0
POLICY = (
    "default-src 'none'; script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval'; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""What the viewer's page may do: run what it is, and fetch from its own server."""

_LINKS_AWAY = re.compile(rb"<link\b[^>]*https?://[^>]*>")
_HANDED_ON = ("content-type", "content-encoding", "rerun-final-length")
_OWN_SITE = {"same-origin", "none"}  # https://www.w3.org/TR/fetch-metadata/; none: typed in


class ViewerGate(ThreadingHTTPServer):
    """A server on a port of its own before the viewer's.

    Parameters
    ----------
    page_port
        Of the viewer's own server.
    recording
        The file to show.
    """

    daemon_threads = True

    def __init__(self, page_port: int, recording: Path) -> None:
        super().__init__((LOOPBACK, 0), _Handler)
        self.page_port, self.recording = page_port, recording
        self._thread = threading.Thread(target=self.serve_forever, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End it."""
        self.shutdown()
        self._thread.join()
        self.server_close()


class _Handler(BaseHTTPRequestHandler):
    """Hands on what the viewer's server says, and the recording."""

    server: ViewerGate

    def do_GET(self) -> None:
        """Answer one request."""
        path = self.path.partition("?")[0]
        host = f"{LOOPBACK}:{self.server.server_port}"
        if self.headers.get("host") != host:  # a foreign name that resolves to this machine
            self.send_error(HTTPStatus.FORBIDDEN)
        elif path != RECORDING:
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
            self._begin({"content-type": "application/octet-stream", "content-length": size})
            shutil.copyfileobj(stream, self.wfile)

    def _hand_on(self, path: str) -> None:
        source = f"http://{LOOPBACK}:{self.server.page_port}/{path.lstrip('/')}"
        try:
            with urllib.request.urlopen(source, timeout=FETCH_S) as answer:
                given, body = answer.headers, answer.read()
        except urllib.error.HTTPError as fault:
            fault.close()
            self.send_error(fault.code)
            return
        except OSError:
            self.send_error(HTTPStatus.BAD_GATEWAY)
            return
        if given.get_content_type() == "text/html":
            body = _LINKS_AWAY.sub(b"", body)
        headers = {name: given[name] for name in _HANDED_ON if name in given}
        self._begin({**headers, "content-length": len(body)})
        self.wfile.write(body)

    def _begin(self, headers: dict[str, str | int]) -> None:
        self.send_response(HTTPStatus.OK)
        for name, value in headers.items():
            self.send_header(name, str(value))
        self.send_header("content-security-policy", POLICY)
        self.send_header("cross-origin-resource-policy", "same-origin")
        self.send_header("x-dns-prefetch-control", "off")
        self.send_header("referrer-policy", "no-referrer")
        self.end_headers()

    def log_message(self, *_: object) -> None:
        """Say nothing."""
