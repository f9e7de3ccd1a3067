"""Long work that the page shows: its stage is broadcast, and a person can stop it."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

from uavgram.model.work import watch_work
from uavgram.picking.document.commands import RefusedError, Work
from uavgram.picking.protocol import messages as m

SHOW_EVERY_S = 0.3
"""Shortest time between two messages on a loop [s]."""

STOPPED: dict[Work, str] = {
    "results": "Stopped: nothing was written. Earlier results are unchanged.",
    "adjustment": (
        "You stopped the computation, so there are no values yet. Your marks and lengths are kept. "
        "It starts again with the next change, and when results are written."
    ),
}

Made = TypeVar("Made")


class StoppedError(BaseException):
    """The work is no longer wanted: it is no fault that a stage could mend."""


class WatchedWork:
    """Work of one kind that is shown on the page and can be stopped.

    Parameters
    ----------
    kind
        Kind of work.
    broadcast
        Called from any thread with messages for all pages.
    hidden_s
        Time for which it is not shown: most work of this kind ends within it.

    Attributes
    ----------
    shown
        Stage that is shown; empty: none.
    """

    def __init__(self, kind: Work, broadcast: m.Broadcast, hidden_s: float = 0.0) -> None:
        self._kind: Work = kind
        self._broadcast, self._hidden_s = broadcast, hidden_s
        self._stage = self.shown = ""
        self._begun_s = self._shown_s = 0.0  # on the monotonic clock
        self._is_stopped = False

    def run(self, work: Callable[[], Made]) -> Made:
        """Work, and broadcast the names of the stages.

        Raises
        ------
        RefusedError
            A person stopped it.
        """
        self._is_stopped = False
        self._stage, self._begun_s = "", time.monotonic()
        try:
            with watch_work(self._watch):
                return work()
        except StoppedError:
            raise RefusedError(STOPPED[self._kind]) from None
        finally:
            if self.shown:
                self._show("")

    def stop(self) -> None:
        """Stop the present work at its next step."""
        self._is_stopped = True

    def _watch(self, stage: str) -> None:
        if self._is_stopped:
            raise StoppedError
        self._stage = stage or self._stage
        now_s = time.monotonic()
        is_loop = ":" in self._stage  # which has many of these
        is_due = now_s - self._begun_s >= self._hidden_s and (
            not is_loop or now_s - self._shown_s >= SHOW_EVERY_S
        )
        if is_due and self._stage != self.shown:
            self._show(self._stage)

    def _show(self, stage: str) -> None:
        self.shown, self._shown_s = stage, time.monotonic()
        self._broadcast({"t": "work", "kind": self._kind, "stage": stage})
