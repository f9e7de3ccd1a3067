"""Processes that stay: each imports once, takes one item after another, and may die alone.

Python's own pool gives up all work when one of its processes dies, and never looks at their memory.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.context import BaseContext
from multiprocessing.process import BaseProcess
from typing import Any, Generic, TypeVar

from uavgram.pipeline.own_process import load_little, seldom_look_for_cycles
from uavgram.pipeline.parallel import use_one_core

if sys.platform != "win32":
    import resource

Item = TypeVar("Item")
Made = TypeVar("Made")

MOST_TRIES = 3
"""Of an item whose process dies; by then the item is the likelier reason."""

_ONE_THREAD = dict.fromkeys(
    (
        "OPENBLAS_NUM_THREADS",
        "OMP_NUM_THREADS",
        "MKL_NUM_THREADS",
        "RAYON_NUM_THREADS",
        "OPENCV_FOR_THREADS_NUM",
    ),
    "1",
)
"""Libraries read these when they are loaded: there are as many workers as cores."""
_RECYCLED_AT = 0.5
"""Of the memory that a worker may take: one that keeps more than this is replaced."""
_PATIENCE_S = 5.0


@dataclass(frozen=True)
class Ended(Generic[Made]):
    """An item's number, what was made of it, and the tries; None, and why, if they all failed."""

    number: int
    value: Made | None
    tries: int
    why: str = ""


class _Worker:
    """A process, the pipe to it, and the number of the item that it is at."""

    def __init__(
        self, context: BaseContext, work: Callable[[Any], Any], memory_bytes: int | None
    ) -> None:
        self.pipe, theirs = context.Pipe()
        self.item: int | None = None
        self.process: BaseProcess = context.Process(  # type: ignore[attr-defined]
            target=_serve, args=(theirs, work, memory_bytes), daemon=True
        )
        self.process.start()
        theirs.close()

    def give(self, number: int, item: object) -> None:
        self.item = number
        with contextlib.suppress(OSError):  # it died: whoever waits for it sees that
            self.pipe.send(item)

    def take(self) -> tuple[Any, bool]:
        """What was made, and whether the process is about to leave. Raises EOFError if it died."""
        try:
            return self.pipe.recv()  # type: ignore[no-any-return]
        except OSError as fault:
            raise EOFError from fault

    def end(self) -> None:
        with contextlib.suppress(OSError):
            self.pipe.close()
        if self.process.is_alive():
            self.process.terminate()


def in_workers(
    work: Callable[[Item], Made],
    items: Sequence[Item],
    count: int,
    memory_bytes: int | None = None,
    preload: Sequence[str] = (),
) -> Iterator[Ended[Made]]:
    """What is made of each item, as soon as it is; in whatever order that is.

    An item whose process dies is tried again, in another one. When the caller leaves, at Ctrl+C
    say, all processes end.

    Parameters
    ----------
    work
        A function at the top of a module.
    items
        Pickled to the processes.
    count
        Of processes.
    memory_bytes
        Most that one process may take; one that keeps half of it between items is replaced.
    preload
        Modules to import once for all processes, where the system can fork from a clean one.
    """
    with _one_thread_each():
        context = _context(preload)
        pool = _Pool(items, lambda: _Worker(context, work, memory_bytes), count)
        try:
            yield from pool.ended()
        finally:
            _end_all(pool.workers)


class _Pool(Generic[Item]):
    """Who is at what, what is still to do, and how often it was tried."""

    def __init__(self, items: Sequence[Item], start: Callable[[], _Worker], count: int) -> None:
        self._items, self._start = items, start
        self._waiting = deque(range(len(items)))
        self._tries = [0] * len(items)
        self.workers = [start() for _ in range(min(count, len(items)))]

    def ended(self) -> Iterator[Ended[Any]]:
        """Outcomes until nothing is left to do."""
        while True:
            self._give()
            busy = {id(one.pipe): one for one in self.workers if one.item is not None}
            if not busy:
                return
            for pipe in wait([one.pipe for one in busy.values()]):
                yield from self._taken(busy[id(pipe)])

    def _give(self) -> None:
        for worker in self.workers:
            if worker.item is None and self._waiting:
                number = self._waiting.popleft()
                self._tries[number] += 1
                worker.give(number, self._items[number])

    def _taken(self, worker: _Worker) -> Iterator[Ended[Any]]:
        """What a worker made; nothing where it died and its item is tried again."""
        number = 0 if worker.item is None else worker.item
        tries = self._tries[number]
        try:
            value, leaves = worker.take()
        except EOFError:
            worker.process.join()
            self._replace(worker)
            if tries < MOST_TRIES:
                self._waiting.append(number)
            else:
                yield Ended(number, None, tries, _why(tries, worker.process.exitcode))
            return
        worker.item = None
        if leaves:
            self._replace(worker)
        yield Ended(number, value, tries)

    def _replace(self, worker: _Worker) -> None:
        worker.end()
        self.workers[self.workers.index(worker)] = self._start()


def _end_all(workers: Sequence[_Worker]) -> None:
    """End processes: first so that they can clean up, in the end without asking."""
    for worker in workers:
        worker.end()
    for worker in workers:
        worker.process.join(_PATIENCE_S)
        if worker.process.is_alive():
            worker.process.kill()
            worker.process.join()


def _why(tries: int, status: int | None) -> str:
    how = f"ended with status {status}"
    if status is not None and status < 0:
        with contextlib.suppress(ValueError):
            how = f"was ended by {signal.Signals(-status).name}"
    return (
        f"its process {how}, {tries} times: the machine may lack memory for it; run it alone "
        "(uavgram run), or the batch with fewer workers (--workers 1)"
    )


def _context(preload: Sequence[str]) -> BaseContext:
    """Processes forked from a clean one where the system has that, else started afresh."""
    if sys.platform != "linux":
        return get_context("spawn")
    context = get_context("forkserver")
    context.set_forkserver_preload(list(preload))
    return context


@contextlib.contextmanager
def _one_thread_each() -> Iterator[None]:
    """Processes that are started now read these settings before they load anything."""
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(_ONE_THREAD)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _serve(
    pipe: Connection, work: Callable[[Any], Any], memory_bytes: int | None
) -> None:  # pragma: no cover (in another process)
    """Take items until nobody gives any; Ctrl+C is for who started this process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # half-written folders are removed
    use_one_core()
    load_little()
    seldom_look_for_cycles()
    _bound(memory_bytes)
    while True:
        try:
            item = pipe.recv()
        except (EOFError, OSError):
            return
        made = work(item)
        leaves = memory_bytes is not None and _kept_bytes() > _RECYCLED_AT * memory_bytes
        try:
            pipe.send((made, leaves))
        except OSError:  # who asked is gone
            return
        if leaves:
            return


def _bound(memory_bytes: int | None) -> None:
    """Let the system refuse memory beyond the bound: one survey fails, not the machine."""
    if memory_bytes is None or sys.platform != "linux":
        return
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    bound = memory_bytes if hard == resource.RLIM_INFINITY else min(memory_bytes, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (bound, hard))


def _kept_bytes() -> int:
    """Memory that this process holds now; 0 where the system does not say."""
    try:
        with open("/proc/self/statm", encoding="ascii") as stream:  # noqa: PTH123
            resident, shared = map(int, stream.read().split()[1:3])
    except OSError:
        return 0
    return (resident - shared) * os.sysconf("SC_PAGE_SIZE")
