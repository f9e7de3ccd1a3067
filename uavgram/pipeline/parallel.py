"""Work on all cores ahead of whoever takes the results, and only a little ahead."""

from __future__ import annotations

import os
import pickle
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from typing import Any, TypeVar

Item = TypeVar("Item")
Made = TypeVar("Made")


def prefetch(work: Callable[[Item], Made], items: Iterable[Item]) -> Iterator[tuple[Item, Made]]:
    """Results in order, with no more of them in memory than are needed to keep all cores busy.

    For work that leaves Python (decoding, warping): it is done by threads.
    """
    count = cores()
    with ThreadPoolExecutor(count) as pool:
        waiting: deque[tuple[Item, Future[Made]]] = deque()
        for item in items:
            waiting.append((item, pool.submit(work, item)))
            if len(waiting) > 2 * count:
                first, future = waiting.popleft()
                yield first, future.result()
        for first, future in waiting:
            yield first, future.result()


FEW = 4
"""Items for which starting processes does not pay."""


def in_processes(
    work: Callable[[Item], Made], items: Sequence[Item], workers: int = 0
) -> Iterator[Made]:
    """Results in order, made by so many processes (0: as there are cores); few items by this one.

    For work in Python. `work` and items are pickled; processes are started afresh, so that no lock
    of a thread is copied into them.

    Parameters
    ----------
    work, items
        What is done with each item.
    workers
        Processes; 0: as many as there are cores.
    """
    count = workers or cores()
    if count < 2 or len(items) <= FEW:
        yield from map(work, items)
        return
    # Pickled here and once: what cannot be would leave the pool waiting for ever.
    pool = ProcessPoolExecutor(
        min(count, len(items)), get_context("spawn"), _take_work, (pickle.dumps(work),)
    )
    try:
        yield from pool.map(_work_on, items)
    finally:
        pool.shutdown(cancel_futures=True)


_work: list[Callable[[Any], Any]] = []
"""In a process that was started for it: what to do with each item."""


def _take_work(pickled: bytes) -> None:
    _work[:] = [pickle.loads(pickled)]  # noqa: S301  (of the process that started this one)


def _work_on(item: object) -> Any:  # noqa: ANN401
    return _work[0](item)


_allowed: list[int] = []
"""How many cores this process was told to use, if it was."""


def use_one_core() -> None:
    """From now on use one core: this process is one of as many as there are cores."""
    _allowed[:] = [1]


def cores() -> int:
    """Cores that this process may use."""
    if _allowed:
        return _allowed[0]
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
