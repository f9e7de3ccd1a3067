"""Serve the page on this machine: time limits of connections, and an orderly end."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import signal
import socket
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType

import h11
import uvicorn
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol

from uavgram.errors import UavgramError
from uavgram.io.folders import PROJECT
from uavgram.picking.protocol.parse import MAX_MESSAGE_BYTES
from uavgram.picking.session.folder_chooser import FolderChooser
from uavgram.picking.web import running_server
from uavgram.picking.web.guard import Guard
from uavgram.picking.web.server import ProjectHost, RunProject
from uavgram.pipeline.process_settings import return_large_blocks
from uavgram.pipeline.threads import limit_blas_threads

log = logging.getLogger(__name__)

ENDS_AFTER_S = 600.0
"""Time without an open tab after which the server ends [s]: then others can open the project."""

HEADERS_S = 10.0
"""Time from the connection to the end of the headers [s]; a local browser needs milliseconds."""

MAX_SILENT = 64
"""Largest number of connections without a complete request.

With one more, the oldest of them is closed, so that the latest, such as a person's, always gets
in.
"""

_KILLED = 128
"""Value that a shell adds to the number of the signal that ended a program."""


def open_socket(port: int) -> socket.socket:
    """Open a socket that listens on this machine only.

    Connections made before the server runs wait, and are answered once it does.

    Parameters
    ----------
    port
        Port number; 0: any free one.

    Raises
    ------
    UavgramError
        The port cannot be used.
    """
    # asyncio disables Nagle's algorithm only if the socket names its protocol. With it, the
    # second of two small messages waits until the page has acknowledged the first: up to 40 ms.
    door = socket.socket(socket.AF_INET, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    try:
        door.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        door.bind(("127.0.0.1", port))
        door.listen()
    except OSError as fault:
        door.close()
        raise UavgramError(
            f"port {port} cannot be used: {fault.strerror}; choose another with --port"
        ) from fault
    return door


@limit_blas_threads
def serve(
    wanted: Path | None,
    announce: Callable[[str], None],
    run: RunProject,
    port: int = 0,
    entered: Callable[[], None] = lambda: None,
) -> None:
    """Serve the page until its last tab is closed for a while, or Ctrl+C; everything is saved then.

    Parameters
    ----------
    wanted
        A project file, or a folder with a project.yaml: it is opened; its picks, lengths and
        measurements need not exist yet. A folder without one is set up on the page; None: a
        folder is chosen there.
    announce
        Called with the address to open, once it can be opened.
    run
        Runs a project from its files and writes its outputs, when the page asks for them.
    port
        Port number; 0: any free one.
    entered
        Called when a browser has used the address.

    Raises
    ------
    UavgramError
        The project is open in another page.
    KeyboardInterrupt
        Ctrl+C came; everything is saved.
    """
    return_large_blocks()
    is_bare = wanted is not None and wanted.is_dir() and not (wanted / PROJECT).exists()
    desk = ProjectHost(run, FolderChooser(wanted if is_bare else None), None if is_bare else wanted)
    try:
        opened = open_socket(port)
    except UavgramError:
        desk.let_go()
        raise
    with contextlib.closing(opened) as door:
        bound = int(door.getsockname()[1])
        guard: list[Guard] = []
        app: ASGIApp = desk.application(lambda: announce(guard[0].address()))
        guard.append(Guard(app, bound, entered, desk.way_to))
        config = uvicorn.Config(
            guard[0],
            log_config=None,
            access_log=False,
            http=TimeoutProtocol,
            ws="websockets-sansio",
            ws_max_size=MAX_MESSAGE_BYTES,
            ws_max_queue=64,
            ws_per_message_deflate=False,  # it never leaves the machine
            timeout_graceful_shutdown=2,
            server_header=False,
        )
        with (
            shut_down_orderly(),
            running_server.announce_server(running_server.ServerAddress(bound, guard[0].secret)),
        ):
            PageServer(config, guard[0], desk).run(sockets=[door])


class PageServer(uvicorn.Server):
    """Server that ends some time after the last tab was closed.

    Parameters
    ----------
    config
        Of the server.
    guard, desk
        What knows of tabs, and of work under way.
    """

    def __init__(self, config: uvicorn.Config, guard: Guard, desk: ProjectHost) -> None:
        super().__init__(config)
        self._guard, self._desk = guard, desk

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """End at the first signal: a second one would break off what the first one saves."""
        if not self.should_exit:
            super().handle_exit(sig, frame)

    async def on_tick(self, counter: int) -> bool:
        """Return whether to end; called ten times a second."""
        if self._guard.tabs.gone_s() > ENDS_AFTER_S and not self._desk.is_busy:
            log.info("ended, as no tab has been open for a while")
            self.should_exit = True
        return await super().on_tick(counter)


class TimeoutProtocol(H11Protocol):
    """HTTP protocol of uvicorn with a time limit for the headers, which uvicorn lacks."""

    _overdue: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Start the time limit."""
        super().connection_made(transport)
        self._wait()
        silent = [
            one for one in self.connections if isinstance(one, TimeoutProtocol) and one.is_silent
        ]
        if len(silent) > MAX_SILENT:
            min(silent, key=lambda one: one.due_s).let_go()

    def data_received(self, data: bytes) -> None:
        """Process received data; keep the time limit until the request is complete."""
        super().data_received(data)
        if self.cycle is not None and not self.cycle.response_complete:
            self._answered()
        elif not self.transport.is_closing() and self.transport.get_protocol() is self:
            self._wait()

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        """Pass the connection on: its request is complete."""
        self._answered()
        super().handle_websocket_upgrade(event)

    def connection_lost(self, exc: Exception | None) -> None:
        """Cancel the time limit."""
        self._answered()
        super().connection_lost(exc)

    @property
    def is_silent(self) -> bool:
        """Return whether no complete request has come yet."""
        return self._overdue is not None

    @property
    def due_s(self) -> float:
        """Time by which the request must be complete, by the loop's clock."""
        return 0.0 if self._overdue is None else self._overdue.when()

    def let_go(self) -> None:
        """Close the connection without an answer."""
        log.info("closed a connection that did not say what it wants")
        self._answered()
        self.transport.abort()

    def _wait(self) -> None:
        if self._overdue is None:
            self._overdue = self.loop.call_later(HEADERS_S, self.let_go)

    def _answered(self) -> None:
        if self._overdue is not None:
            self._overdue.cancel()
            self._overdue = None


@contextlib.contextmanager
def shut_down_orderly() -> Iterator[None]:
    """Leave the enclosed block by an exception where a signal would end the program at once.

    uvicorn stops at SIGTERM, and then sends it again as if it had not caught it: by default that
    ends the program before anything is cleared away. At SIGHUP it does not even stop. SIGINT it
    also catches where the shell ignores it, as for a job in the background.
    """
    if threading.current_thread() is not threading.main_thread():  # it gets no signals
        yield
        return
    before = {signal.SIGTERM: signal.signal(signal.SIGTERM, _leave)}
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        before[signal.SIGINT] = signal.signal(signal.SIGINT, signal.default_int_handler)
    if sys.platform != "win32" and signal.getsignal(signal.SIGHUP) is signal.SIG_DFL:  # no nohup
        before[signal.SIGHUP] = signal.signal(signal.SIGHUP, _terminate)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _leave(number: int, _: FrameType | None) -> None:
    sys.exit(_KILLED + number)


def _terminate(_number: int, _: FrameType | None) -> None:
    signal.raise_signal(signal.SIGTERM)
