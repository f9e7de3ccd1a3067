"""A batch on a Dask cluster, here of two workers in this process."""

import sys
from collections.abc import Iterator

import distributed
import pytest
from batch_work import fail_at_two

from uavgram.errors import UavgramError
from uavgram.pipeline import parallel
from uavgram.pipeline.batch import cluster
from uavgram.pipeline.batch.cluster import Cluster, on_cluster


@pytest.fixture
def address(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    monkeypatch.setattr(parallel, "_allowed", [])  # workers of their own processes keep it
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=False, dashboard_address=":0"
    ) as local:
        yield local.scheduler_address


def test_each_item_is_made_and_what_fails_stops_no_other(address: str) -> None:
    ended = {
        one.number: one for one in on_cluster(fail_at_two, [0, 1, 2, 3], Cluster(address=address))
    }

    assert {k: one.value for k, one in ended.items()} == {0: 0, 1: 1, 2: None, 3: 9}
    assert "ValueError: two" in ended[2].why
    assert parallel.cores() == 1


def test_a_scheduler_that_does_not_answer_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "_PATIENCE_S", 0.2)

    with pytest.raises(UavgramError, match=r"127\.0\.0\.1:9 does not answer.*dask scheduler"):
        list(on_cluster(fail_at_two, [1], Cluster(address="tcp://127.0.0.1:9")))


def test_tls_that_is_asked_for_is_required() -> None:
    files = Cluster(
        address="tcp://127.0.0.1:9", tls_ca_file="a.pem", tls_cert="c.pem", tls_key="k.pem"
    )

    with pytest.raises(UavgramError, match="does not answer"):  # not without encryption
        list(on_cluster(fail_at_two, [1], files))


def test_without_dask_there_is_a_way_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)

    with pytest.raises(UavgramError, match=r"pip install 'uavgram\[cluster\]'"):
        list(on_cluster(fail_at_two, [1], Cluster(address="tcp://127.0.0.1:9")))
