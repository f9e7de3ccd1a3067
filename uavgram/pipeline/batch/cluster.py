"""The surveys of a batch on a cluster: a Dask scheduler and its workers, started by others."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from uavgram.errors import UavgramError
from uavgram.pipeline.batch.workers import MOST_TRIES, Ended
from uavgram.pipeline.parallel import use_one_core

Item = TypeVar("Item")
Made = TypeVar("Made")

_PATIENCE_S = 15


@dataclass(frozen=True, kw_only=True)
class Cluster:
    """Where the scheduler listens (``tls://host:8786``), and files for TLS (PEM) if it wants them.

    Who may speak to a scheduler may run any program on its workers: it executes what it is sent.
    """

    address: str
    tls_ca_file: str | None = None
    tls_cert: str | None = None
    tls_key: str | None = None


def on_cluster(
    work: Callable[[Item], Made], items: Sequence[Item], cluster: Cluster
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

    Raises
    ------
    UavgramError
        Dask is not installed, or the scheduler does not answer.
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
        yield from _ended(client, work, items)


def _ended(
    client: Any,  # noqa: ANN401 (Dask ships no types)
    work: Callable[[Item], Made],
    items: Sequence[Item],
) -> Iterator[Ended[Made]]:
    import distributed  # noqa: PLC0415

    futures = {
        client.submit(_alone, work, item, pure=False, retries=MOST_TRIES - 1): number
        for number, item in enumerate(items)
    }
    try:
        for future in distributed.as_completed(futures, loop=client.loop):
            number = futures[future]
            if future.status == "finished":
                yield Ended(number, future.result(), 1)
            else:
                yield Ended(number, None, MOST_TRIES, _why(future.exception()))
            future.release()
    finally:
        client.cancel([one for one in futures if not one.done()])


def _why(fault: BaseException) -> str:
    import distributed  # noqa: PLC0415

    if isinstance(fault, distributed.KilledWorker):
        return (
            f"every worker that measured it died, {fault.allowed_failures + 1} in all: they may "
            "lack memory for it; run it alone (uavgram run), or give workers more memory"
        )
    return (
        f"its worker could not measure it ({type(fault).__name__}: {fault}): install this version "
        "of uavgram on every worker, and let all of them see the same folders"
    )


def _alone(work: Callable[[Item], Made], item: Item) -> Made:
    """In a worker, which is one of as many as there are cores."""
    use_one_core()
    return work(item)


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
