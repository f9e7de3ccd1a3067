"""The viewer's page behind its gate, in a real browser: it reaches its recording, nobody else."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect

from uavgram.views.viewer import LOOPBACK, ViewerProxy

PAGE = """<!doctype html><html><head><title>viewer</title>
<link rel="preconnect" href="http://ELSEWHERE/">
<link rel="stylesheet" href="http://ELSEWHERE/font.css">
</head><body><script>
const outcome = async (name, ask) =>
  `${name} ${await ask().then((answer) => answer.status, () => "stopped")}`;
Promise.all([
  outcome("recording", () => fetch(new URLSearchParams(location.search).get("url"))
    .then(async (answer) => ({status: `${answer.status} ${await answer.text()}`}))),
  outcome("elsewhere", () => fetch("http://ELSEWHERE/report", {mode: "no-cors"})),
  outcome("beacon", async () => ({status: navigator.sendBeacon("http://ELSEWHERE/b", "x")})),
]).then((all) => { document.title = all.join(", "); });
</script></body></html>"""


class Talkative(ThreadingHTTPServer):
    """A server that gives one page and notes who calls."""

    daemon_threads = True

    def __init__(self, page: str = "") -> None:
        self.page = page.encode()
        self.called: list[str] = []
        super().__init__((LOOPBACK, 0), Answer)
        threading.Thread(target=self.serve_forever, daemon=True).start()


class Answer(BaseHTTPRequestHandler):
    server: Talkative

    def do_GET(self) -> None:
        self.server.called.append(self.path)
        self.send_response(200)
        self.send_header("content-type", "text/html")
        self.end_headers()
        self.wfile.write(self.server.page)

    do_POST = do_GET  # noqa: N815  (its name is the method's)

    def log_message(self, *_: object) -> None:
        pass


Gate = tuple[ViewerProxy, Talkative]


@pytest.fixture
def behind_gate(tmp_path: Path) -> Iterator[Gate]:
    """The address of a page behind the gate, and the server that it would call."""
    recording = tmp_path / "recording.rrd"
    recording.write_bytes(b"RRF2 and more")
    elsewhere = Talkative()
    viewer = Talkative(PAGE.replace("ELSEWHERE", f"{LOOPBACK}:{elsewhere.server_port}"))
    gate = ViewerProxy(viewer.server_port, recording)
    yield gate, elsewhere
    gate.close()
    for server in (elsewhere, viewer):
        server.shutdown()
        server.server_close()


def test_a_page_behind_the_gate_reaches_its_recording_and_nobody_else(
    chromium: Browser, behind_gate: Gate
) -> None:
    gate, elsewhere = behind_gate
    page = chromium.new_page()
    try:
        page.goto(f"http://{LOOPBACK}:{gate.server_port}/?url={gate.way}")
        expect(page).to_have_title("recording 200 RRF2 and more, elsewhere stopped, beacon true")
        page.wait_for_timeout(200)  # a beacon is sent behind the page's back
        assert elsewhere.called == []
        # Without the gate it would have called.
        page.goto(f"http://{LOOPBACK}:{elsewhere.server_port}/")
        assert elsewhere.called[0] == "/"
    finally:
        page.close()


def test_another_page_of_the_browser_does_not_get_the_recording(
    chromium: Browser, behind_gate: Gate
) -> None:
    gate, elsewhere = behind_gate
    page = chromium.new_page()
    try:
        page.goto(f"http://{LOOPBACK}:{elsewhere.server_port}/")
        source = f"http://{LOOPBACK}:{gate.server_port}{gate.way}"  # even if it knew it
        asked = page.evaluate(
            """address => fetch(address, {mode: 'no-cors'}).then(() => "read", () => "stopped")""",
            source,
        )
        assert asked == "stopped"  # the same site, another origin: the refusal itself is not read
    finally:
        page.close()
