"""Connections that do not say what they want do not stay, and keep nobody out."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from pick_pages import Page, ask, entry_of, small_project
from picking_server import Served, served

from uavgram.picking.web import request_timeout


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
