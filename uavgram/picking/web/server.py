"""Server of the start page or of an open project: a few routes, one socket for each page."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import AsyncIterator, Callable, Mapping
from functools import partial
from pathlib import Path

from anyio import to_thread
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route, WebSocketRoute
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from uavgram.errors import InputError, UavgramError
from uavgram.io.folders import PROJECT
from uavgram.picking.document import commands as c
from uavgram.picking.document.commands import RefusedError
from uavgram.picking.document.history import Session
from uavgram.picking.protocol import messages as m
from uavgram.picking.protocol.encode_quantities import (
    collect_lengths,
    list_kept_names,
    word_for_page,
)
from uavgram.picking.protocol.parse import parse_message
from uavgram.picking.session.folder_chooser import MAX_REQUEST_BYTES, FolderChooser
from uavgram.picking.session.project import Keep, OpenProject, Run
from uavgram.picking.session.session import PickSession
from uavgram.picking.storage.tables import Tables
from uavgram.picking.web import running_server
from uavgram.picking.web.guard import RateLimit
from uavgram.picking.web.routes import START, WORK, PageJSON, file_routes, page_routes
from uavgram.pipeline.pick.live_survey import LiveSurvey

log = logging.getLogger(__name__)

_Waiting = asyncio.Queue[m.ServerMessage]

SAVE_AFTER_S = 0.4
MAX_WAITING = 2000
"""Largest number of messages that wait for a page; one that reads no more is disconnected."""
MAX_PAGES = 16
TRY_AGAIN_LATER = 1013
FAILED = "The program failed, and its window says where. Your points are saved."
FAULTS_OF_THE_PAGE = {1002: "broken frames", 1007: "text that is no UTF-8", 1009: "too long"}

LOOK_OUTSIDE_S = 1.0
"""Interval between checks of files that other programs may change [s]."""


class PickServer:
    """Routes and sockets of the project that is open for picking.

    Parameters
    ----------
    survey, saver
        The project, and the store of its tables.
    run
        Runs the project from its files and writes its outputs.
    keep
        Makes a new store when the project is read again.
    """

    def __init__(self, survey: LiveSurvey, saver: Tables, run: Run, keep: Keep = Tables) -> None:
        self.project = OpenProject(survey, saver, run, self._broadcast_soon, keep)
        self._pages: set[_Waiting] = set()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._saving: asyncio.TimerHandle | None = None
        self._watching: asyncio.Task[None] | None = None
        self._acting: set[asyncio.Task[None]] = set()

    @property
    def picking(self) -> PickSession:
        """The picking session; replaced after the project was read again."""
        return self.project.picking

    @property
    def path(self) -> Path:
        """The project file."""
        return Path(self.picking.survey.inputs.project_path).resolve()

    def routes(self) -> list[BaseRoute]:
        """Return all routes of an open project."""
        return [*file_routes(self.project), WebSocketRoute("/socket", self._socket)]

    def begin(self) -> None:
        """Start to work, in the loop of the server."""
        self._loop = asyncio.get_running_loop()
        self.project.open()
        self._watching = asyncio.create_task(self._watch())

    @property
    def is_in_use(self) -> bool:
        """Return whether a tab shows it, or work on it is under way."""
        return bool(self._pages) or self.project.is_busy

    def save_or_explain(self) -> str:
        """Save; return the reason if that failed, else an empty text."""
        self._save()
        return self.picking.fault

    async def end(self, *, waits: bool) -> None:
        """Save, release the project, and notify its pages; see `OpenProject.close`."""
        if self._watching is not None:
            self._watching.cancel()
        if self._saving is not None:
            self._saving.cancel()
        await self.project.close(waits=waits)
        self._broadcast({"t": "closed"})

    async def _watch(self) -> None:
        """Check repeatedly for changes by other programs."""
        while True:
            await asyncio.sleep(LOOK_OUTSIDE_S)
            await to_thread.run_sync(self.project.outputs.look)
            self.project.look_outside()

    async def _socket(self, page: WebSocket) -> None:
        if len(self._pages) >= MAX_PAGES:
            log.warning("refused a page: %d are open", MAX_PAGES)
            await page.close(TRY_AGAIN_LATER)
            return
        await page.accept()
        pace = RateLimit()
        waiting: _Waiting = asyncio.Queue(MAX_WAITING)
        waiting.put_nowait(self.project.initial_state())
        self._pages.add(waiting)
        sender = asyncio.create_task(self._send(page, waiting))
        try:
            while True:
                text = await page.receive_text()
                await self._in_turn(pace)
                answer = await self._answer(text, waiting)
                if answer is not None:
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
    async def _in_turn(pace: RateLimit) -> None:
        wait_s = pace.wait_s()
        if wait_s > 0:
            if not pace.warned:
                log.warning("a page sends more messages than people can make: it is slowed down")
            pace.warned = True
            await asyncio.sleep(wait_s)

    async def _send(self, page: WebSocket, waiting: _Waiting) -> None:
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            while waiting in self._pages:
                message = await waiting.get()
                state, units = self.picking.state, self.picking.survey.inputs.project.units
                keep, exact = list_kept_names(state), collect_lengths(message, state)
                await page.send_json(word_for_page(message, units, keep, exact))
                if message["t"] == "closed":
                    break
            await page.close(TRY_AGAIN_LATER)  # it missed messages: it is to reconnect

    async def _answer(self, text: str, own: _Waiting) -> m.ServerMessage | None:
        """Carry out a message of a page, send the changes to the other pages, and answer.

        An action on the project may take minutes: it is answered when it ends, and what the page
        sends meanwhile does not wait for it.
        """
        try:
            message = parse_message(text, self.picking.photos)
        except RefusedError as why:
            log.info("refused: %s", why)
            return {"t": "refused", "seq": why.seq, "why": str(why)}
        try:
            self._require_open()
            if isinstance(message.body, c.ProjectAction):
                acting = asyncio.create_task(self._act(message.body, message.seq, own))
                self._acting.add(acting)
                acting.add_done_callback(self._acting.discard)
                await asyncio.sleep(0)  # it begins before the next message is read
                return None
            if isinstance(message.body, c.Question):
                return await to_thread.run_sync(self.picking.answer, message)
            changed = self.picking.change(message)
        except UavgramError as why:  # refused, or a photo or the journal is not available
            log.info("refused: %s", why)
            return {"t": "refused", "seq": message.seq, "why": str(why)}
        for_others = changed.copy()
        for_others.pop("seq", None)
        self._broadcast(for_others, but=own)
        self._save_soon()
        return changed

    async def _act(self, action: c.ProjectAction, seq: int, own: _Waiting) -> None:
        """Carry out an action on the project, and answer the page that asked for it."""
        answer: m.ServerMessage
        try:
            answer = await self.project.do(action)
        except UavgramError as why:
            log.info("refused: %s", why)
            answer = {"t": "refused", "why": str(why)}
        except Exception:
            log.exception("%s failed", type(action).__name__)  # a bug: the page goes on
            answer = {"t": "refused", "why": FAILED}
        answer["seq"] = seq
        if isinstance(action, c.Export):
            self._save()  # what was changed while the tables were read
        with contextlib.suppress(asyncio.QueueFull):  # the page has gone
            own.put_nowait(answer)

    def _require_open(self) -> None:
        if self.project.refuses:
            raise RefusedError(self.project.refuses)

    def _save_soon(self) -> None:
        if self._loop is None:
            return
        if self._saving is not None:
            self._saving.cancel()
        self._saving = self._loop.call_later(SAVE_AFTER_S, self._save)

    def _save(self) -> None:
        if not (self.project.refuses or self.project.reads_tables):
            self.picking.save()

    def _broadcast_soon(self, message: m.ServerMessage) -> None:
        """Send a message to every page, from any thread."""
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._broadcast, message)

    def _broadcast(self, message: m.ServerMessage, but: _Waiting | None = None) -> None:
        for waiting in self._pages - {but}:
            try:
                waiting.put_nowait(message)
            except asyncio.QueueFull:
                log.warning("a page that reads no more is let go")
                self._pages.discard(waiting)


RunProject = Callable[[Path], object]

TOO_LONG, CANNOT = 413, 409
OPEN_ALREADY = (
    "{} is open already, perhaps in another tab or at work: one project is open at a time."
)
ELSEWHERE = "This project is open in another page of uavgram."


class ProjectHost:
    """Server content: opens projects one after another, and shows the start page in between.

    Parameters
    ----------
    run
        Runs a project from its files and writes its outputs.
    door
        Choice of folders.
    project
        Project to open at the start; None: none. One that cannot be read is opened on the start
        page, which shows why it cannot.

    Attributes
    ----------
    pick
        Server of the open project; None: none is open.

    Raises
    ------
    UavgramError
        The project is open elsewhere.
    """

    def __init__(self, run: RunProject, door: FolderChooser, project: Path | None = None) -> None:
        self._run, self.door = run, door
        self.pick = None
        if project is not None:
            try:
                self.pick = self._read(project)
            except InputError as why:
                log.warning("%s", why)
                door.choose(project, opens=True)  # the start page shows it, and reads it again
        self._closed: tuple[Path, Session] | None = None
        self._routes: ASGIApp | None = None
        self._changing = asyncio.Lock()

    def _read(self, project: Path) -> PickServer:
        survey = LiveSurvey.open(project)
        saver = Tables(survey.inputs)
        return PickServer(survey, saver, partial(self._run, Path(survey.inputs.project_path)))

    def application(self, announce: Callable[[], None] = lambda: None) -> Starlette:
        """Return the application; `announce` is called when it is ready."""

        @contextlib.asynccontextmanager
        async def life(_: Starlette) -> AsyncIterator[None]:
            if self.pick is not None:
                self._show(self.pick)
            announce()
            yield
            await self._close(waits=False)

        shown = Starlette(
            routes=[
                *page_routes(lambda: START if self.pick is None else WORK),
                WebSocketRoute("/door/tab", _tab),
                Route("/door/beginning", self._beginning),
                Route("/door/folders", self._folders),
                Route("/door/look", self._look),
                Route("/door/picture.jpg", self._picture),
                Route("/door/begin", self._begin, methods=["POST"]),
                Route("/door/close", self._leave, methods=["POST"]),
            ],
            lifespan=life,
        )
        shown.router.default = self._answer_for_project
        return shown

    async def _answer_for_project(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request with the routes of the open project."""
        if self._routes is not None:
            await self._routes(scope, receive, send)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1013, "reason": "no project is open"})
        else:
            await Response(status_code=404)(scope, receive, send)

    def _show(self, pick: PickServer) -> None:
        self.pick, self._routes = pick, Starlette(routes=pick.routes())
        if self._closed is not None and self._closed[0] == pick.path:  # back from the set-up
            pick.picking.resume(self._closed[1])
        pick.begin()
        self.door.remember(pick.path)

    async def _close(self, *, waits: bool = True) -> None:
        pick, self.pick, self._routes = self.pick, None, None
        if pick is not None:
            self._closed = (pick.path, pick.picking.session)
            await pick.end(waits=waits)

    @property
    def is_busy(self) -> bool:
        """Return whether work is under way that closing the tabs does not end."""
        return self._changing.locked() or (self.pick is not None and self.pick.project.is_busy)

    def way_to(self, wanted: Path | None, only_open: bool) -> str | None:  # noqa: FBT001
        """Return the path of the page that shows a project; see `Guard`."""
        if wanted is None:
            return "/"
        project = wanted / PROJECT if wanted.is_dir() else wanted
        if self.pick is not None and self.pick.path == project.resolve():
            return "/"
        if only_open:
            return None
        self.door.choose(wanted, opens=True)
        return "/door"

    def let_go(self) -> None:
        """Release a project that was never shown."""
        if self.pick is not None:
            self.pick.picking.saver.close()

    async def _beginning(self, _: Request) -> Response:
        return await _answer(self.door.beginning)

    async def _folders(self, request: Request) -> Response:
        return await _answer(self.door.list_folders, request.query_params.get("folder", ""))

    async def _look(self, request: Request) -> Response:
        return await _answer(self.door.find_project_files, request.query_params.get("folder", ""))

    async def _picture(self, request: Request) -> Response:
        folder, group = (request.query_params.get(key, "") for key in ("folder", "group"))
        try:
            jpeg = await to_thread.run_sync(self.door.picture, folder, group)
        except UavgramError as why:
            return PageJSON({"why": str(why)}, 404)
        return Response(jpeg, media_type="image/jpeg", headers={"cache-control": "no-store"})

    async def _begin(self, request: Request) -> Response:
        """Set up a project and open it.

        Another open project that a tab shows, or that is at work, is saved and closed only if the
        request asks for that: otherwise a tab would change the content of others or end work.
        """
        body = b""
        async for part in request.stream():
            body += part
            if len(body) > MAX_REQUEST_BYTES:
                return PageJSON({"why": "the request is too long"}, TOO_LONG)
        closes = request.query_params.get("closes") == "yes"
        async with self._changing:
            meant = None
            try:
                meant = await to_thread.run_sync(self.door.meant, body)
                if self.pick is not None and self.pick.path != meant:
                    name = self.pick.path.parent.name
                    if self.pick.is_in_use and not closes:
                        return PageJSON(_already(name, meant.parent.name), CANNOT)
                    if fault := self.pick.save_or_explain():
                        raise RefusedError(f"{name} stays open: {fault}")
                project = await to_thread.run_sync(self.door.begin, body)
                if self.pick is not None and self.pick.path == project.resolve():
                    return PageJSON({})
                pick = await to_thread.run_sync(self._read, project)
            except UavgramError as why:
                is_here = self.pick is not None and self.pick.path == meant
                return await _refused_or_elsewhere(why, None if is_here else meant)
            await self._close()
            self._show(pick)
        return PageJSON({})

    async def _leave(self, request: Request) -> Response:
        """Save and close the open project; the page returns to the start page."""
        async with self._changing:
            if self.pick is not None:
                if request.query_params.get("to") == "setup":
                    self.door.choose(self.pick.path.parent)
                fault = self.pick.save_or_explain()
                if fault:
                    return _refuse(RefusedError(f"The project stays open: {fault}"))
                await self._close()
        return PageJSON({})


def _already(name: str, wanted: str) -> dict[str, str]:
    return {"why": OPEN_ALREADY.format(name), "open": name, "wanted": wanted}


async def _answer(find: Callable[..., Mapping[str, object]], *arguments: str) -> Response:
    try:
        return PageJSON(await to_thread.run_sync(find, *arguments))
    except UavgramError as why:
        return _refuse(why)


async def _refused_or_elsewhere(why: UavgramError, project: Path | None) -> Response:
    """Refuse to open a project; lead to the other server of this user that has it open, if any."""
    find = partial(running_server.request_address, project, lambda _: False)
    there = None if project is None else await to_thread.run_sync(find)
    if there is None:
        return _refuse(why)
    return PageJSON({"why": ELSEWHERE, "there": there.text}, CANNOT)


async def _tab(page: WebSocket) -> None:
    """Keep the socket of a start page, so that the server knows of its tab."""
    await page.accept()
    with contextlib.suppress(WebSocketDisconnect, KeyError, RuntimeError):
        while True:
            await page.receive_text()


def _refuse(why: UavgramError) -> Response:
    log.info("refused: %s", why)
    field = why.field if isinstance(why, RefusedError) else ""
    return PageJSON({"why": str(why), "field": field}, CANNOT)
