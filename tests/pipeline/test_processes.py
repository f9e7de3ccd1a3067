"""Processes that stay: nothing is lost when one dies, and none of them outlives the batch."""

import os
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from executor_work import (
    die,
    die_once,
    hold,
    misread,
    need,
    sleep_or_square,
    squared,
    stop_or_square,
    threads,
)

from uavgram.pipeline import processes
from uavgram.pipeline.processes import MAX_TRIES, Bounds, run_in_workers

MB = 1 << 20


def test_each_item_is_made_once() -> None:
    ended = list(run_in_workers(squared, range(20), 2))

    assert sorted((one.number, one.value, one.tries) for one in ended) == [
        (k, k * k, 1) for k in range(20)
    ]


def test_an_item_whose_worker_dies_is_made_by_another(tmp_path: Path) -> None:
    names = ["a", "dies-once", "b", "dies-too", "c"]
    ended = {
        one.value: one.tries
        for one in run_in_workers(die_once, [str(tmp_path / n) for n in names], 2)
    }

    assert ended == {"a": 1, "dies-once": 2, "b": 1, "dies-too": 2, "c": 1}


def test_an_item_that_kills_every_worker_is_given_up_and_the_others_are_not() -> None:
    ended = {one.number: one for one in run_in_workers(die, ["a", "poison", "b", "c"], 2)}

    assert [ended[k].value for k in (0, 2, 3)] == ["a", "b", "c"]
    assert (ended[1].value, ended[1].tries) == (None, MAX_TRIES)
    assert "SIGKILL" in ended[1].why


def test_an_item_that_never_ends_is_given_up_and_the_others_are_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(processes, "_TIMEOUT_S", 0.2)
    items: list[int | str] = [str(tmp_path / "sleeper"), 2, 3]

    ended = {
        one.number: one for one in run_in_workers(stop_or_square, items, 1, Bounds(seconds=6.0))
    }

    assert [ended[k].value for k in (1, 2)] == [4, 9]
    assert (ended[0].value, ended[0].tries) == (None, 1)
    assert "0.1 minutes" in ended[0].why
    assert "--most-minutes" in ended[0].why
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "sleeper").read_text()), 0)


def test_what_the_work_raises_is_told_and_costs_no_worker() -> None:
    ended = {one.number: one for one in run_in_workers(misread, [2, 3, 4], 1)}

    assert [ended[k].value for k in (0, 2)] == [2, 4]
    assert (ended[1].why, ended[1].tries) == ("picks.csv:7: is wrong", 1)


def test_a_worker_that_keeps_much_memory_is_replaced() -> None:
    large = [
        one.value for one in run_in_workers(hold, [200, 200, 200], 1, Bounds(memory_bytes=300 * MB))
    ]
    small = [one.value for one in run_in_workers(hold, [1, 1, 1], 1, Bounds(memory_bytes=300 * MB))]

    assert len(set(large)) == 3
    assert len(set(small)) == 1


def test_a_worker_cannot_take_more_memory_than_it_may() -> None:
    ended = {
        one.number: one.value
        for one in run_in_workers(need, [10, 3000], 1, Bounds(memory_bytes=1000 * MB))
    }

    assert ended == {0: "granted", 1: "refused"}


def test_workers_use_one_thread_and_one_core_each(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "7")

    assert [one.value for one in run_in_workers(threads, [0], 1)] == [("1", 1)]
    assert os.environ["OPENBLAS_NUM_THREADS"] == "7"


def test_when_the_caller_leaves_the_workers_clean_up_and_end(tmp_path: Path) -> None:
    marker = tmp_path / "sleeper"

    items: list[int | str] = [2, str(marker)]

    def leave_after_the_first() -> None:
        for one in run_in_workers(sleep_or_square, items, 2):
            assert one.value == 4
            wait_for(lambda: marker.exists() and marker.read_text() != "")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        leave_after_the_first()

    assert marker.with_suffix(".ended").exists()
    with pytest.raises(ProcessLookupError):
        os.kill(int(marker.read_text()), 0)


def wait_for(condition: Callable[[], bool]) -> None:
    for _ in range(1000):
        if condition():
            return
        time.sleep(0.02)
    raise AssertionError
