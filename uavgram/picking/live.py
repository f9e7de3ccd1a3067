"""The newest state is adjusted, older ones are passed over: one worker, one place to wait.

While a step goes on (a drag) the last adjustment is only linearised, where the full one is slower
than people notice; it is run when the step ends or rests.
"""

from __future__ import annotations

import logging
import threading
from dataclasses import dataclass
from typing import Protocol

from uavgram.errors import UavgramError
from uavgram.picking.answers import Json, adjusted_json, linearised_json, unadjusted_json
from uavgram.picking.state import State, observations_of
from uavgram.pipeline.live import Adjusted, LiveSurvey, Observed

log = logging.getLogger(__name__)

AT_ONCE_S = 0.1
"""Up to this long people take an answer for immediate (Miller 1968; Nielsen 1993, ch. 5)."""

REST_S = 0.3
"""A step that has rested this long is adjusted in full, though it may go on."""


@dataclass(frozen=True)
class Task:
    """A state to adjust: its number, and whether the step that made it has ended."""

    version: int
    state: State
    final: bool


class Answer(Protocol):
    """Takes what is known of a state, from the worker's thread."""

    def __call__(self, version: int, said: Json) -> None:
        """Tell the page."""
        ...


class Live:
    """A worker that adjusts the newest state.

    Parameters
    ----------
    survey
        What is picked.
    index
        Numbers of the photos by name.
    answer
        Called with each answer.
    """

    def __init__(self, survey: LiveSurvey, index: dict[str, int], answer: Answer) -> None:
        self._survey, self._index, self._answer = survey, index, answer
        self._changed = threading.Condition()
        self._task: Task | None = None
        self._stopped = False
        self._last: Adjusted | None = None
        self._thread = threading.Thread(target=self._work, name="adjustment", daemon=True)

    @property
    def last(self) -> Adjusted | None:
        """The last full adjustment."""
        return self._last

    def start(self) -> None:
        """Begin to work."""
        self._thread.start()

    def submit(self, task: Task) -> None:
        """Adjust this state next; those that wait are passed over."""
        with self._changed:
            self._task = task
            self._changed.notify()

    def stop(self) -> None:
        """End after the adjustment under way."""
        with self._changed:
            self._stopped = True
            self._changed.notify()
        if self._thread.is_alive():
            self._thread.join()

    def _work(self) -> None:
        while (task := self._next()) is not None:
            if not task.final and self._quick(task):
                task = self._rested(task)
                if task is None:
                    continue
            self._full(task)

    def _next(self) -> Task | None:
        with self._changed:
            self._changed.wait_for(lambda: self._task is not None or self._stopped)
            task, self._task = self._task, None
            return None if self._stopped else task

    def _rested(self, task: Task) -> Task | None:
        """The task, if nothing newer comes for a while."""
        with self._changed:
            newer = self._changed.wait_for(
                lambda: self._task is not None or self._stopped, timeout=REST_S
            )
        return None if newer else task

    def _quick(self, task: Task) -> bool:
        """Answer by linearising the last adjustment; False where the full one is the thing."""
        base = self._last
        if base is None or base.seconds < AT_ONCE_S:
            return False
        quick = self._survey.linearised(base, observed_in(task.state))
        if quick is None:
            return False
        self._answer(task.version, linearised_json(quick, self._index))
        return True

    def _full(self, task: Task) -> None:
        try:
            self._last = self._survey.adjust(observed_in(task.state))
        except UavgramError as why:
            self._last = None
            messages = self._survey.inputs.messages
            self._answer(task.version, unadjusted_json(str(why), messages))
            return
        self._answer(task.version, adjusted_json(self._last, self._index))


def observed_in(state: State) -> Observed:
    """A state as the adjustment takes it."""
    picks, lines = observations_of(state)
    return Observed(picks=picks, lines=lines, requests=state.requests)
