"""Long-lived processes: each imports once, takes one item after another, and may die alone.

Each is a pool of Python's own with one process: if one dies, the others are not affected.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import partial
from multiprocessing import active_children, get_context, parent_process, resource_tracker
from multiprocessing.context import BaseContext
from typing import Any, Generic, TypeVar, cast

from uavgram.errors import UavgramError
from uavgram.pipeline.process_settings import avoid_modules, collect_garbage_rarely, use_one_core

if sys.platform != "win32":
    import resource

Item = TypeVar("Item")
Made = TypeVar("Made")

MAX_TRIES = 3
"""Number of tries of an item whose process dies; after these the item is the likelier reason."""

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
"""Environment variables that libraries read when they are loaded: there are as many workers as
cores."""
_RECYCLED_AT = 0.5
"""Share of the memory limit of a worker: one that keeps more than this is replaced."""
_TIMEOUT_S = 5.0


@dataclass(frozen=True)
class ItemOutcome(Generic[Made]):
    """Outcome of an item.

    Attributes
    ----------
    number
        Number of the item.
    value
        Its result; None if there is none.
    tries
        Number of workers that began it.
    why
        Reason for a missing value, for people.
    fault
        Exception that the work itself raised, if any.
    """

    number: int
    value: Made | None
    tries: int
    why: str = ""
    fault: Exception | None = None


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """Limits of one worker: memory at any time, and seconds for one item; None: no limit."""

    memory_bytes: int | None = None
    seconds: float | None = None


class _Worker:
    """Pool of one process: the number of its present item, the start time, and the outcome."""

    def __init__(self, context: BaseContext, bounds: Bounds) -> None:
        self._seconds = bounds.seconds
        self.pool = ProcessPoolExecutor(
            1, context, initializer=_prepare_process, initargs=(bounds.memory_bytes,)
        )
        with _STARTING, _block_ctrl_c():
            others = set(active_children())
            self.pool.submit(os.getpid)  # the process starts with the first call
            self.process = (set(active_children()) - others).pop()
        self.number, self.since = 0, 0.0
        self.future: Future[tuple[Any, Exception | None, bool]] | None = None
        self.timer: threading.Timer | None = None

    def give(self, work: Callable[[Any], Any], number: int, item: object) -> None:
        self.number, self.since = number, time.monotonic()
        try:
            self.future = self.pool.submit(work, item)
        except BrokenProcessPool as fault:  # it died while it waited
            self.future = Future()
            self.future.set_exception(fault)
        if self._seconds is not None:
            self.timer = threading.Timer(self._seconds, _end_all, ([self],))
            self.timer.daemon = True
            self.timer.start()

    def take(self, tries: int) -> tuple[ItemOutcome[Any] | None, bool]:
        """Return the outcome, None for another try; and whether the process has to leave."""
        future, self.future = cast("Future[Any]", self.future), None
        if self.timer is not None:
            self.timer.cancel()
        if not isinstance(future.exception(), BrokenProcessPool | SystemExit):
            value, fault, leaves = future.result()
            why = "" if fault is None else describe_exception(fault)
            return ItemOutcome(self.number, value, tries, why, fault), leaves
        if self._seconds is not None and time.monotonic() - self.since >= self._seconds:
            return ItemOutcome(self.number, None, tries, describe_timeout(self._seconds)), True
        if tries < MAX_TRIES:
            return None, True
        self.pool.shutdown()
        return ItemOutcome(
            self.number, None, tries, _describe_failure(tries, self.process.exitcode)
        ), True

    def end(self) -> None:
        if self.timer is not None:
            self.timer.cancel()
        if self.process.is_alive():
            self.process.terminate()
        self.pool.shutdown(wait=False)


_STARTING = threading.Lock()
"""Lock while a process starts, so that it can be distinguished from those of other threads."""


def run_in_workers(
    work: Callable[[Item], Made],
    items: Sequence[Item],
    count: int,
    bounds: Bounds | None = None,
) -> Iterator[ItemOutcome[Made]]:
    """Yield the result of each item as soon as it is ready, in any order.

    An item whose process dies is tried again, in another one; one that takes too long is given up,
    and its process ended. When the caller leaves, as at Ctrl+C, all processes end.

    Parameters
    ----------
    work
        A function at the top of a module, or a `functools.partial` of one.
    items
        Pickled to the processes.
    count
        Number of processes.
    bounds
        Limits of each process; one that keeps half of its memory between items is replaced.
    """
    bounds = bounds or Bounds()
    tries, waiting = [0] * len(items), deque(range(len(items)))
    with _one_thread_each():
        context = _context(getattr(work, "func", work).__module__)
        start = partial(_Worker, context, bounds)
        made = partial(_run_item, work, bounds.memory_bytes)
        workers = [start() for _ in range(min(count, len(items)))]
        try:
            while True:
                for worker in workers:
                    if worker.future is None and waiting:
                        number = waiting.popleft()
                        tries[number] += 1
                        worker.give(made, number, items[number])
                busy = {one.future: k for k, one in enumerate(workers) if one.future is not None}
                if not busy:
                    return
                for k in [busy[future] for future in wait(busy, None, FIRST_COMPLETED).done]:
                    number = workers[k].number
                    one, leaves = workers[k].take(tries[number])
                    if leaves:
                        workers[k].end()
                        workers[k] = start()
                    if one is None:
                        waiting.append(number)
                    else:
                        yield one
        finally:
            _end_all(workers)


def _end_all(workers: Sequence[_Worker]) -> None:
    """End processes: first so that they can clean up, finally by force."""
    for worker in workers:
        worker.end()
    for worker in workers:
        worker.process.join(_TIMEOUT_S)
        if worker.process.is_alive():
            worker.process.kill()
            worker.process.join()


def describe_exception(fault: BaseException) -> str:
    """Describe an exception in words; bugs with their kind."""
    return str(fault) if isinstance(fault, UavgramError) else f"{type(fault).__name__}: {fault}"


def describe_timeout(seconds: float) -> str:
    """Describe why an item was given up that took too long."""
    return (
        f"was given up after {seconds / 60.0:.3g} minutes: where it needs longer, give it more "
        "time (--most-minutes), or run it alone (uavgram run)"
    )


def _describe_failure(tries: int, status: int | None) -> str:
    how = f"ended with status {status}"
    if status is not None and status < 0:
        with contextlib.suppress(ValueError):
            how = f"was ended by {signal.Signals(-status).name}"
    return (
        f"its process {how}, {tries} times: the machine may lack memory for it; run it alone "
        "(uavgram run), or the batch with fewer workers (--workers 1)"
    )


def _context(module: str) -> BaseContext:
    """Return a context that forks processes from a clean one with a module, where available."""
    if sys.platform != "linux":
        return get_context("spawn")
    context = get_context("forkserver")
    context.set_forkserver_preload([module])
    return context


@contextlib.contextmanager
def _one_thread_each() -> Iterator[None]:
    """Set one thread for processes that are started now, before they load anything."""
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
def _block_ctrl_c() -> Iterator[None]:
    """Block Ctrl+C in processes that are started now, as it is meant for their parent.

    Also while they load modules, when they could not ignore it yet.
    """
    if sys.platform == "win32":
        yield
        return
    resource_tracker.ensure_running()  # its start would unblock the signal
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _prepare_process(memory_bytes: int | None) -> None:  # pragma: no cover (in another process)
    """Prepare a process; Ctrl+C is for its parent, with which it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # where it is not blocked already
    threading.Thread(target=_end_with_parent, daemon=True).start()
    use_one_core()
    avoid_modules()
    collect_garbage_rarely()
    _limit_memory(memory_bytes)


def _end_with_parent() -> None:  # pragma: no cover (in another process)
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _run_item(
    work: Callable[[Any], Any], memory_bytes: int | None, item: object
) -> tuple[Any, Exception | None, bool]:  # pragma: no cover (in another process)
    """Return the result or exception of an item, and whether the process keeps too much memory."""
    made, fault = None, None
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # half-written folders are removed
    try:
        made = work(item)
    except Exception as raised:  # noqa: BLE001 (the caller gets it)
        fault = _make_picklable(raised)
    finally:  # an interrupted answer would block the parent
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
    return made, fault, memory_bytes is not None and _resident_bytes() > _RECYCLED_AT * memory_bytes


def _make_picklable(fault: Exception) -> Exception:  # pragma: no cover (in another process)
    """Return the exception, or its text where it cannot be pickled."""
    try:
        pickle.loads(pickle.dumps(fault))  # noqa: S301  (of our own making)
    except Exception:  # noqa: BLE001  (a class may fail in any way)
        return (
            UavgramError(str(fault))
            if isinstance(fault, UavgramError)
            else RuntimeError(repr(fault))
        )
    return fault


def _limit_memory(memory_bytes: int | None) -> None:
    """Limit the memory by the system: one survey fails, not the machine."""
    if memory_bytes is None or sys.platform != "linux":
        return
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    bound = memory_bytes if hard == resource.RLIM_INFINITY else min(memory_bytes, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (bound, hard))


def _resident_bytes() -> int:
    """Return the memory that this process holds now; 0 where the system does not state it."""
    try:
        with open("/proc/self/statm", encoding="ascii") as stream:  # noqa: PTH123
            resident, shared = map(int, stream.read().split()[1:3])
    except OSError:
        return 0
    return (resident - shared) * os.sysconf("SC_PAGE_SIZE")
