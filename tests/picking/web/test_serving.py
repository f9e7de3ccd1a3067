"""How the page is served: its socket answers without delay, its memory goes back."""

from __future__ import annotations

import asyncio
import contextlib
import platform
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from own_loop import run_alone
from pick_pages import LONGEST_WAIT_S, Page, ask, entry_by, entry_of, small_project
from picking_server import Served, served
from websockets import Origin
from websockets.sync.client import connect

from uavgram.errors import UavgramError
from uavgram.io.outputs import LOCK, is_locked
from uavgram.picking.session.project import OpenProject
from uavgram.picking.web import serving
from uavgram.picking.web import serving as request_timeout
from uavgram.picking.web.guard import Tabs
from uavgram.picking.web.serving import open_socket


def test_who_comes_before_the_server_is_up_waits_at_the_door() -> None:
    with (
        contextlib.closing(open_socket(0)) as door,
        socket.create_connection(door.getsockname(), timeout=60) as early,
    ):
        came, address = door.accept()
        came.close()
        assert address == early.getsockname()


def test_small_messages_are_sent_at_once() -> None:
    async def nodelay() -> int:
        accepted: asyncio.Future[int] = asyncio.get_running_loop().create_future()

        def come(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            its: socket.socket = writer.get_extra_info("socket")
            accepted.set_result(its.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY))
            writer.close()

        door = open_socket(0)
        async with await asyncio.start_server(come, sock=door):
            _, writer = await asyncio.open_connection(*door.getsockname())
            found = await accepted
            writer.close()
            await writer.wait_closed()
            return found

    assert run_alone(nodelay())


KEPT_MB = """
import re, sys
from pathlib import Path
import numpy as np
from uavgram.pipeline.process_settings import return_large_blocks

def now():
    text = Path("/proc/self/status").read_text()  # as reserved: the system may move idle pages
    return int(re.search(r"VmData:\\s+(\\d+)", text).group(1)) / 1024

if sys.argv[1] == "give back":
    assert return_large_blocks()
before = now()
np.ones(20_000_000, np.uint8)
blocks, small = [], []
for _ in range(20):
    blocks.append(np.ones(3_000_000, np.uint8))
    small.append(np.ones(3_000, np.uint8))
del blocks
print(now() - before)
"""


@pytest.mark.skipif(
    platform.libc_ver()[0] != "glibc", reason="other C libraries have no such bound"
)
def test_large_blocks_that_are_freed_go_back_to_the_system() -> None:
    kept = {
        what: float(subprocess.check_output([sys.executable, "-c", KEPT_MB, what]))
        for what in ("give back", "leave")
    }
    assert kept["give back"] < 10
    assert kept["leave"] > 50  # the bound is what makes the difference


def test_the_door_is_on_this_machine_only() -> None:
    with contextlib.closing(open_socket(0)) as door:
        assert door.getsockname()[0] == "127.0.0.1"


def test_a_port_that_is_taken_is_said() -> None:
    with contextlib.closing(open_socket(0)) as door:
        port = door.getsockname()[1]
        with pytest.raises(UavgramError, match=f"port {port} cannot be used.*--port"):
            open_socket(port)


# Connections that do not say what they want do not stay, and keep nobody out.


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Served]:
    with served(small_project(tmp_path)) as server:
        yield server


def calls(server: Served, count: int, said: bytes) -> list[socket.socket]:
    made = []
    for k in range(count):
        made.append(socket.create_connection(("127.0.0.1", server.port), timeout=30))
        made[-1].sendall(said[: 1 + k % len(said)])
    return made


def test_half_a_request_is_not_waited_for(server: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(request_timeout, "HEADERS_S", 0.3)
    half = f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\nCookie: x".encode()
    silent = calls(server, 300, half)
    silent += [socket.create_connection(("127.0.0.1", server.port), timeout=30)]
    second = socket.create_connection(("127.0.0.1", server.port), timeout=30)
    second.sendall(half + b"\r\n\r\n")  # a whole one, then half of the next
    answer = b""
    while b"<code>uavgram</code>" not in answer:
        part = second.recv(65536)
        assert part, "the answer ended without an explanation"
        answer += part
    assert answer.startswith(b"HTTP/1.1 403")
    second.sendall(half)
    began = time.monotonic()
    for call in [*silent, second]:
        with call, suppress(ConnectionResetError):
            assert call.recv(65536) == b""
    assert time.monotonic() - began < 20


def test_who_is_in_stays_and_who_comes_later_gets_in(
    server: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(request_timeout, "HEADERS_S", 0.3)
    entry = entry_of(server)
    with Page(server, entry) as page:
        monkeypatch.setattr(request_timeout, "HEADERS_S", 60.0)
        silent = calls(server, request_timeout.MAX_SILENT * 2, b"GET /")
        time.sleep(0.5)
        assert page.do("place", image=0, label="A", u_px=1, v_px=2)["t"] == "changed"
        assert ask(server.origin, headers={"Cookie": entry.cookie}).status_code == 200
        still = [one for one in silent if not is_closed(one)]
        assert len(still) <= request_timeout.MAX_SILENT
        for call in silent:
            call.close()


def is_closed(call: socket.socket) -> bool:
    call.settimeout(0.001)
    try:
        return call.recv(1) == b""
    except TimeoutError:
        return False
    except ConnectionResetError:
        return True


# When the page's server ends by itself: some time after its last tab, never before or at work.


def test_a_closed_tab_counts_from_its_end_and_no_tab_at_all_from_the_beginning() -> None:
    now = 0.0
    tabs = Tabs(clock=lambda: now)
    now = 1000.0
    assert tabs.gone_s() == 1000  # none has come yet
    tabs.expect()  # another address was given
    assert tabs.gone_s() == 0
    with tabs.one():
        now = 2000.0
        with tabs.one():
            now = 3000.0
        assert tabs.gone_s() == 0
        now = 4000.0
    now = 4010.0
    assert tabs.gone_s() == 10


class Reached:
    """A server in a thread, as `uavgram` starts it."""

    def __init__(self, wanted: Path | None) -> None:
        self.address = ""
        ready = threading.Event()

        def announce(address: str) -> None:
            self.address = address
            ready.set()

        arguments = (wanted, announce, lambda _: None)
        self.thread = threading.Thread(target=serving.serve, args=arguments, daemon=True)
        self.thread.start()
        assert ready.wait(LONGEST_WAIT_S)

    @property
    def origin(self) -> str:
        return self.address.partition("/?")[0]


def test_a_while_after_the_last_tab_the_project_is_free(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    project = small_project(tmp_path)
    reached = Reached(project)
    busy = threading.Event()
    busy.set()
    monkeypatch.setattr(OpenProject, "is_busy", property(lambda _: busy.is_set()))
    with Page(reached) as page:
        page.do("place", image=0, label="A", u_px=1.5, v_px=2.5)
        monkeypatch.setattr(serving, "ENDS_AFTER_S", 0.2)
        reached.thread.join(1.0)
        assert reached.thread.is_alive()  # a tab is open
    reached.thread.join(1.0)
    assert reached.thread.is_alive()  # results are being written
    busy.clear()
    reached.thread.join(LONGEST_WAIT_S)
    assert not reached.thread.is_alive()
    assert not is_locked(tmp_path / "out" / LOCK)
    assert "P1.jpg,A,1.5,2.5," in (tmp_path / "picks.csv").read_text(encoding="utf-8")


def test_a_tab_at_the_choice_of_a_folder_is_a_tab(monkeypatch: pytest.MonkeyPatch) -> None:
    reached = Reached(None)
    entry = entry_by(ask(reached.address, follow_redirects=False))
    address = entry.to(reached.origin.replace("http", "ws") + "/door/tab")
    headers = {"Cookie": entry.cookie}
    with connect(address, origin=Origin(reached.origin), additional_headers=headers, proxy=None):
        monkeypatch.setattr(serving, "ENDS_AFTER_S", 0.2)
        reached.thread.join(1.0)
        assert reached.thread.is_alive()
    reached.thread.join(LONGEST_WAIT_S)
    assert not reached.thread.is_alive()


def test_a_page_that_no_browser_ever_opened_ends_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serving, "ENDS_AFTER_S", 0.2)
    reached = Reached(None)
    reached.thread.join(LONGEST_WAIT_S)

    assert not reached.thread.is_alive()
