"""Who comes in at the page's door, what they may say, and that the page lives on."""

from __future__ import annotations

import json
import re
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import pytest
from pick_pages import (
    LONGEST_WAIT_S,
    Entry,
    Page,
    Server,
    ask,
    browser_of,
    entry_by,
    entry_of,
    small_project,
)
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Origin

from uavgram.model.limits import LONGEST_NAME
from uavgram.picking.document.history import MAX_ITEMS
from uavgram.picking.document.history import apply_change as state_after
from uavgram.picking.protocol.parse import MAX_MESSAGE_BYTES
from uavgram.picking.web.guard import RateLimit


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    project = small_project(tmp_path_factory.mktemp("door"))
    (project.parent / "out").mkdir()
    (project.parent / "out" / "report.html").write_text("<p>a report</p>", encoding="utf-8")
    server = Server(project)
    yield server
    server.stop()


@pytest.fixture(scope="module")
def entry(server: Server) -> Entry:
    return entry_of(server)


@pytest.fixture
def page(server: Server, entry: Entry) -> Iterator[Page]:
    with Page(server, entry) as page:
        yield page
        assert server.is_alive
        # Whatever was tried: a page can still pick, and undo it.
        picked = page.do("place", image=0, label="still alive", u_px=1, v_px=2)
        assert picked["t"] == "changed"
        assert page.do("undo")["t"] == "changed"


@pytest.fixture
def browser(server: Server, entry: Entry) -> Iterator[httpx.Client]:
    with browser_of(server, entry) as client:
        yield client


def logged(server: Server) -> str:
    return server.log.read_text(encoding="utf-8")


def test_other_addresses_of_this_machine_do_not_answer(server: Server) -> None:
    port = urlsplit(server.origin).port
    others = {
        info[4][0]
        for info in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)
        if info[4][0] != "127.0.0.1"
    } | {"127.0.0.2"}
    for address in others:
        with socket.socket() as caller:
            caller.settimeout(2)
            assert caller.connect_ex((address, port)) != 0


@pytest.mark.usefixtures("entry")
def test_the_token_serves_once(server: Server) -> None:
    used = ask(server.address, follow_redirects=False)
    assert used.status_code == 403
    assert "set-cookie" not in used.headers


def test_the_token_becomes_a_cookie_that_scripts_and_other_sites_cannot_use(tmp_path: Path) -> None:
    server = Server(small_project(tmp_path))
    try:
        answer = ask(server.address, follow_redirects=False)
        assert answer.status_code == 303
        # the token is gone from the address; the key stands where no browser sends it
        assert re.fullmatch(r"/#[-\w]{43}", answer.headers["location"])
        assert entry_by(answer).key not in answer.headers["set-cookie"]
        attributes = [part.strip().lower() for part in answer.headers["set-cookie"].split(";")]
        assert {"httponly", "samesite=strict", "path=/"} <= set(attributes)
        guessed = server.address.split("=")[0] + "=guess"
        assert ask(guessed, follow_redirects=False).status_code == 403
    finally:
        server.stop()


@pytest.mark.parametrize(
    "path",
    [
        "/",
        "/page/app.js",
        "/page/photos/pane.js",
        "/photo/0/0/0/0.jpg",
        "/photo/0/thumbnail.jpg",
        "/output/report.html",
    ],
)
def test_nothing_is_given_without_the_cookie_and_all_of_it_with_it(
    server: Server, browser: httpx.Client, path: str
) -> None:
    for headers in ({}, {"Cookie": f"{browser.headers['Cookie'].split('=')[0]}=wrong"}):
        assert ask(server.origin + path, headers=headers).status_code == 403
    assert browser.get(path).status_code == 200


def test_a_page_at_an_old_address_makes_the_browser_ask_for_no_icon(server: Server) -> None:
    assert '<link rel="icon" href="data:,">' in ask(server.origin + "/").text


def test_every_answer_carries_strict_headers(server: Server, browser: httpx.Client) -> None:
    refused = ask(server.origin + "/")
    for answer in (
        browser.get("/"),
        browser.get("/photo/0/0/0/0.jpg"),
        browser.get("/no"),
        refused,
    ):
        policy = answer.headers["content-security-policy"]
        assert "default-src 'self'" in policy
        assert "unsafe" not in policy
        assert "frame-ancestors 'none'" in policy
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["referrer-policy"] == "no-referrer"
        assert answer.headers["cross-origin-resource-policy"] == "same-origin"
        assert "access-control-allow-origin" not in answer.headers
        assert "server" not in answer.headers


@pytest.mark.parametrize(
    "host", ["evil.example", "127.0.0.1", "localhost:1", "127.0.0.1.evil.example", ""]
)
def test_a_foreign_host_is_refused_and_logged(
    server: Server, browser: httpx.Client, host: str
) -> None:
    answer = browser.get("/", headers={"Host": host})
    assert answer.status_code in {400, 403}
    if answer.status_code == 403:
        assert f"foreign host {host!r}" in logged(server)


PROJECT = [
    "/photo/0/0/0/0.jpg",
    "/photo/0/thumbnail.jpg",
    "/photo/0/tones.json",
    "/output/report.html",
    "/recording",
    "/calibration",
    "/page/../photo/0/thumbnail.jpg",
]


@pytest.mark.parametrize("path", PROJECT)
def test_the_cookie_alone_gives_nothing_of_the_project_nor_does_the_key(
    server: Server, entry: Entry, path: str
) -> None:
    """The browser sends it to every server of this machine that it visits: ports are the same."""
    cookie = {"Cookie": entry.cookie}
    for address in (path, f"{path}?tab=", f"{path}?tab=guess", f"{path}?tab={entry.cookie}"):
        assert ask(server.origin + address, headers=cookie).status_code == 403
    assert ask(entry.to(server.origin + path)).status_code == 403


def test_the_cookie_alone_gets_no_socket_and_no_key(server: Server, entry: Entry) -> None:
    cookie = {"Cookie": entry.cookie}
    assert refused_socket(server, server.origin, cookie) == 403
    used = ask(server.address, headers=cookie, follow_redirects=False)
    assert (used.status_code, used.headers["location"]) == (303, "/")
    guessed = ask(f"{server.origin}/?token=guess", headers=cookie, follow_redirects=False)
    assert (guessed.status_code, guessed.headers["location"]) == (303, "/")
    assert entry.key not in ask(server.origin + "/", headers=cookie).text


def refused_socket(
    server: Server, origin: str | None, headers: dict[str, str], way: str = "/socket"
) -> int:
    """Status of a socket that is asked for and not given."""
    netloc = urlsplit(server.origin).netloc
    stated = None if origin is None else Origin(origin)
    with pytest.raises(InvalidStatus) as refused:
        connect(f"ws://{netloc}{way}", origin=stated, additional_headers=headers, proxy=None)
    return refused.value.response.status_code


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:1", None])
def test_a_foreign_origin_gets_no_socket_though_it_has_the_cookie(
    server: Server, entry: Entry, origin: str | None
) -> None:
    assert refused_socket(server, origin, {"Cookie": entry.cookie}, entry.to("/socket")) == 403
    assert f"foreign origin {str(origin)!r}" in logged(server)


def test_our_own_origin_gets_no_socket_without_the_cookie(server: Server) -> None:
    assert refused_socket(server, server.origin, {}) == 403


def test_a_foreign_origin_gets_no_page_and_other_sites_cannot_embed_our_photos(
    browser: httpx.Client,
) -> None:
    assert browser.get("/", headers={"Origin": "http://evil.example"}).status_code == 403
    for site in ("cross-site", "same-site"):  # another port of this machine is the same site
        headers = {"Sec-Fetch-Site": site, "Sec-Fetch-Mode": "no-cors"}
        assert browser.get("/photo/0/thumbnail.jpg", headers=headers).status_code == 403
    ours = {"Sec-Fetch-Site": "same-origin", "Sec-Fetch-Mode": "no-cors"}
    assert browser.get("/photo/0/thumbnail.jpg", headers=ours).status_code == 200
    link = {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate"}
    assert browser.get("/", headers=link).status_code == 200


PATHS = [
    "/page/../server.py",
    "/page/..%2fserver.py",
    "/page/%2e%2e/%2e%2e/server.py",
    "/page/..%5cserver.py",
    "/page//etc/passwd",
    "/page/__init__.py",
    "/page/photos",
    "/page/photos/../../server.py",
    "/page/photos/%2e%2e/%2e%2e/server.py",
    "/page/photos//etc/passwd",
    "/page/app.js%00.css",
    "/photo/../../project.yaml",
    "/photo/P1.jpg",
    "/photo/-1/0/0/0.jpg",
    "/photo/2/0/0/0.jpg",
    "/photo/0/99/0/0.jpg",
    "/photo/0/0/99/0.jpg",
    "/photo/0/0/0/-1.jpg",
    "/photo/0/0/0/0.png",
    "/photo/99999999999999999999999999/thumbnail.jpg",
    "/photo/0/" + "9" * 900 + "/0/0.jpg",
    "/photo/" + "9" * 5000 + "/thumbnail.jpg",
    "/output/../project.yaml",
    "/output/..%2fproject.yaml",
    "/output/pick-journal.jsonl",
    "/output/pick.lock",
    "/output/pick.door",
    "/output/",
    "/recording",
    "/calibration",
    "/project.yaml",
    "/%ff%fe",
    "/socket",
]


@pytest.mark.parametrize("path", PATHS, ids=range(len(PATHS)))
def test_photos_go_by_number_and_no_path_leads_out(server: Server, entry: Entry, path: str) -> None:
    """Sent as they are: a client library would tidy them up."""
    parts = urlsplit(server.origin)
    with socket.create_connection((parts.hostname, parts.port), timeout=LONGEST_WAIT_S) as line:
        request = (
            f"GET {entry.to(path)} HTTP/1.1\r\nHost: {parts.netloc}\r\nCookie: {entry.cookie}\r\n"
        )
        line.sendall(f"{request}Connection: close\r\n\r\n".encode())
        answer = b""
        while more := line.recv(65536):
            answer += more
    status = int(answer.split(b" ", 2)[1])
    assert status in {400, 403, 404}, answer[:300]
    assert b"root:" not in answer
    assert b"import" not in answer
    assert b"images:" not in answer
    assert "Traceback" not in logged(server)


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "TRACE"])
def test_the_page_is_only_read(browser: httpx.Client, method: str) -> None:
    assert browser.request(method, "/").status_code == 405


NUMBERS = ["NaN", "Infinity", "-Infinity", "1e999", "-1e308", "1e17", "9" * 400, "1" + "0" * 5000]


@pytest.mark.parametrize("number", NUMBERS, ids=range(len(NUMBERS)))
def test_numbers_that_are_none_or_huge_are_refused(page: Page, number: str) -> None:
    for field in ("u_px", "v_px", "sigma_px"):
        fields = {"u_px": "5", "v_px": "5", "sigma_px": "1", field: number}
        text = ",".join(f'"{name}":{value}' for name, value in fields.items())
        page.socket.send(f'{{"seq":77,"t":"place","image":0,"label":"X",{text}}}')
        assert page.until("refused")["why"]
    page.socket.send(f'{{"seq":{number},"t":"undo"}}')
    assert page.until("refused")["why"]
    page.socket.send(f'{{"seq":78,"t":"unpick","image":{number},"label":"X"}}')
    assert page.until("refused")["why"]
    assert page.picks == {}


MESSAGES = [
    "",
    "null",
    "[]",
    "{}",
    '{"t":"place"}',
    '{"seq":1,"t":"__class__"}',
    '{"seq":1,"t":"place","image":"../../etc/passwd","label":"A","u_px":1,"v_px":1}',
    '{"seq":1,"t":"place","image":-1,"label":"A","u_px":1,"v_px":1}',
    '{"seq":1,"t":"place","image":true,"label":"A","u_px":1,"v_px":1}',
    '{"seq":1,"t":"place","image":0,"label":"A","u_px":1,"v_px":1,"more":1}',
    '{"seq":1,"t":"place","image":0,"label":"A;B","u_px":1,"v_px":1}',
    '{"seq":1,"t":"place","image":0,"label":"a\\u0000b","u_px":1,"v_px":1}',
    '{"seq":1,"t":"place","image":0,"label":"a\\u001b[31mb","u_px":1,"v_px":1}',
    '{"seq":1,"t":"place","image":0,"label":"\\ud800","u_px":1,"v_px":1}',
    '{"seq":1,"t":"place","image":0,"label":["A"],"u_px":1,"v_px":1}',
    '{"seq":1,"t":"undo"}{"seq":2,"t":"undo"}',
    "[" * 100_000,
    '{"a":' * 50_000,
]


@pytest.mark.parametrize("text", MESSAGES, ids=range(len(MESSAGES)))
def test_messages_that_are_none_are_refused(page: Page, text: str) -> None:
    page.socket.send(text)
    assert page.until("refused")["why"]
    assert page.picks == {}


def test_labels_are_kept_as_text_whatever_they_look_like(page: Page, server: Server) -> None:
    names = ['<img src=x onerror="alert(1)">', "</script><b>&amp", '=cmd|"/c calc"!A0', "%s%n{0}"]
    for name in names:
        assert page.do("place", image=0, label=name, u_px=3, v_px=4)["t"] == "changed"
    assert sorted(label for _, label in page.picks) == sorted(names)
    for name in ("x" * (LONGEST_NAME + 1), "a;b", ""):  # refused by its own number: nobody waits
        assert page.do("place", image=0, label=name, u_px=3, v_px=4)["t"] == "refused"
    page.until("saved", fault="")
    from uavgram.io.tables.picks import read_picks

    assert sorted(read_picks(server.log.parent / "picks.csv").label) == sorted(names)
    for _ in names:
        page.do("undo")


def read_to_the_end(page: Page) -> ConnectionClosed:
    """Why a page's socket was closed."""
    try:
        while True:
            page.read()
    except ConnectionClosed as gone:
        return gone


@pytest.mark.usefixtures("page")
def test_a_message_that_is_too_long_ends_its_own_page_only(server: Server, entry: Entry) -> None:
    with Page(server, entry) as loud:
        loud.socket.send("x" * (MAX_MESSAGE_BYTES + 1))
        told = read_to_the_end(loud).rcvd
        assert told is not None
        assert told.code == 1009
    with Page(server, entry) as loud:
        loud.socket.send(b"\x00\x01")
        read_to_the_end(loud)
    deadline = time.monotonic() + LONGEST_WAIT_S
    while "too long" not in logged(server) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert "too long" in logged(server)


def test_a_flood_is_slowed_down_while_another_page_goes_on(
    page: Page, server: Server, entry: Entry
) -> None:
    """Far more than people can make; a million takes the same road, only longer."""
    with Page(server, entry) as loud:
        flood = json.dumps({"seq": 1, "t": "place", "image": 9, "label": "A", "u_px": 1, "v_px": 1})
        refused, began = 0, time.monotonic()
        for _ in range(1200):
            loud.socket.send(flood)
        for k in range(10):  # meanwhile
            assert page.do("place", image=0, label="A", u_px=1 + k, v_px=2)["t"] == "changed"
        for _ in range(10):
            page.do("undo")
        while refused < 1200:
            refused += loud.read()["t"] == "refused"
        assert time.monotonic() - began > 0.9 * (1200 - 600) / 300
    assert "slowed down" in logged(server)


def test_the_pace_lets_people_through_and_slows_down_machines() -> None:
    now = 0.0
    pace = RateLimit(per_second=10, at_once=5, clock=lambda: now)
    assert [pace.wait_s() for _ in range(5)] == [0.0] * 5
    assert pace.wait_s() == pytest.approx(0.1)
    total = 0.0
    for _ in range(100_000):
        wait = pace.wait_s()
        now += wait
        total += wait
    assert total == pytest.approx(100_000 / 10, rel=1e-3)
    now += 1000.0
    assert [pace.wait_s() for _ in range(6)] == [0.0] * 5 + [pytest.approx(0.1)]


@pytest.mark.usefixtures("page")
def test_more_pages_than_people_open_are_refused(server: Server, entry: Entry) -> None:
    with ExitStack() as pages:
        for _ in range(15):  # and the one that is open
            pages.enter_context(Page(server, entry))
        assert (
            refused_socket(server, server.origin, {"Cookie": entry.cookie}, entry.to("/socket"))
            == 403
        )
    assert "16 are open" in logged(server)


def test_a_project_has_a_greatest_size() -> None:
    from uavgram.picking.document import commands as c
    from uavgram.picking.document.commands import RefusedError
    from uavgram.picking.document.state import Pick, State

    picks = tuple(Pick(image="a", label=str(k), u_px=1, v_px=1) for k in range(MAX_ITEMS))
    with pytest.raises(RefusedError, match="20000 picks"):
        state_after(State(picks=picks), c.Place(image="a", label="new", u_px=1, v_px=1))
