"""How the page is served: its socket answers without delay, its memory goes back."""

from __future__ import annotations

import asyncio
import contextlib
import platform
import socket
import subprocess
import sys

import pytest
from own_loop import run_alone

from uavgram.errors import UavgramError
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
from uavgram.picking.web.memory import return_large_blocks

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
