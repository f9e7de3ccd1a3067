"""Time limit of connections without a complete request, and limit of their number."""

from __future__ import annotations

import asyncio
import logging

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

log = logging.getLogger(__name__)

HEADERS_S = 10.0
"""Time from the connection to the end of the headers [s]; a local browser needs milliseconds."""

MAX_SILENT = 64
"""Largest number of connections without a complete request.

With one more, the oldest of them is closed, so that the latest, such as a person's, always gets
in.
"""


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
