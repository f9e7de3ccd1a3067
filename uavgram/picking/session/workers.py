"""Workers that process only the newest of their tasks, such as those that adjust the newest state.

Two workers adjust: one answers at once, to first order from the last full adjustment, if the full
one is slower than people notice or is busy with an older state; the other adjusts in full, and
waits while a step continues (a drag). So numbers move with the pointer even if an adjustment is
slow.

The stage of long work is broadcast to the page, and a person can stop it.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Generic, TypeVar

from uavgram.errors import UavgramError
from uavgram.model.work import watch_work
from uavgram.picking.document.commands import RefusedError, Work
from uavgram.picking.document.state import State, make_observations
from uavgram.picking.protocol import messages as m
from uavgram.picking.protocol.encode_survey import (
    adjusted_json,
    linearised_json,
    unadjusted_json,
)
from uavgram.pipeline.pick.live_survey import LiveAdjustment, LiveSurvey, Observations

log = logging.getLogger(__name__)

AT_ONCE_S = 0.1
"""Longest delay that people perceive as immediate [s] (Miller 1968; Nielsen 1993, ch. 5)."""

ON_THE_WAY_S = 0.05
"""Part of it for the way from the pointer to the server and back onto the screen [s]."""

FAULT = (
    "uavgram has failed at this state (a fault of the program: its log says where). Nothing that "
    "was done is lost; take the last change back, or go on."
)

REST_S = 0.3
"""Pause of a step after which it is adjusted in full, though it may continue [s]."""

AnyTask = TypeVar("AnyTask")
Answer = Callable[[int, m.Adjustment], None]
"""Receiver of a state's number and its results, called from a worker's thread."""


class LatestTask(Generic[AnyTask]):
    """The newest task, and the threads that work on it; older tasks are skipped.

    Parameters
    ----------
    workers
        Function that each thread runs, by its name: until `newer` returns None.

    Attributes
    ----------
    changed
        Condition held while the attributes are read or set; notified when they change.
    task
        The newest task; None before the first.
    is_over
        Whether the threads are to end.
    """

    def __init__(self, workers: Mapping[str, Callable[[], None]]) -> None:
        self.changed = threading.Condition()
        self.task: AnyTask | None = None
        self.is_over = False
        self._threads = [
            threading.Thread(target=work, name=name, daemon=True) for name, work in workers.items()
        ]

    def start(self) -> None:
        """Start the threads."""
        for thread in self._threads:
            thread.start()

    def submit(self, task: AnyTask) -> None:
        """Make this the newest task."""
        with self.changed:
            self.task = task
            self.changed.notify_all()

    def newer(self, than: AnyTask | None) -> AnyTask | None:
        """Wait for a task newer than the last one; None after `stop`."""
        with self.changed:
            self.changed.wait_for(lambda: self.task is not than or self.is_over)
            return None if self.is_over else self.task

    def is_outdated(self, task: AnyTask) -> bool:
        """Return whether there is a newer task, or `stop` was called."""
        with self.changed:
            return self.task is not task or self.is_over

    def stop(self) -> None:
        """End the threads, each after its present task."""
        with self.changed:
            self.is_over = True
            self.changed.notify_all()
        for thread in self._threads:
            if thread.is_alive():
                thread.join()


@dataclass(frozen=True)
class Task:
    """State to adjust: its number, and whether the step that made it has ended."""

    version: int
    state: State
    final: bool


class AdjustmentWorkers(LatestTask[Task]):
    """Workers that adjust the newest state.

    Parameters
    ----------
    survey
        The project.
    index
        Numbers of the photos by name.
    answer
        Called with each answer, by one worker at a time.
    broadcast
        Called from any thread with messages for all pages.
    """

    def __init__(
        self, survey: LiveSurvey, index: dict[str, int], answer: Answer, broadcast: m.Broadcast
    ) -> None:
        super().__init__({"first order": self._answer_first_order, "adjustment": self._adjust})
        self._survey, self._index, self._answer = survey, index, answer
        self.work = WatchedWork("adjustment", broadcast, HIDDEN_S)
        self._waiting: Task | None = None  # task for the full adjustment
        self._due_s = 0.0  # earliest start of the full adjustment, on the monotonic clock
        self._busy = False
        self.last: LiveAdjustment | None = None  # the last full adjustment
        self._answering = threading.Lock()
        self._linearised_task: Task | None = None  # newest task answered to first order

    def stop(self) -> None:
        """Stop the current adjustment, and end."""
        self.work.stop()
        super().stop()

    def _answer_first_order(self) -> None:
        """Answer tasks at once if that helps, and pass all on to the full adjustment."""
        task: Task | None = None
        while (task := self.newer(task)) is not None:
            rests = self._update_linearly(task) and not task.final
            with self.changed:
                self._waiting = task
                self._due_s = time.monotonic() + (REST_S if rests else 0.0)
                self.changed.notify_all()

    def _update_linearly(self, task: Task) -> bool:
        """Answer to first order; return False if only the full adjustment applies."""
        with self._answering:
            last = self.last
            slow = self._busy or (last is not None and last.seconds > AT_ONCE_S - ON_THE_WAY_S)
            if not (slow and self._first_order(task)):
                return False
            self._linearised_task = task
        return True

    def _first_order(self, task: Task) -> bool:
        if self.last is None:
            return False
        try:
            quick = self._survey.update_linearly(self.last, collect_observations(task.state))
        except Exception:  # a bug here must not end the worker: a full answer follows
            log.exception("the first-order answer failed")
            return False
        if quick is None:
            return False
        self._answer(task.version, linearised_json(quick, self._index))
        return True

    def _adjust(self) -> None:
        """Adjust tasks in full when they are due."""
        while (task := self._due()) is not None:
            try:
                adjusted, message = self._full(task)
            except StoppedError:  # the newest task is due
                self._busy = False
                continue
            with self._answering:
                self.last = adjusted
                self._answer(task.version, message)
                if (
                    self._linearised_task is not None
                    and self._linearised_task.version > task.version
                ):
                    self._first_order(self._linearised_task)  # repeat it from the newer base
                self._busy = False

    def _due(self) -> Task | None:
        with self.changed:
            while not self.is_over:
                left_s = self._due_s - time.monotonic()
                if self._waiting is None or self._waiting is not self.task:
                    self.changed.wait()
                elif left_s > 0:
                    self.changed.wait(left_s)
                else:
                    task, self._waiting, self._busy = self._waiting, None, True
                    return task
        return None

    def is_outdated(self, task: Task) -> bool:
        """Return whether a later step has ended; one that continues waits for this adjustment."""
        newest = self.task
        return newest is not None and newest.final and newest.version > task.version

    def _full(self, task: Task) -> tuple[LiveAdjustment | None, m.Adjusted | m.Unadjusted]:
        try:
            observed = collect_observations(task.state)
            adjusted = self.work.run(
                lambda: self._survey.adjust(observed), lambda: self.is_outdated(task)
            )
            return adjusted, adjusted_json(adjusted, self._index)
        except UavgramError as why:
            if isinstance(why, RefusedError) and self.last is not None:  # stopped by a person
                return self.last, {**adjusted_json(self.last, self._index), "stopped": str(why)}
            return None, unadjusted_json(str(why), self._survey.inputs.messages)
        except Exception:  # a bug here must not end the worker: the page goes on
            log.exception("the adjustment failed")
            return None, unadjusted_json(FAULT, self._survey.inputs.messages)


def collect_observations(state: State) -> Observations:
    """Return a state in the form of the adjustment."""
    picks, lines = make_observations(state)
    return Observations(picks=picks, lines=lines, requests=state.requests)


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
