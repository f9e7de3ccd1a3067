"""Content of one server: the start page for choosing a folder, or the open project."""

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
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from uavgram.errors import UavgramError
from uavgram.io.folders import PROJECT
from uavgram.picking.document.commands import RefusedError
from uavgram.picking.session.folder_chooser import MAX_REQUEST_BYTES, FolderChooser
from uavgram.picking.storage.tables import Tables
from uavgram.picking.web import running_server
from uavgram.picking.web.routes import START, WORK, PageJSON, page_routes
from uavgram.picking.web.server import PickServer
from uavgram.pipeline.pick.live_survey import LiveSurvey

log = logging.getLogger(__name__)

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
        Project to open at the start; None: none.

    Attributes
    ----------
    pick
        Server of the open project; None: none is open.

    Raises
    ------
    UavgramError
        The project cannot be read, or is open elsewhere.
    """

    def __init__(self, run: RunProject, door: FolderChooser, project: Path | None = None) -> None:
        self._run, self.door = run, door
        self.pick = None if project is None else self._read(project)
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
        pick.begin()
        self.door.remember(pick.path)

    async def _close(self, *, waits: bool = True) -> None:
        pick, self.pick, self._routes = self.pick, None, None
        if pick is not None:
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
            self.pick.picking.let_go()

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
                        return PageJSON({"why": OPEN_ALREADY.format(name), "open": name}, CANNOT)
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
