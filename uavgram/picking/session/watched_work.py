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
        "You stopped the computation, so there are no values for your last change. Your marks and "
        "lengths are kept. It starts again with the next change, and when results are written."
    ),
    "search": "Stopped: what was found so far is proposed. The next change searches again.",
}

Made = TypeVar("Made")


HIDDEN_S = 1.0
"""Duration of work in the background up to which its stages are not shown [s]."""


class StoppedError(BaseException):
    """The work is no longer wanted: it is no fault that a stage could mend."""


def _never() -> bool:
    return False


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
        self._is_outdated: Callable[[], bool] = _never

    def run(self, work: Callable[[], Made], is_outdated: Callable[[], bool] = _never) -> Made:
        """Work, and broadcast the names of the stages.

        Parameters
        ----------
        work
            Reports its stages, and that it goes on (`report_work`).
        is_outdated
            Returns whether its result is no longer wanted.

        Raises
        ------
        RefusedError
            A person stopped it.
        StoppedError
            It is outdated.
        """
        self._is_stopped, self._is_outdated = False, is_outdated
        self._stage, self._begun_s = "", time.monotonic()
        try:
            with watch_work(self._watch):
                return work()
        except StoppedError:
            if self._is_stopped:
                raise RefusedError(STOPPED[self._kind]) from None
            raise
        finally:
            if self.shown:
                self._show("")

    def stop(self) -> None:
        """Stop the present work at its next step."""
        self._is_stopped = True

    def _watch(self, stage: str) -> None:
        if self._is_stopped or self._is_outdated():
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
