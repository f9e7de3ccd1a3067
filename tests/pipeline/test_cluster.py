"""A batch on a Dask cluster, here of two workers in this process."""

import sys
import threading
from collections.abc import Iterator

import dask
import distributed
import pytest
from executor_work import GO_ON, HELD_BY, STOPPED, fail_at_two, hang_once

from uavgram.errors import UavgramError
from uavgram.pipeline import cluster, process_settings
from uavgram.pipeline.cluster import Cluster, run_on_cluster


@pytest.fixture
def local(monkeypatch: pytest.MonkeyPatch) -> Iterator[distributed.LocalCluster]:
    monkeypatch.setattr(process_settings, "_allowed", [])  # workers of their own processes keep it
    with (
        dask.config.set({"distributed.scheduler.worker-ttl": "4s"}),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=False, dashboard_address=None
        ) as started,
    ):
        yield started


def test_each_item_is_made_and_what_fails_stops_no_other(local: distributed.LocalCluster) -> None:
    address = local.scheduler_address
    ended = {
        one.number: one
        for one in run_on_cluster(fail_at_two, [0, 1, 2, 3], Cluster(address=address))
    }

    assert {k: one.value for k, one in ended.items()} == {0: 0, 1: 1, 2: None, 3: 9}
    assert "ValueError: two" in ended[2].why
    assert process_settings.cores() == 1


def test_an_item_of_a_worker_that_fell_silent_is_made_by_another(
    local: distributed.LocalCluster,
) -> None:
    """One stops in the midst of its work: its connection stands, and nothing comes over it."""

    def stop_the_busy() -> None:
        STOPPED.wait(30.0)
        for worker in local.workers.values():
            if worker.address in HELD_BY:  # the other one may be at work too
                worker.loop.add_callback(worker.periodic_callbacks["heartbeat"].stop)

    threading.Thread(target=stop_the_busy, daemon=True).start()
    try:
        ended = list(run_on_cluster(hang_once, range(4), Cluster(address=local.scheduler_address)))
    finally:
        GO_ON.set()

    assert sorted((one.number, one.value) for one in ended) == [(k, k) for k in range(4)]
    assert next(one.tries for one in ended if one.number == 0) >= 2  # a busy machine may add some


def test_without_workers_it_does_not_wait_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "_ALONE_S", 0.5)
    with (
        distributed.LocalCluster(n_workers=0, processes=False, dashboard_address=None) as empty,
        pytest.raises(UavgramError, match=r"no worker.*dask worker.*goes on"),
    ):
        list(run_on_cluster(fail_at_two, [1], Cluster(address=empty.scheduler_address)))


def test_a_scheduler_that_does_not_answer_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "_TIMEOUT_S", 0.2)

    with pytest.raises(UavgramError, match=r"127\.0\.0\.1:9 does not answer.*dask scheduler"):
        list(run_on_cluster(fail_at_two, [1], Cluster(address="tcp://127.0.0.1:9")))


def test_tls_that_is_asked_for_is_required() -> None:
    files = Cluster(
        address="tcp://127.0.0.1:9", tls_ca_file="a.pem", tls_cert="c.pem", tls_key="k.pem"
    )

    with pytest.raises(UavgramError, match="does not answer"):  # not without encryption
        list(run_on_cluster(fail_at_two, [1], files))


def test_without_dask_there_is_a_way_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)

    with pytest.raises(UavgramError, match=r"pip install distributed"):
        list(run_on_cluster(fail_at_two, [1], Cluster(address="tcp://127.0.0.1:9")))
