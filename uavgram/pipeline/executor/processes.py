"""Processes that stay: each imports once, takes one item after another, and may die alone.

Python's own pool gives up all work when one of its processes dies, and never looks at their memory.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing import get_context, resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import BaseContext
from multiprocessing.process import BaseProcess
from typing import Any, Generic, TypeVar

from uavgram.errors import UavgramError
from uavgram.pipeline.cores import use_one_core
from uavgram.pipeline.own_process import load_little, seldom_look_for_cycles

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
    """What became of an item.

    Attributes
    ----------
    number
        Of the item.
    value
        What was made of it; None if nothing was.
    tries
        How many workers began it.
    why
        For people: why there is no value.
    fault
        What the work itself raised, if it did.
    """

    number: int
    value: Made | None
    tries: int
    why: str = ""
    fault: Exception | None = None


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """What one worker may take: memory at any time, and seconds for one item; None: no bound."""

    memory_bytes: int | None = None
    seconds: float | None = None


class _Worker:
    """A process, the pipe to it, the number of the item that it is at, and since when."""

    def __init__(
        self, context: BaseContext, work: Callable[[Any], Any], memory_bytes: int | None
    ) -> None:
        self.pipe, theirs = context.Pipe()
        self.item: int | None = None
        self.since = 0.0
        self.process: BaseProcess = context.Process(  # type: ignore[attr-defined]
            target=_serve, args=(theirs, work, memory_bytes), daemon=True
        )
        with _kept_from_ctrl_c():
            self.process.start()
        theirs.close()

    def give(self, number: int, item: object) -> None:
        self.item, self.since = number, time.monotonic()
        with contextlib.suppress(OSError):  # it died: whoever waits for it sees that
            self.pipe.send(item)

    def take(self) -> tuple[Any, Exception | None, bool]:
        """What was made or raised, and whether the process leaves now. EOFError if it died."""
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
    bounds: Bounds | None = None,
) -> Iterator[Ended[Made]]:
    """What is made of each item, as soon as it is; in whatever order that is.

    An item whose process dies is tried again, in another one; one that takes too long is given up,
    and its process ended. When the caller leaves, at Ctrl+C say, all processes end.

    Parameters
    ----------
    work
        A function at the top of a module, or a `functools.partial` of one.
    items
        Pickled to the processes.
    count
        Of processes.
    bounds
        What each process may take; one that keeps half of its memory between items is replaced.
    """
    bounds = bounds or Bounds()
    with _one_thread_each():
        context = _context(getattr(work, "func", work).__module__)
        pool = _Pool(items, lambda: _Worker(context, work, bounds.memory_bytes), count, bounds)
        try:
            yield from pool.ended()
        finally:
            _end_all(pool.workers)


class _Pool(Generic[Item]):
    """Who is at what, what is still to do, and how often it was tried."""

    def __init__(
        self, items: Sequence[Item], start: Callable[[], _Worker], count: int, bounds: Bounds
    ) -> None:
        self._items, self._start, self._seconds = items, start, bounds.seconds
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
            for pipe in wait([one.pipe for one in busy.values()], self._patience(busy.values())):
                yield from self._taken(busy[id(pipe)])
            yield from self._overdue()

    def _patience(self, busy: Iterable[_Worker]) -> float | None:
        """Seconds until the first of them has taken too long."""
        if self._seconds is None:
            return None
        return max(min(one.since for one in busy) + self._seconds - time.monotonic(), 0.0)

    def _overdue(self) -> Iterator[Ended[Any]]:
        """Items that take too long, and would every time: their processes are ended."""
        if self._seconds is None:
            return
        for worker in self.workers[:]:
            number = worker.item
            if number is None or time.monotonic() - worker.since < self._seconds:
                continue
            _end_all([worker])
            self._replace(worker)
            yield Ended(number, None, self._tries[number], overdue(self._seconds))

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
            value, fault, leaves = worker.take()
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
        why = "" if fault is None else in_words(fault)
        yield Ended(number, value, tries, why, fault)

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


def in_words(fault: BaseException) -> str:
    """What was raised, in words; bugs with their kind."""
    return str(fault) if isinstance(fault, UavgramError) else f"{type(fault).__name__}: {fault}"


def overdue(seconds: float) -> str:
    """Why an item was given up that took too long."""
    return (
        f"was given up after {seconds / 60.0:.3g} minutes: where it needs longer, give it more "
        "time (--most-minutes), or run it alone (uavgram run)"
    )


def _why(tries: int, status: int | None) -> str:
    how = f"ended with status {status}"
    if status is not None and status < 0:
        with contextlib.suppress(ValueError):
            how = f"was ended by {signal.Signals(-status).name}"
    return (
        f"its process {how}, {tries} times: the machine may lack memory for it; run it alone "
        "(uavgram run), or the batch with fewer workers (--workers 1)"
    )


def _context(module: str) -> BaseContext:
    """Processes forked from a clean one that imported a module, where the system has that."""
    if sys.platform != "linux":
        return get_context("spawn")
    context = get_context("forkserver")
    context.set_forkserver_preload([module])
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


@contextlib.contextmanager
def _kept_from_ctrl_c() -> Iterator[None]:
    """Processes that are started now never get Ctrl+C, which is for who started them.

    Not even while they load what they need, when they could not ignore it yet.
    """
    if sys.platform == "win32":
        yield
        return
    resource_tracker.ensure_running()  # when it starts, it lets through what is kept back here
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _serve(
    pipe: Connection, work: Callable[[Any], Any], memory_bytes: int | None
) -> None:  # pragma: no cover (in another process)
    """Take items until nobody gives any; Ctrl+C is for who started this process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # where it is not kept back already
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
        made, fault = None, None
        try:
            made = work(item)
        except Exception as raised:  # noqa: BLE001 (whoever asked for it hears of it)
            fault = _sendable(raised)
        leaves = memory_bytes is not None and _kept_bytes() > _RECYCLED_AT * memory_bytes
        try:
            pipe.send((made, fault, leaves))
        except OSError:  # who asked is gone
            return
        if leaves:
            return


def _sendable(fault: Exception) -> Exception:  # pragma: no cover (in another process)
    """What was raised, or its text where it cannot be sent."""
    try:
        pickle.loads(pickle.dumps(fault))  # noqa: S301  (of our own making)
    except Exception:  # noqa: BLE001  (whatever its class does when it is put together again)
        return (
            UavgramError(str(fault))
            if isinstance(fault, UavgramError)
            else RuntimeError(repr(fault))
        )
    return fault


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
