"""How long a connection may take to say what it wants, and how many may take that long at once."""

from __future__ import annotations

import asyncio
import logging

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

log = logging.getLogger(__name__)

HEADERS_S = 10.0
"""From the first moment to the end of the headers; a browser of this machine needs milliseconds."""

MOST_SILENT = 64
"""Connections that have sent no whole request yet; with one more, the oldest of them is closed,
so that who comes last, as a person does, always gets in."""


class PatientProtocol(H11Protocol):
    """HTTP as uvicorn speaks it, which alone would wait for headers for ever."""

    _overdue: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to wait for a request."""
        super().connection_made(transport)
        self._wait()
        silent = [
            one for one in self.connections if isinstance(one, PatientProtocol) and one.is_silent
        ]
        if len(silent) > MOST_SILENT:
            min(silent, key=lambda one: one.due_s).let_go()

    def data_received(self, data: bytes) -> None:
        """Take what came; wait on where it was no whole request."""
        super().data_received(data)
        if self.cycle is not None and not self.cycle.response_complete:
            self._answered()
        elif not self.transport.is_closing() and self.transport.get_protocol() is self:
            self._wait()

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        """Hand the connection on: its request is whole."""
        self._answered()
        super().handle_websocket_upgrade(event)

    def connection_lost(self, exc: Exception | None) -> None:
        """Wait no more."""
        self._answered()
        super().connection_lost(exc)

    @property
    def is_silent(self) -> bool:
        """Whether no whole request has come yet."""
        return self._overdue is not None

    @property
    def due_s(self) -> float:
        """When the request must be whole, by the loop's clock."""
        return 0.0 if self._overdue is None else self._overdue.when()

    def let_go(self) -> None:
        """Close it without an answer."""
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
