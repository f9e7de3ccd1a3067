"""Work on a cluster: a Dask scheduler and its workers, started by others.

Dask reassigns the work of a worker that died, or did not report for as long as its scheduler waits
(`distributed.scheduler.worker-ttl`, five minutes), and retries failed work.
"""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from dataclasses import dataclass
from typing import Any, TypeVar

from uavgram.errors import UavgramError, install_command
from uavgram.pipeline.process_settings import use_one_core
from uavgram.pipeline.processes import MAX_TRIES, ItemOutcome, describe_timeout

Item = TypeVar("Item")
Made = TypeVar("Made")

_TIMEOUT_S = 15
_ALONE_S = 300.0
"""Time without any worker [s]: enough to start one."""
_LOOK_S = 1.0
_TOLD_S = 5.0
"""Time [s] for the message that an item takes too long to arrive, before its process ends."""


@dataclass(frozen=True, kw_only=True)
class Cluster:
    """Address of the scheduler (``tls://host:8786``), and files for TLS (PEM) if it needs them.

    A client of a scheduler can run any program on its workers: it executes everything that it is
    sent.
    """

    address: str
    tls_ca_file: str | None = None
    tls_cert: str | None = None
    tls_key: str | None = None


def run_on_cluster(
    work: Callable[[Item], Made],
    items: Sequence[Item],
    cluster: Cluster,
    seconds: float | None = None,
    fresh: Callable[[Item], Item] = lambda item: item,
) -> Iterator[ItemOutcome[Made]]:
    """Yield each item's result as soon as it is ready, like `run_in_workers`; with shared paths.

    Parameters
    ----------
    work
        A function at the top of a module that the workers have too.
    items
        Pickled to the workers.
    cluster
        The cluster.
    seconds
        Time limit of an item: then the process of its worker ends (a nanny starts another).
    fresh
        Prepares an item before it is sent.

    Raises
    ------
    UavgramError
        Dask is not installed, or the scheduler does not answer, has lost all workers, or stopped.
    """
    try:
        import distributed  # noqa: PLC0415 (an extra)
    except ImportError as fault:
        raise UavgramError(
            "--scheduler needs Dask, which is not installed: "
            f"{install_command('distributed')}, here and on every worker"
        ) from fault
    try:
        client = distributed.Client(
            cluster.address, timeout=_TIMEOUT_S, security=_security(cluster), set_as_default=False
        )
    except (OSError, TimeoutError, TypeError, ValueError) as fault:
        raise UavgramError(
            f"the scheduler at {cluster.address} does not answer ({fault}): start it "
            "(dask scheduler) and its workers (dask worker --nthreads 1), and name the address "
            "that it prints; with tls:// also --tls-ca-file, --tls-cert and --tls-key"
        ) from fault
    with client:
        yield from _collect_outcomes(client, work, list(map(fresh, items)), seconds)


def _collect_outcomes(
    client: Any,  # noqa: ANN401 (Dask ships no types)
    work: Callable[[Item], Made],
    items: Sequence[Item],
    seconds: float | None,
) -> Iterator[ItemOutcome[Made]]:
    """Yield outcomes until all items are done."""
    import distributed  # noqa: PLC0415

    topic = f"uavgram-{client.id}"
    begun, late = Counter[int](), set[int]()

    def hear(event: tuple[float, tuple[str, int]]) -> None:
        what, number = event[1]
        begun[number] += what == _BEGUN
        late.update({number} if what == _LATE else ())

    client.subscribe_topic(topic, hear)
    waiting = {
        client.submit(
            _run_alone, work, one, seconds, (topic, k), pure=False, retries=MAX_TRIES - 1
        ): k
        for k, one in enumerate(items)
    }
    manned = time.monotonic()
    while waiting:
        try:
            with contextlib.suppress(TimeoutError), client.as_current():
                distributed.wait(list(waiting), timeout=_LOOK_S, return_when="FIRST_COMPLETED")
        except CancelledError as fault:
            raise UavgramError(
                "the scheduler went away in the midst of the work: start it again, and the same "
                "command goes on"
            ) from fault
        for future in [one for one in waiting if one.done() or waiting[one] in late]:
            number = waiting[future]
            tries = max(begun[number], 1)
            if number in late and seconds is not None:
                future.cancel(reason="it takes too long")
                yield ItemOutcome(number, None, tries, describe_timeout(seconds))
            elif future.status == "error":
                yield ItemOutcome(number, None, tries, _describe_failure(future.exception()))
            else:
                try:
                    yield ItemOutcome(number, future.result(timeout=_TIMEOUT_S), tries)
                except TimeoutError:  # lost in transit: it is computed again
                    continue
            del waiting[future]
        with contextlib.suppress(OSError, TimeoutError):
            if client.ncores():
                manned = time.monotonic()
        if time.monotonic() - manned > _ALONE_S:
            raise UavgramError(
                f"the scheduler has heard of no worker for {_ALONE_S / 60.0:.0f} minutes: start "
                "some (dask worker --nthreads 1), and the same command goes on"
            )


_BEGUN, _LATE = "begun", "late"


def _describe_failure(fault: BaseException) -> str:
    """Describe the reason of a failed item."""
    import distributed  # noqa: PLC0415

    if isinstance(fault, UavgramError):
        return str(fault)
    if isinstance(fault, distributed.KilledWorker):
        return (
            "each worker that measured it died or does not answer: they may lack memory for "
            "it, or it crashes the program; run it alone (uavgram run) to see which, or give "
            "workers more memory"
        )
    return (
        f"its worker could not measure it ({type(fault).__name__}: {fault}): install this version "
        "of uavgram on every worker, and let all of them see the same folders"
    )


def _run_alone(
    work: Callable[[Item], Made], item: Item, seconds: float | None, name: tuple[str, int]
) -> Made:
    """Run an item in a worker, which is one of as many as there are cores."""
    import distributed  # noqa: PLC0415

    use_one_core()
    worker, (topic, number) = distributed.get_worker(), name
    worker.log_event(topic, (_BEGUN, number))
    if seconds is None:
        return work(item)

    def end() -> None:
        worker.log_event(topic, (_LATE, number))
        time.sleep(_TOLD_S)
        os.kill(os.getpid(), _KILL)

    timer = threading.Timer(seconds, end)
    timer.daemon = True
    timer.start()
    try:
        return work(item)
    finally:
        timer.cancel()


_KILL = getattr(signal, "SIGKILL", signal.SIGTERM)
"""Signal that also ends work in C that never returns."""


def _security(cluster: Cluster) -> Any:  # noqa: ANN401
    """Return the security of Dask's own configuration, or with the given files."""
    import distributed  # noqa: PLC0415

    named = {
        "tls_ca_file": cluster.tls_ca_file,
        "tls_client_cert": cluster.tls_cert,
        "tls_client_key": cluster.tls_key,
    }
    given = {key: value for key, value in named.items() if value is not None}
    return distributed.Security(**given, require_encryption=True) if given else None
