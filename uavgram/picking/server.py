"""The page's server: a few routes, one socket for each open page, on this machine only."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
from collections.abc import AsyncIterator, Callable
from importlib import resources
from pathlib import Path

import uvicorn
from anyio import to_thread
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp
from starlette.websockets import WebSocket, WebSocketDisconnect

from uavgram.errors import UavgramError
from uavgram.picking import commands as c
from uavgram.picking.answers import Json
from uavgram.picking.autosave import Saver
from uavgram.picking.desk import Desk
from uavgram.picking.guard import Guard, Pace
from uavgram.picking.messages import LONGEST_MESSAGE, RefusedError, parse_message
from uavgram.picking.tables import Tables
from uavgram.pipeline.live import LiveSurvey

log = logging.getLogger(__name__)

SAVE_AFTER_S = 0.4
MOST_WAITING = 2000
"""Messages that may wait for a page; one that reads no more is let go."""
MOST_PAGES = 16
TRY_AGAIN_LATER = 1013
FAULTS_OF_THE_PAGE = {1002: "broken frames", 1007: "text that is no UTF-8", 1009: "too long"}

REPORT = "report.html"
REPORT_HEADERS = {
    # A document of its own: it may look as it likes, and do nothing.
    "content-security-policy": (
        "default-src 'none'; style-src 'unsafe-inline'; img-src data:; frame-ancestors 'none'; "
        "sandbox"
    )
}

Run = Callable[[], object]

_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
}


class PickServer:
    """Routes and sockets over a desk.

    Parameters
    ----------
    survey, saver
        The project, and who keeps its tables.
    run
        Runs the project from its files and writes its outputs.
    """

    def __init__(self, survey: LiveSurvey, saver: Saver, run: Run) -> None:
        self.desk = Desk(survey, saver, self._tell)
        self._run = run
        self._running = asyncio.Lock()
        self._pages: set[asyncio.Queue[Json]] = set()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._saving: asyncio.TimerHandle | None = None
        folder = resources.files("uavgram.picking") / "page"
        self._files = {file.name: file.read_bytes() for file in folder.iterdir() if file.is_file()}

    def application(self, announce: Callable[[], None] = lambda: None) -> Starlette:
        """The application; `announce` is called when it is ready."""

        @contextlib.asynccontextmanager
        async def life(_: Starlette) -> AsyncIterator[None]:
            self._loop = asyncio.get_running_loop()
            self.desk.open()
            announce()
            yield
            await to_thread.run_sync(self.desk.stop)  # it waits for an adjustment under way
            self.desk.close()

        return Starlette(
            routes=[
                Route("/", self._index),
                Route("/page/{name}", self._file),
                Route("/photo/{photo:int}/{level:int}/{column:int}/{row:int}.jpg", self._tile),
                Route("/photo/{photo:int}/thumbnail.jpg", self._thumbnail),
                Route("/report", self._report),
                WebSocketRoute("/socket", self._socket),
            ],
            lifespan=life,
        )

    async def _index(self, _: Request) -> Response:
        return Response(self._files["index.html"], media_type=_TYPES[".html"])

    async def _file(self, request: Request) -> Response:
        name = request.path_params["name"]
        if name not in self._files or Path(name).suffix not in _TYPES:
            return Response(status_code=404)
        kind = _TYPES[Path(name).suffix]
        return Response(self._files[name], media_type=kind, headers={"cache-control": "no-cache"})

    async def _tile(self, request: Request) -> Response:
        place = (request.path_params[key] for key in ("photo", "level", "column", "row"))
        return await self._picture(self.desk.tile, *place)

    async def _thumbnail(self, request: Request) -> Response:
        return await self._picture(self.desk.thumbnail, request.path_params["photo"])

    @staticmethod
    async def _picture(make: Callable[..., bytes | None], *place: int) -> Response:
        try:
            jpeg = await to_thread.run_sync(make, *place)
        except UavgramError as why:
            return JSONResponse({"why": str(why)}, 404)
        if jpeg is None:
            return Response(status_code=404)
        return Response(
            jpeg, media_type="image/jpeg", headers={"cache-control": "private, max-age=86400"}
        )

    async def _socket(self, page: WebSocket) -> None:
        if len(self._pages) >= MOST_PAGES:
            log.warning("refused a page: %d are open", MOST_PAGES)
            await page.close(TRY_AGAIN_LATER)
            return
        await page.accept()
        pace = Pace()
        waiting: asyncio.Queue[Json] = asyncio.Queue(MOST_WAITING)
        waiting.put_nowait(self.desk.hello())
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
            if not pace.told:
                log.warning("a page sends more messages than people can make: it is slowed down")
            pace.told = True
            await asyncio.sleep(wait_s)

    async def _send(self, page: WebSocket, waiting: asyncio.Queue[Json]) -> None:
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            while waiting in self._pages:
                await page.send_json(await waiting.get())
            await page.close(TRY_AGAIN_LATER)  # it missed something: it is to begin anew

    async def _answered(self, text: str, own: asyncio.Queue[Json]) -> Json:
        """Do what a message of a page says, tell the others what changed, and answer."""
        try:
            message = parse_message(text, self.desk.photos)
        except RefusedError as why:
            log.info("refused: %s", why)
            return {"t": "refused", "seq": why.seq, "why": str(why)}
        try:
            if isinstance(message.body, c.Export):
                return {"t": "exported", "seq": message.seq, **await self._exported()}
            if isinstance(message.body, c.Question):
                return await to_thread.run_sync(self.desk.answer, message)
            changed = self.desk.change(message)
        except UavgramError as why:  # refused, or a photo or the journal is not to be had
            log.info("refused: %s", why)
            return {"t": "refused", "seq": message.seq, "why": str(why)}
        self._broadcast({k: v for k, v in changed.items() if k != "seq"}, but=own)
        self._save_soon()
        return changed

    async def _exported(self) -> Json:
        """Save, run the project, and say where its outputs are; or why there are none."""
        self.desk.save()
        if self.desk.fault:
            return {"why": self.desk.fault}
        async with self._running:  # one at a time, whatever many pages ask for
            await to_thread.run_sync(self._run)
        return {"folder": self.desk.output}

    async def _report(self, _: Request) -> Response:
        path = Path(self.desk.output) / REPORT
        if not path.is_file():
            return Response("There is no report yet: write it on the page.", 404)
        page = await to_thread.run_sync(path.read_bytes)
        return Response(page, media_type=_TYPES[".html"], headers=REPORT_HEADERS)

    def _save_soon(self) -> None:
        if self._loop is None:
            return
        if self._saving is not None:
            self._saving.cancel()
        self._saving = self._loop.call_later(SAVE_AFTER_S, self.desk.save)

    def _tell(self, said: Json) -> None:
        """Tell every page, from any thread."""
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._broadcast, said)

    def _broadcast(self, said: Json, but: asyncio.Queue[Json] | None = None) -> None:
        for waiting in self._pages - {but}:
            try:
                waiting.put_nowait(said)
            except asyncio.QueueFull:
                log.warning("a page that reads no more is let go")
                self._pages.discard(waiting)


def serve(project: Path, announce: Callable[[str], None], run: Run, port: int = 0) -> None:
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

    Raises
    ------
    UavgramError
        The project cannot be read, or is open in another page.
    """
    survey = LiveSurvey.open(project)
    saver = Tables(survey.inputs)
    with contextlib.closing(socket.socket(socket.AF_INET, socket.SOCK_STREAM)) as door:
        try:
            door.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            door.bind(("127.0.0.1", port))
        except OSError as fault:
            saver.close()
            raise UavgramError(
                f"port {port} cannot be used: {fault.strerror}; choose another with --port"
            ) from fault
        pick = PickServer(survey, saver, run)
        bound = int(door.getsockname()[1])
        guard: list[Guard] = []
        app: ASGIApp = pick.application(lambda: announce(guard[0].address()))
        guard.append(Guard(app, bound))
        config = uvicorn.Config(
            guard[0],
            log_config=None,
            access_log=False,
            ws="websockets-sansio",
            ws_max_size=LONGEST_MESSAGE,
            ws_max_queue=64,
            timeout_graceful_shutdown=2,
            server_header=False,
        )
        with contextlib.suppress(KeyboardInterrupt):  # the way to end it
            uvicorn.Server(config).run(sockets=[door])
