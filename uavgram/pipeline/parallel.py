"""Parallel work on all cores, only a little ahead of the consumer, and progress of long loops."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, Protocol, TypeVar

from uavgram.errors import UavgramError
from uavgram.model.work import report_work
from uavgram.pipeline.process_settings import cores


class Progress(Protocol):
    """Function that passes on `items`; `what` names the work, `total` counts it."""

    def __call__(self, items: Iterable[Item], what: str, total: int, /) -> Iterable[Item]:
        """Yield items, one by one, as they are taken."""


def silent(items: Iterable[Item], what: str, total: int, /) -> Iterable[Item]:
    """Pass on the items and show nothing; a watcher of this thread learns of each.

    Parameters
    ----------
    items
        Any items.
    what
        Name of the work.
    total
        Number of items.
    """
    for k, item in enumerate(items):
        report_work(f"{what}: {k + 1} of {total}")
        yield item


Item = TypeVar("Item")
Made = TypeVar("Made")


def prefetch(work: Callable[[Item], Made], items: Iterable[Item]) -> Iterator[tuple[Item, Made]]:
    """Yield results in order, with only as many in memory as keep all cores busy.

    For work outside Python (decoding, warping): it is done by threads.
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


FEW_ITEMS = 4
"""Number of items up to which processes do not pay."""


def run_in_processes(
    work: Callable[[Item], Made], items: Sequence[Item], workers: int = 0
) -> Iterator[Made]:
    """Yield results in order, computed by processes; few items by this one.

    For work in Python. `work` and items are pickled.

    Parameters
    ----------
    work, items
        Function, and its arguments.
    workers
        Processes; 0: as many as there are cores.

    Raises
    ------
    UavgramError
        An item ended each process that tried it.
    """
    count = workers or cores()
    if count < 2 or len(items) <= FEW_ITEMS:
        yield from map(work, items)
        return
    from uavgram.pipeline.processes import run_in_workers  # noqa: PLC0415 - slow to load

    early: dict[int, Any] = {}
    due = 0
    for one in run_in_workers(work, items, count):
        if one.fault is not None:
            raise one.fault
        if one.why:
            raise UavgramError(f"item {one.number + 1} of {len(items)}: {one.why}")
        early[one.number] = one.value
        while due in early:
            yield early.pop(due)
            due += 1
