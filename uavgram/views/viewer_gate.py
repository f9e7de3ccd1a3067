"""The web viewer behind a gate: its page may talk to this machine, and to nobody else.

As delivered the page fetches a font, asks for a newer version and reports its use, all from servers
elsewhere. The gate hands on what the viewer's own server says, without the links that lead away and
with a content security policy by which the browser refuses every other request.
"""

from __future__ import annotations

import re
import threading
import urllib.error
import urllib.request
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

LOOPBACK = "127.0.0.1"
FETCH_S = 30.0

_LINKS_AWAY = re.compile(rb"<link\b[^>]*https?://[^>]*>")
_HANDED_ON = ("content-type", "content-encoding", "rerun-final-length")


class ViewerGate:
    """A server on a port of its own before the viewer's.

    Parameters
    ----------
    page_port, data_port
        Of the viewer's server: of its page, and of the recording's data.

    Attributes
    ----------
    port
        To open in a browser.
    """

    def __init__(self, page_port: int, data_port: int) -> None:
        self._server = ThreadingHTTPServer((LOOPBACK, 0), _handler(page_port, data_port))
        self._server.daemon_threads = True
        self.port = int(self._server.server_address[1])
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End it."""
        self._server.shutdown()
        self._thread.join()
        self._server.server_close()


def policy(data_port: int) -> str:
    """What the viewer's page may do: run what it is, and reach its own server and its data."""
    return (
        "default-src 'none'; script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval'; "
        "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
        f"connect-src 'self' http://{LOOPBACK}:{data_port}; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )


def _handler(page_port: int, data_port: int) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        """Hands on what the viewer's server says."""

        def do_GET(self) -> None:
            """Answer one request."""
            host = f"{LOOPBACK}:{self.connection.getsockname()[1]}"
            if self.headers.get("host") != host:  # a foreign name that resolves to this machine
                self.send_error(403)
                return
            source = f"http://{LOOPBACK}:{page_port}/{self.path.partition('?')[0].lstrip('/')}"
            try:
                with urllib.request.urlopen(source, timeout=FETCH_S) as answer:
                    headers, body = answer.headers, answer.read()
            except urllib.error.HTTPError as fault:
                fault.close()
                self.send_error(fault.code)
                return
            except OSError:
                self.send_error(502)
                return
            if headers.get_content_type() == "text/html":
                body = _LINKS_AWAY.sub(b"", body)
            self.send_response(200)
            for name in _HANDED_ON:
                if name in headers:
                    self.send_header(name, headers[name])
            self.send_header("content-length", str(len(body)))
            self.send_header("content-security-policy", policy(data_port))
            self.send_header("x-dns-prefetch-control", "off")
            self.send_header("referrer-policy", "no-referrer")
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_: object) -> None:
            """Say nothing."""

    return Handler
