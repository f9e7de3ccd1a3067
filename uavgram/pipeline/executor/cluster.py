"""Work by a cluster: a Dask scheduler and its workers, started by others.

Dask gives the work of a worker that died to another one. Of a worker that is cut off, or stopped,
it hears no more and waits: for five minutes, or for ever, as its scheduler is configured. So each
worker is given here as many items as it has threads, and whoever is not heard of loses them.
"""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from uavgram.errors import UavgramError
from uavgram.pipeline.cores import use_one_core
from uavgram.pipeline.executor.processes import MOST_TRIES, Ended, overdue
from uavgram.pipeline.executor.roll import Roll

Item = TypeVar("Item")
Made = TypeVar("Made")

_PATIENCE_S = 15
SILENT_S = 60.0
"""A worker that works hard is late with its signs of life by a second or two."""
_ALONE_S = 300.0
"""Without any worker: time to start one."""
_LOOK_S = 1.0


@dataclass(frozen=True, kw_only=True)
class Cluster:
    """Where the scheduler listens (``tls://host:8786``), and files for TLS (PEM) if it wants them.

    Who may speak to a scheduler may run any program on its workers: it executes what it is sent.
    """

    address: str
    tls_ca_file: str | None = None
    tls_cert: str | None = None
    tls_key: str | None = None


@dataclass(frozen=True)
class _Given:
    number: int
    worker: str
    since: float


def on_cluster(
    work: Callable[[Item], Made],
    items: Sequence[Item],
    cluster: Cluster,
    seconds: float | None = None,
    fresh: Callable[[Item], Item] = lambda item: item,
) -> Iterator[Ended[Made]]:
    """What is made of each item, as soon as it is, like `in_workers`; paths mean the same there.

    Parameters
    ----------
    work
        A function at the top of a module, which the workers have too.
    items
        Pickled to the workers.
    cluster
        Whose workers.
    seconds
        Most that an item may take: the process of its worker ends then (a nanny starts another).
    fresh
        Makes of an item what is sent, each time that it is.

    Raises
    ------
    UavgramError
        Dask is not installed, or the scheduler does not answer, has lost all workers, or went away.
    """
    try:
        import distributed  # noqa: PLC0415 (an extra)
    except ImportError as fault:
        raise UavgramError(
            "--scheduler needs Dask, which is not installed: pip install 'uavgram[cluster]', here "
            "and on every worker"
        ) from fault
    try:
        client = distributed.Client(
            cluster.address, timeout=_PATIENCE_S, security=_security(cluster), set_as_default=False
        )
    except (OSError, TimeoutError, TypeError, ValueError) as fault:
        raise UavgramError(
            f"the scheduler at {cluster.address} does not answer ({fault}): start it "
            "(dask scheduler) and its workers (dask worker --nthreads 1), and name the address "
            "that it prints; with tls:// also --tls-ca-file, --tls-cert and --tls-key"
        ) from fault
    with client:
        yield from _Dispatch(client, work, items, seconds, fresh).ended()


class _Dispatch(Generic[Item]):
    """Which worker is at what, what is still to do, and how often it was tried."""

    def __init__(
        self,
        client: Any,  # noqa: ANN401 (Dask ships no types)
        work: Callable[[Item], Any],
        items: Sequence[Item],
        seconds: float | None,
        fresh: Callable[[Item], Item],
    ) -> None:
        self._client, self._work, self._items = client, work, items
        self._seconds, self._fresh = seconds, fresh
        self._waiting = deque(range(len(items)))
        self._tries = [0] * len(items)
        self._given: dict[Any, _Given] = {}
        self._unfit: set[str] = set()
        self._roll = Roll(SILENT_S)
        self._looked = self._answered = self._manned = time.monotonic()

    def ended(self) -> Iterator[Ended[Any]]:
        """Outcomes until nothing is left to do."""
        try:
            self._look()
            while self._waiting or self._given:
                self._give()
                for future in self._done():
                    yield from self._taken(future)
                if time.monotonic() - self._looked > _LOOK_S:
                    self._look()
                    yield from self._lost()
        finally:
            self._withdraw(list(self._given))

    def _look(self) -> None:
        """Who is there, as the scheduler says."""
        self._looked = time.monotonic()
        with contextlib.suppress(OSError, TimeoutError):
            found = self._client.sync(
                self._client.scheduler.identity, n_workers=-1, callback_timeout=_PATIENCE_S
            )
            self._answered = time.monotonic()
            self._roll.call(found["workers"], self._answered)
        now = time.monotonic()
        if self._roll.heard(now):
            self._manned = now
        if self._client.status == "closed" or now - self._answered > SILENT_S:
            raise UavgramError(
                "the scheduler went away in the midst of the work: start it again, and the same "
                "command goes on"
            )
        if now - self._manned > _ALONE_S:
            raise UavgramError(
                f"the scheduler has heard of no worker for {_ALONE_S / 60.0:.0f} minutes: start "
                "some (dask worker --nthreads 1), and the same command goes on"
            )

    def _give(self) -> None:
        """As many items to each worker as it has threads: what waits there is lost with it."""
        threads = self._roll.heard(time.monotonic())
        for one in self._given.values():
            threads[one.worker] = threads.get(one.worker, 0) - 1
        fit = {worker: free for worker, free in threads.items() if worker not in self._unfit}
        free = [worker for worker, count in (fit or threads).items() for _ in range(count)]
        for worker in free[: len(self._waiting)]:
            number = self._waiting.popleft()
            self._tries[number] += 1
            future = self._client.submit(
                _alone,
                self._work,
                self._fresh(self._items[number]),
                self._seconds,
                pure=False,
                workers=[worker],
                allow_other_workers=False,
            )
            self._given[future] = _Given(number, worker, time.monotonic())

    def _done(self) -> list[Any]:
        import distributed  # noqa: PLC0415

        if not self._given:
            time.sleep(_LOOK_S)
            return []
        with contextlib.suppress(TimeoutError), self._client.as_current():
            distributed.wait(list(self._given), timeout=_LOOK_S, return_when="FIRST_COMPLETED")
        return [future for future in self._given if future.done()]

    def _taken(self, future: Any) -> Iterator[Ended[Any]]:  # noqa: ANN401
        """What a worker made; nothing where it failed and its item is tried again."""
        import distributed  # noqa: PLC0415

        given = self._given.pop(future)
        if future.status == "finished":
            try:
                value = future.result(timeout=SILENT_S)
            except Exception as fault:  # noqa: BLE001 (it was made, and lost on its way)
                yield from self._again(given, _lost_words(fault))
            else:
                yield Ended(given.number, value, self._tries[given.number])
        else:
            raised = future.exception() if future.status == "error" else None
            is_lost = raised is None or isinstance(raised, distributed.KilledWorker)
            if not is_lost:
                self._unfit.add(given.worker)
            yield from self._again(given, _lost_words() if is_lost else _unfit_words(raised))
        future.release()

    def _lost(self) -> Iterator[Ended[Any]]:
        """Items of workers that are gone, or were not heard of for long."""
        heard = self._roll.heard(time.monotonic())
        lost = [future for future, given in self._given.items() if given.worker not in heard]
        for future in lost:
            yield from self._again(self._given.pop(future), _lost_words())
        self._withdraw(lost)

    def _again(self, given: _Given, why: str) -> Iterator[Ended[Any]]:
        """Try an item once more, unless it was tried often, or took all of its time."""
        tries = self._tries[given.number]
        if self._seconds is not None and time.monotonic() - given.since >= self._seconds:
            yield Ended(given.number, None, tries, overdue(self._seconds))
        elif tries < MOST_TRIES:
            self._waiting.append(given.number)
        else:
            yield Ended(given.number, None, tries, why)

    @staticmethod
    def _withdraw(futures: Sequence[Any]) -> None:
        """Nobody waits for these any more; what is begun on a worker goes on there."""
        for future in futures:
            with contextlib.suppress(Exception):  # the scheduler may be gone
                future.release()


def _lost_words(fault: BaseException | None = None) -> str:
    return (
        f"each worker that measured it died or was heard of no more, {MOST_TRIES} in all"
        f"{'' if fault is None else f' ({fault})'}: they may lack memory for it, or it crashes the "
        "program; run it alone (uavgram run), which tells, or give workers more memory"
    )


def _unfit_words(fault: BaseException | None) -> str:
    if isinstance(fault, UavgramError):
        return str(fault)
    return (
        f"its worker could not measure it ({type(fault).__name__}: {fault}): install this version "
        "of uavgram on every worker, and let all of them see the same folders"
    )


def _alone(work: Callable[[Item], Made], item: Item, seconds: float | None) -> Made:
    """In a worker, which is one of as many as there are cores."""
    use_one_core()
    if seconds is None:
        return work(item)
    end = threading.Timer(seconds, os.kill, (os.getpid(), _KILL))
    end.daemon = True
    end.start()
    try:
        return work(item)
    finally:
        end.cancel()


_KILL = getattr(signal, "SIGKILL", signal.SIGTERM)
"""What work in C that never returns cannot put off."""


def _security(cluster: Cluster) -> Any:  # noqa: ANN401
    """What Dask's own configuration says, and the files that were named."""
    import distributed  # noqa: PLC0415

    named = {
        "tls_ca_file": cluster.tls_ca_file,
        "tls_client_cert": cluster.tls_cert,
        "tls_client_key": cluster.tls_key,
    }
    given = {key: value for key, value in named.items() if value is not None}
    return distributed.Security(**given, require_encryption=True) if given else None
