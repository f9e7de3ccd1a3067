"""A picking page's server in a thread, with its session to look at."""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import uvicorn

from uavgram.picking.session.folder_chooser import FolderChooser
from uavgram.picking.session.session import PickSession
from uavgram.picking.web.guard import Guard
from uavgram.picking.web.server import PickServer, ProjectHost, RunProject
from uavgram.picking.web.serving import TimeoutProtocol, open_socket
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs


def compute_project(project: Path) -> object:
    """Run a project, and write nothing."""
    return compute(read_inputs(project))


class Served:
    """A picking page's server in a thread, and its session."""

    def __init__(
        self,
        project: Path | None,
        door: FolderChooser | None = None,
        run: RunProject = compute_project,
    ) -> None:
        self.desk = ProjectHost(run, FolderChooser(roots=()) if door is None else door, project)
        self._door = open_socket(0)
        self.port = self._door.getsockname()[1]
        self.guard = Guard(self.desk.application(), self.port, way_to=self.desk.way_to)
        config = uvicorn.Config(
            self.guard,
            log_config=None,
            http=TimeoutProtocol,
            ws="websockets-sansio",
            timeout_graceful_shutdown=1,
        )
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(target=self._run, daemon=True)

    @property
    def origin(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    @property
    def address(self) -> str:
        return self.guard.address()

    @property
    def pick(self) -> PickServer:
        """The server of the project that is open."""
        assert self.desk.pick is not None
        return self.desk.pick

    @property
    def picking(self) -> PickSession:
        return self.pick.picking

    def start(self) -> None:
        self._thread.start()
        while not self._server.started:
            time.sleep(0.01)

    def _run(self) -> None:
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        """Serve; then close what clients left open, which the end of a process would close."""
        await self._server.serve(sockets=[self._door])
        for connection in list(self._server.server_state.connections):
            transport = connection.transport
            if transport is not None:
                transport.abort()
        await asyncio.sleep(0.05)  # the loop calls connection_lost, which closes the sockets

    def stop(self) -> None:
        self._server.should_exit = True
        self._thread.join(20)
        self._door.close()


@contextlib.contextmanager
def served(
    project: Path | None, door: FolderChooser | None = None, run: RunProject = compute_project
) -> Iterator[Served]:
    """Serve the picking page of a project, or the door to all of them."""
    server = Served(project, door, run)
    server.start()
    try:
        yield server
    finally:
        server.stop()
