"""The page's server: a few routes, one socket for each open page, on this machine only."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import uvicorn
from anyio import to_thread
from starlette.applications import Starlette
from starlette.routing import WebSocketRoute
from starlette.types import ASGIApp
from starlette.websockets import WebSocket, WebSocketDisconnect

from uavgram.errors import UavgramError
from uavgram.picking.document import commands as c
from uavgram.picking.document.refused import RefusedError
from uavgram.picking.protocol.encode_survey import Json
from uavgram.picking.protocol.encode_units import in_project_units, lengths_of, names_to_keep
from uavgram.picking.protocol.parse import LONGEST_MESSAGE, parse_message
from uavgram.picking.session.project import Keep, OpenProject, Run
from uavgram.picking.session.session import PickSession
from uavgram.picking.storage.tables import Tables
from uavgram.picking.web.ending import ended_in_order
from uavgram.picking.web.guard import Guard, Pace
from uavgram.picking.web.malloc import give_back_large_blocks
from uavgram.picking.web.patience import PatientProtocol
from uavgram.picking.web.routes import file_routes
from uavgram.picking.web.running import Door, left_in
from uavgram.pipeline.pick.live import LiveSurvey
from uavgram.pipeline.threads import with_one_blas_thread

log = logging.getLogger(__name__)

SAVE_AFTER_S = 0.4
MOST_WAITING = 2000
"""Messages that may wait for a page; one that reads no more is let go."""
MOST_PAGES = 16
TRY_AGAIN_LATER = 1013
FAULTS_OF_THE_PAGE = {1002: "broken frames", 1007: "text that is no UTF-8", 1009: "too long"}

LOOK_OUTSIDE_S = 1.0
"""Between two looks at files that others may change."""


class PickServer:
    """Routes and sockets of the project that is open for picking.

    Parameters
    ----------
    survey, saver
        The project, and who keeps its tables.
    run
        Runs the project from its files and writes its outputs.
    keep
        Makes another saver, where the project is read again.
    """

    def __init__(self, survey: LiveSurvey, saver: Tables, run: Run, keep: Keep = Tables) -> None:
        self.project = OpenProject(survey, saver, run, self._broadcast_soon, keep)
        self._pages: set[asyncio.Queue[Json]] = set()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._saving: asyncio.TimerHandle | None = None

    @property
    def picking(self) -> PickSession:
        """The picking session; another one after the project was read again."""
        return self.project.picking

    def application(self, announce: Callable[[], None] = lambda: None) -> Starlette:
        """The application; `announce` is called when it is ready."""

        @contextlib.asynccontextmanager
        async def life(_: Starlette) -> AsyncIterator[None]:
            self._loop = asyncio.get_running_loop()
            self.project.open()
            watch = asyncio.create_task(self._watch())
            announce()
            yield
            watch.cancel()
            await to_thread.run_sync(self.project.stop)
            self.project.close()

        return Starlette(
            routes=[*file_routes(self.project), WebSocketRoute("/socket", self._socket)],
            lifespan=life,
        )

    async def _watch(self) -> None:
        """Look again and again for what other programs change."""
        while True:
            await asyncio.sleep(LOOK_OUTSIDE_S)
            await to_thread.run_sync(self.project.outputs.look)
            self.project.look_outside()

    async def _socket(self, page: WebSocket) -> None:
        if len(self._pages) >= MOST_PAGES:
            log.warning("refused a page: %d are open", MOST_PAGES)
            await page.close(TRY_AGAIN_LATER)
            return
        await page.accept()
        pace = Pace()
        waiting: asyncio.Queue[Json] = asyncio.Queue(MOST_WAITING)
        waiting.put_nowait(self.project.initial_state())
        self._pages.add(waiting)
        sender = asyncio.create_task(self._send(page, waiting))
        try:
            while True:
                text = await page.receive_text()
                await self._in_turn(pace)
                answer = await self._answered(text, waiting)
                await waiting.put(answer)
        except WebSocketDisconnect as gone:
            fault = FAULTS_OF_THE_PAGE.get(gone.code)
            if fault:
                log.warning("let a page go: its message was refused (%s)", fault)
        except (KeyError, RuntimeError):  # bytes; closed by the sender
            log.warning("let a page go: it does not speak as our page does")
        finally:
            self._pages.discard(waiting)
            sender.cancel()

    @staticmethod
    async def _in_turn(pace: Pace) -> None:
        wait_s = pace.wait_s()
        if wait_s > 0:
            if not pace.warned:
                log.warning("a page sends more messages than people can make: it is slowed down")
            pace.warned = True
            await asyncio.sleep(wait_s)

    async def _send(self, page: WebSocket, waiting: asyncio.Queue[Json]) -> None:
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            while waiting in self._pages:
                message = await waiting.get()
                state, units = self.picking.state, self.picking.survey.inputs.project.units
                keep, exact = names_to_keep(state), lengths_of(message, state)
                await page.send_json(in_project_units(message, units, keep, exact))
            await page.close(TRY_AGAIN_LATER)  # it missed something: it is to begin anew

    async def _answered(self, text: str, own: asyncio.Queue[Json]) -> Json:
        """Do what a message of a page says, send the others what changed, and answer."""
        try:
            message = parse_message(text, self.picking.photos)
        except RefusedError as why:
            log.info("refused: %s", why)
            return {"t": "refused", "seq": why.seq, "why": str(why)}
        try:
            if self.project.refuses:
                raise RefusedError(self.project.refuses)
            if isinstance(message.body, c.ProjectAction):
                return {"seq": message.seq, **await self.project.do(message.body)}
            if isinstance(message.body, c.Question):
                return await to_thread.run_sync(self.picking.answer, message)
            changed = self.picking.change(message)
        except UavgramError as why:  # refused, or a photo or the journal is not to be had
            log.info("refused: %s", why)
            return {"t": "refused", "seq": message.seq, "why": str(why)}
        self._broadcast({k: v for k, v in changed.items() if k != "seq"}, but=own)
        self._save_soon()
        return changed

    def _save_soon(self) -> None:
        if self._loop is None:
            return
        if self._saving is not None:
            self._saving.cancel()
        self._saving = self._loop.call_later(SAVE_AFTER_S, self._save)

    def _save(self) -> None:
        if not self.project.refuses:
            self.picking.save()

    def _broadcast_soon(self, message: Json) -> None:
        """Send a message to every page, from any thread."""
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._broadcast, message)

    def _broadcast(self, message: Json, but: asyncio.Queue[Json] | None = None) -> None:
        for waiting in self._pages - {but}:
            try:
                waiting.put_nowait(message)
            except asyncio.QueueFull:
                log.warning("a page that reads no more is let go")
                self._pages.discard(waiting)


def open_door(port: int) -> socket.socket:
    """A socket that listens on this machine only.

    Connections made before the server runs wait, and are answered once it does.

    Parameters
    ----------
    port
        0: any free one.

    Raises
    ------
    UavgramError
        The port cannot be used.
    """
    # asyncio turns Nagle's algorithm off only where the socket names its protocol. With it, the
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


@with_one_blas_thread
def serve(
    project: Path,
    announce: Callable[[str], None],
    run: Run,
    port: int = 0,
    entered: Callable[[], None] = lambda: None,
) -> None:
    """Serve the picking page of a project until Ctrl+C; everything is saved then.

    Parameters
    ----------
    project
        The project file; its picks, lengths and measurements need not be there yet.
    announce
        Called with the address to open, once it can be opened.
    run
        Runs the project from its files and writes its outputs, where the page asks for them.
    port
        0: any free one.
    entered
        Called when a browser has used the address.

    Raises
    ------
    UavgramError
        The project cannot be read, or is open in another page.
    """
    give_back_large_blocks()
    survey = LiveSurvey.open(project)
    saver = Tables(survey.inputs)
    try:
        opened = open_door(port)
    except UavgramError:
        saver.close()
        raise
    with contextlib.closing(opened) as door:
        pick = PickServer(survey, saver, run)
        bound = int(door.getsockname()[1])
        guard: list[Guard] = []
        app: ASGIApp = pick.application(lambda: announce(guard[0].address()))
        guard.append(Guard(app, bound, entered))
        config = uvicorn.Config(
            guard[0],
            log_config=None,
            access_log=False,
            http=PatientProtocol,
            ws="websockets-sansio",
            ws_max_size=LONGEST_MESSAGE,
            ws_max_queue=64,
            ws_per_message_deflate=False,  # it never leaves the machine
            timeout_graceful_shutdown=2,
            server_header=False,
        )
        told = left_in(Path(survey.inputs.project.output), Door(bound, guard[0].secret))
        with ended_in_order(), told, contextlib.suppress(KeyboardInterrupt):  # the way to end it
            uvicorn.Server(config).run(sockets=[door])
