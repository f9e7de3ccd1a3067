"""The server of an open project: a few routes, and one socket for each open page."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from pathlib import Path

from anyio import to_thread
from starlette.routing import BaseRoute, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from uavgram.errors import UavgramError
from uavgram.picking.document import commands as c
from uavgram.picking.document.commands import RefusedError
from uavgram.picking.protocol import messages as m
from uavgram.picking.protocol.encode_quantities import (
    collect_lengths,
    list_kept_names,
    word_for_page,
)
from uavgram.picking.protocol.parse import parse_message
from uavgram.picking.session.project import Keep, OpenProject, Run
from uavgram.picking.session.session import PickSession
from uavgram.picking.storage.tables import Tables
from uavgram.picking.web.guard import RateLimit
from uavgram.picking.web.routes import file_routes
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
