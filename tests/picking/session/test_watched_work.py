"""Long work is shown by its stages, and stops where a person wants it to."""

from __future__ import annotations

import time
from typing import cast

import pytest

from uavgram.errors import UavgramError
from uavgram.model.work import report_work
from uavgram.picking.document.commands import RefusedError
from uavgram.picking.protocol import messages as m
from uavgram.picking.session.workers import WatchedWork


@pytest.fixture
def told() -> list[str]:
    return []


def watched(told: list[str], hidden_s: float) -> WatchedWork:
    def broadcast(message: m.ServerMessage) -> None:
        told.append(cast("m.WorkStage", message)["stage"])

    return WatchedWork("adjustment", broadcast, hidden_s)


def work() -> int:
    report_work("begin")
    for k in range(20):
        report_work(f"photo: {k} of 20")
        time.sleep(0.02)
    report_work("end")
    return 7


def test_stages_are_told_and_of_a_loop_only_some(told: list[str]) -> None:
    assert watched(told, 0.0).run(work) == 7
    assert (told[0], told[-2:]) == ("begin", ["end", ""])
    assert 1 <= len(told) - 3 < 5


def test_short_work_is_not_shown_and_the_present_stage_of_longer_one_is(told: list[str]) -> None:
    assert watched(told, 60.0).run(work) == 7
    assert told == []

    def long() -> None:
        report_work("begin")
        for _ in range(20):
            time.sleep(0.01)
            report_work()

    watched(told, 0.1).run(long)
    assert told == ["begin", ""]


def test_stopped_work_ends_whatever_it_would_go_on_without(told: list[str]) -> None:
    stopped = watched(told, 0.0)

    def stubborn() -> None:
        report_work("begin")
        stopped.stop()
        try:
            report_work()
        except UavgramError:  # as a stage that goes on without a part that fails
            report_work("more")

    with pytest.raises(RefusedError, match="You stopped the computation"):
        stopped.run(stubborn)
    assert told == ["begin", ""]
    assert stopped.run(work) == 7  # the next one goes on
