"""Work ahead of whoever takes the results."""

from __future__ import annotations

import os
import threading
from collections.abc import Generator
from typing import Never

import pytest

from uavgram.pipeline.parallel import prefetch


def test_results_come_in_order_with_their_items() -> None:
    made = list(prefetch(lambda n: n * n, range(50)))

    assert made == [(n, n * n) for n in range(50)]


def test_it_runs_only_a_little_ahead() -> None:
    begun: list[int] = []
    lock = threading.Lock()

    def work(item: int) -> int:
        with lock:
            begun.append(item)
        return item

    coming = prefetch(work, range(1000))
    assert isinstance(coming, Generator)
    for _ in range(5):
        next(coming)
    coming.close()

    assert len(begun) <= 5 + 2 * (os.cpu_count() or 1) + 1


def test_a_failure_reaches_whoever_takes_the_result() -> None:
    def fail(item: int) -> Never:
        raise ValueError(item)

    with pytest.raises(ValueError, match="3"):
        list(prefetch(fail, [3]))
