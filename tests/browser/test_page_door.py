"""A real browser at the page's door: nothing leaves the machine, nothing foreign comes in."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import pytest
from opened_pages import PageOpener
from pick_pages import small_project
from picking_pages import place
from picking_server import Served, served
from playwright.sync_api import Browser, expect
from websockets import Origin
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from uavgram.picking.session.folder_chooser import FolderChooser
from uavgram.picking.web.running_server import RedirectFile

HTML = "<img src=x onerror=\"document.title='pwned'\">"


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Served]:
    with served(small_project(tmp_path)) as server:
        yield server


def test_labels_with_html_are_shown_as_text_everywhere(
    server: Served, open_page: PageOpener
) -> None:
    page = open_page(server)
    place(page, "A", 100, 100)
    page.locator("#label").fill(HTML)
    # `place` waits for the mark by its label, which this one would break out of.
    pane = page.locator(".pane svg.marks").first.bounding_box()
    assert pane is not None
    page.mouse.click(pane["x"] + pane["width"] / 2, pane["y"] + pane["height"] / 2)
    expect(page.locator(".mark")).to_have_count(2)
    expect(page.locator("body")).to_contain_text(HTML)
    assert [pick.label for pick in server.picking.state.picks] == ["A", HTML]
    assert page.locator("img[src=x]").count() == 0
    assert page.title() != "pwned"
    assert not open_page.errors
    assert not open_page.strangers


@pytest.fixture
def elsewhere() -> Iterator[socket.socket]:
    """Another address, where somebody would listen."""
    with socket.create_server(("127.0.0.2", 0)) as listener:
        listener.settimeout(0.0)
        yield listener


def test_no_request_leaves_the_machine_and_the_policy_would_stop_one(
    server: Served, open_page: PageOpener, elsewhere: socket.socket
) -> None:
    page = open_page(server)
    asked = []
    page.context.on("request", lambda request: asked.append(request.url))
    page.context.route("**/*", lambda route: route.continue_())
    page.reload()
    expect(page.locator(".pane").first).to_have_attribute("data-sharp", "true")
    place(page, "A", 200, 150)
    page.mouse.wheel(0, -600)
    page.keyboard.press("f")
    expect(page.locator(".pane").first).to_have_attribute("data-sharp", "true")
    home = f"http://127.0.0.1:{server.port}/"
    assert len(asked) > 10
    assert [url for url in asked if not url.startswith((home, "blob:", "data:"))] == []
    tried = page.evaluate(
        """async (away) => {
            const outcome = {};
            try { await fetch(away, {signal: AbortSignal.timeout(3000)}); outcome.fetch = "sent"; }
            catch { outcome.fetch = "stopped"; }
            const image = new Image();
            outcome.image = await new Promise((done) => {
                image.onload = () => done("loaded");
                image.onerror = () => done("stopped");
                setTimeout(() => done("sent"), 3000);
                image.src = away;
            });
            for (const [name, act] of [
                ["html", () => { document.createElement("p").innerHTML = "<b>x</b>"; }],
                ["handler", () => document.body.setAttribute("onclick", "1")],
            ]) {
                try { act(); outcome[name] = "done"; } catch { outcome[name] = "stopped"; }
            }
            outcome.cookie = document.cookie;
            return outcome;
        }""",
        f"http://127.0.0.2:{elsewhere.getsockname()[1]}/x.png",
    )
    assert tried.pop("cookie") == ""  # HttpOnly
    assert tried == dict.fromkeys(("fetch", "image", "html", "handler"), "stopped")
    with pytest.raises(BlockingIOError):  # nobody called there
        elsewhere.accept()


ATTACK = """<!doctype html><title>other</title><script>
const home = "HOME", out = {};
const image = new Promise((done) => {
  const one = new Image();
  one.onload = () => done("loaded"); one.onerror = () => done("stopped");
  one.src = `http://${home}/photo/0/thumbnail.jpg`;
});
const socket = new Promise((done) => {
  const one = new WebSocket(`ws://${home}/socket`);
  one.onmessage = () => done("talks"); one.onclose = () => done("stopped");
});
const read = fetch(`http://${home}/`, {credentials: "include"})
  .then(() => "read").catch(() => "stopped");
const script = new Promise((done) => {
  const one = document.createElement("script");
  one.onload = () => done("loaded"); one.onerror = () => done("stopped");
  one.src = `http://${home}/page/app.js`; document.head.append(one);
});
Promise.all([image, socket, read, script]).then((all) => {
  document.title = all.join(" ");
});
</script>"""


def test_another_page_of_this_browser_gets_neither_photos_nor_socket(
    server: Served, open_page: PageOpener
) -> None:
    """It has the same host, so the browser sends our cookie along: the door tells them apart."""
    page = open_page(server)

    class Other(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            content = ATTACK.replace("HOME", f"127.0.0.1:{server.port}").encode()
            self.send_response(200)
            self.send_header("content-type", "text/html")
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, *_: object) -> None:
            pass

    other = ThreadingHTTPServer(("127.0.0.1", 0), Other)
    thread = threading.Thread(target=other.serve_forever, daemon=True)
    thread.start()
    try:
        stranger = page.context.new_page()
        stranger.goto(f"http://127.0.0.1:{other.server_port}/")
        expect(stranger).to_have_title("stopped stopped stopped stopped")
    finally:
        other.shutdown()
        other.server_close()
        thread.join()
    place(page, "A", 100, 100)  # the page itself lives on
    assert [pick.label for pick in server.picking.state.picks] == ["A"]


def test_the_cookie_that_another_server_of_this_machine_is_sent_opens_nothing(
    server: Served, open_page: PageOpener
) -> None:
    page = open_page(server)
    sent: list[str] = []

    class Other(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            sent.append(self.headers.get("cookie", ""))
            self.send_response(200)
            self.send_header("content-type", "text/html")
            self.end_headers()

        def log_message(self, *_: object) -> None:
            pass

    other = ThreadingHTTPServer(("127.0.0.1", 0), Other)
    thread = threading.Thread(target=other.serve_forever, daemon=True)
    thread.start()
    try:
        page.context.new_page().goto(f"http://127.0.0.1:{other.server_port}/")
    finally:
        other.shutdown()
        other.server_close()
        thread.join()
    assert sent[0].startswith(f"uavgram-pick-{server.port}=")  # browsers do send it there
    stolen = {"Cookie": sent[0]}
    for path in ("/photo/0/thumbnail.jpg", "/photo/0/0/0/0.jpg", "/output/report.html"):
        assert httpx.get(server.origin + path, headers=stolen).status_code == 403
    with pytest.raises(InvalidStatus):
        connect(
            f"ws://127.0.0.1:{server.port}/socket",
            origin=Origin(server.origin),
            additional_headers=stolen,
            proxy=None,
        )


def test_a_tab_keeps_its_key_another_one_needs_a_fresh_address(
    server: Served, open_page: PageOpener
) -> None:
    page = open_page(server)
    page.reload()
    page.wait_for_selector('.pane[data-sharp="true"]')
    page.wait_for_function("document.querySelector('#strip img').naturalWidth > 0")
    assert page.url == f"{server.origin}/"

    other = page.context.new_page()
    other.goto(f"{server.origin}/")
    expect(other.locator("h1")).to_have_text("This page needs a fresh address")
    other.goto(server.guard.address())
    other.wait_for_selector('.pane[data-sharp="true"]')
    assert not open_page.errors


def test_a_file_that_only_its_user_can_read_leads_to_the_page(
    server: Served, chromium: Browser
) -> None:
    way = RedirectFile(server.guard.address())
    path = Path(urlsplit(way.uri).path)
    modes = [one.stat().st_mode & 0o777 for one in (path, path.parent)]
    assert modes == [0o600, 0o700]
    assert "token" not in way.uri
    context = chromium.new_context()
    try:
        page = context.new_page()
        page.goto(way.uri)
        page.wait_for_selector('.pane[data-sharp="true"]', timeout=60_000)
        assert page.url == f"http://127.0.0.1:{server.port}/"
    finally:
        context.close()
    way.remove()
    assert not path.parent.exists()


def test_a_project_that_cannot_be_read_opens_the_page_with_the_reason_and_a_way_out(
    tmp_path: Path, open_page: PageOpener
) -> None:
    project = small_project(tmp_path / "case")
    right = project.read_text(encoding="utf-8")
    project.write_text(right + "camra: other.yaml\n", encoding="utf-8")
    with served(project, FolderChooser(roots=(tmp_path,))) as server:
        page = open_page(server)
        trouble = page.locator("#trouble")
        expect(trouble).to_contain_text("This project cannot be opened.")
        expect(trouble).to_contain_text(f"project.yaml:{len(right.splitlines()) + 1}: camra")
        project.write_text(right, encoding="utf-8")
        page.get_by_role("button", name="Read it again").click()
        expect(page.locator("#strip button")).to_have_count(2)
        assert {one for one in open_page.errors if "409" not in one} == set()
