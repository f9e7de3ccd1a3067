"""The worker: the newest state is adjusted, and a drag is answered to first order."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any, cast

import pytest

from uavgram.errors import UavgramError
from uavgram.model.work import report_work
from uavgram.picking.document.state import Pick, State
from uavgram.picking.session import workers as module
from uavgram.picking.session.workers import AdjustmentWorkers, Task
from uavgram.pipeline.pick.live_survey import LiveAdjustment, LiveSurvey, Observations

LONGEST_WAIT_S = 60.0


def state(count: int) -> State:
    return State(
        picks=tuple(Pick(image="1.jpg", label=f"P{k}", u_px=0.0, v_px=0.0) for k in range(count))
    )


class Survey:
    """Stands in for a project: adjusts as slowly as it is told to."""

    inputs = SimpleNamespace(messages=())

    def __init__(self, seconds: float, *, reports: bool = False) -> None:
        self.seconds, self.reports = seconds, reports
        self.adjusted: list[int] = []
        self.linearised_: list[int] = []
        self.go_on, self.begun = threading.Event(), threading.Event()
        self.go_on.set()

    def adjust(self, observed: Observations) -> SimpleNamespace:
        self.begun.set()
        while self.reports and not self.go_on.wait(0.005):
            report_work()
        self.go_on.wait(LONGEST_WAIT_S)
        count = len(observed.picks.image)
        self.adjusted.append(count)
        if not count:
            raise UavgramError("Nothing is picked yet.")
        return SimpleNamespace(seconds=self.seconds, count=count)

    def update_linearly(self, base: LiveAdjustment, observed: Observations) -> SimpleNamespace:
        self.linearised_.append(len(observed.picks.image))
        return SimpleNamespace(base=base)


Answers = list[tuple[int, Any]]
Start = Callable[[Survey], tuple[AdjustmentWorkers, Answers]]


@pytest.fixture
def worker(monkeypatch: pytest.MonkeyPatch) -> Iterator[Start]:
    monkeypatch.setattr(
        module, "adjusted_json", lambda found, _: {"mode": "adjusted", "n": found.count}
    )
    monkeypatch.setattr(module, "linearised_json", lambda _, __: {"mode": "linearised"})
    monkeypatch.setattr(module, "REST_S", 0.05)
    running: list[AdjustmentWorkers] = []

    def start(survey: Survey) -> tuple[AdjustmentWorkers, Answers]:
        answers: Answers = []
        stand_in = cast("LiveSurvey", survey)  # has all that the workers ask for
        live = AdjustmentWorkers(
            stand_in,
            {"1.jpg": 0},
            lambda version, said: answers.append((version, said)),
            lambda _: None,
        )
        live.start()
        running.append(live)
        return live, answers

    yield start
    for live in running:
        live.stop()


def wait_for(answers: Answers, count: int) -> None:
    until = time.monotonic() + LONGEST_WAIT_S
    while len(answers) < count and time.monotonic() < until:
        time.sleep(0.005)
    assert len(answers) >= count


def wait_for_adjusted(answers: Answers, version: int) -> None:
    until = time.monotonic() + LONGEST_WAIT_S
    while (version, "adjusted") not in [(v, said["mode"]) for v, said in answers]:
        assert time.monotonic() < until, answers
        time.sleep(0.005)


def test_states_that_wait_are_passed_over_for_the_newest(worker: Start) -> None:
    survey = Survey(1.0)
    survey.go_on.clear()
    live, answers = worker(survey)
    live.submit(Task(1, state(1), final=True))
    assert survey.begun.wait(LONGEST_WAIT_S)
    for version in range(2, 10):
        live.submit(Task(version, state(version), final=True))
    survey.go_on.set()
    wait_for_adjusted(answers, 9)
    assert survey.adjusted == [1, 9]


def test_a_newer_change_ends_the_adjustment_of_an_older_state(worker: Start) -> None:
    survey = Survey(1.0, reports=True)
    survey.go_on.clear()
    live, answers = worker(survey)
    live.submit(Task(1, state(1), final=True))
    assert survey.begun.wait(LONGEST_WAIT_S)
    survey.begun.clear()
    live.submit(Task(2, state(2), final=True))
    assert survey.begun.wait(LONGEST_WAIT_S)  # of the new one, while the older could go on
    survey.go_on.set()
    wait_for_adjusted(answers, 2)
    assert survey.adjusted == [2]
    assert [version for version, _ in answers] == [2]


def test_a_drag_lets_the_adjustment_of_an_older_state_end(worker: Start) -> None:
    survey = Survey(1.0, reports=True)
    survey.go_on.clear()
    live, answers = worker(survey)
    live.submit(Task(1, state(1), final=True))
    assert survey.begun.wait(LONGEST_WAIT_S)
    live.submit(Task(2, state(2), final=False))
    time.sleep(0.05)
    survey.go_on.set()
    wait_for_adjusted(answers, 2)
    assert survey.adjusted == [1, 2]


def test_a_drag_is_linearised_where_the_full_adjustment_is_slow(worker: Start) -> None:
    survey = Survey(1.0)
    live, answers = worker(survey)
    live.submit(Task(1, state(1), final=True))
    wait_for(answers, 1)
    live.submit(Task(2, state(1), final=False))
    wait_for(answers, 2)
    assert answers[1] == (2, {"mode": "linearised"})
    wait_for(answers, 3)  # the drag rests
    assert answers[2][1]["mode"] == "adjusted"


def test_a_drag_is_adjusted_in_full_where_that_is_fast(worker: Start) -> None:
    survey = Survey(0.01)
    live, answers = worker(survey)
    live.submit(Task(1, state(1), final=True))
    wait_for(answers, 1)
    live.submit(Task(2, state(1), final=False))
    wait_for(answers, 2)
    assert answers[1][1]["mode"] == "adjusted"
    assert not survey.linearised_


def test_numbers_follow_a_drag_while_an_older_state_is_adjusted_in_full(worker: Start) -> None:
    survey = Survey(1.0)
    live, answers = worker(survey)
    live.submit(Task(1, state(1), final=True))
    wait_for(answers, 1)
    survey.go_on.clear()  # the next full adjustment takes as long as this test wants
    survey.begun.clear()
    live.submit(Task(2, state(1), final=True))
    wait_for(answers, 2)
    assert survey.begun.wait(LONGEST_WAIT_S)
    assert answers[1] == (2, {"mode": "linearised"})  # it has not ended, but it has moved
    for version in (3, 4, 5):
        live.submit(Task(version, state(1), final=False))
        wait_for(answers, version)
    assert [said["mode"] for _, said in answers[2:]] == ["linearised"] * 3
    survey.go_on.set()
    wait_for(answers, 7)
    # The older full answer is never the last word on the newer state, even for a moment.
    assert answers[5:7] == [(2, {"mode": "adjusted", "n": 1}), (5, {"mode": "linearised"})]
    wait_for_adjusted(answers, 5)


def test_what_cannot_be_adjusted_is_said_in_words(worker: Start) -> None:
    live, answers = worker(Survey(0.01))
    live.submit(Task(1, state(0), final=True))
    wait_for(answers, 1)
    assert answers[0][1]["mode"] == "none"
    assert "Nothing is picked" in answers[0][1]["why"]


def test_a_fault_of_the_program_is_told_and_the_next_state_is_adjusted(
    worker: Start, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    survey = Survey(seconds=0.0)
    adjust = survey.adjust

    def faulty(observed: Observations) -> SimpleNamespace:
        if len(observed.picks.image) == 1:
            raise ZeroDivisionError("planted")
        return adjust(observed)

    monkeypatch.setattr(survey, "adjust", faulty)
    live, answers = worker(survey)
    live.submit(Task(1, state(1), final=True))
    wait_for(answers, 1)
    live.submit(Task(2, state(2), final=True))
    wait_for_adjusted(answers, 2)

    assert answers[0][1]["mode"] == "none"
    assert "fault of the program" in answers[0][1]["why"]
    assert "planted" in caplog.text


def test_a_fault_of_the_first_order_answer_leaves_it_to_the_full_adjustment(
    worker: Start, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    survey = Survey(seconds=1.0)

    def faulty(*_: LiveAdjustment | Observations) -> SimpleNamespace:
        raise KeyError("planted")

    monkeypatch.setattr(survey, "update_linearly", faulty)
    live, answers = worker(survey)
    for version in (1, 2, 3):
        live.submit(Task(version, state(version), final=True))
        wait_for_adjusted(answers, version)

    assert {said["mode"] for _, said in answers} == {"adjusted"}
    assert "planted" in caplog.text
