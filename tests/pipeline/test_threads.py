"""BLAS has one thread inside our calls, and the caller's number of them again afterwards."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Never

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from uavgram.errors import InputError
from uavgram.pipeline.check import check
from uavgram.pipeline.measure.run import run
from uavgram.pipeline.threads import limit_blas_threads


def numbers() -> set[int]:
    return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}


@pytest.fixture(autouse=True)
def _two() -> Iterator[None]:
    with threadpool_limits(2, user_api="blas"):
        yield
        assert numbers() == {2}


def test_the_setting_comes_back_also_after_an_error() -> None:
    @limit_blas_threads
    def failing() -> Never:
        raise KeyError(*numbers())

    with pytest.raises(KeyError, match="1"):
        failing()
    assert numbers() == {2}
    assert limit_blas_threads(numbers)() == {1}


@pytest.mark.parametrize("call", [run, check])
def test_the_calls_are_limited_and_leave_nothing(
    call: Callable[[Path], object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[set[int]] = []
    module = __import__(call.__module__, fromlist=["read_inputs"])
    real = module.read_inputs

    def counted(*arguments: object, **options: object) -> object:
        seen.append(numbers())
        return real(*arguments, **options)

    monkeypatch.setattr(module, "read_inputs", counted)
    with pytest.raises(InputError):
        call(tmp_path / "absent.yaml")
    assert seen == [{1}]
    assert numbers() == {2}


def test_calls_that_overlap_share_it_and_the_last_one_puts_it_back() -> None:
    first_is_in, second_is_in, first_is_out = (threading.Event() for _ in range(3))
    seen = {}

    @limit_blas_threads
    def second() -> None:
        second_is_in.set()
        first_is_out.wait(10)
        seen["second, alone"] = numbers()

    @limit_blas_threads
    def first() -> None:
        first_is_in.set()
        second_is_in.wait(10)

    threads = [threading.Thread(target=first)]
    threads[0].start()
    first_is_in.wait(10)
    threads.append(threading.Thread(target=second))
    threads[1].start()
    threads[0].join()
    first_is_out.set()
    threads[1].join()
    assert seen == {"second, alone": {1}}
    assert numbers() == {2}
