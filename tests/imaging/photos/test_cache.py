"""A memory that makes values once and forgets the longest unused."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from uavgram.errors import InputError
from uavgram.imaging.photos.cache import GreyPhotos, LruCache
from uavgram.imaging.raster import Image


def noted(made: list[int]) -> Callable[[int], int]:
    """Makes of every key the key itself, and writes it down."""

    def make(key: int) -> int:
        made.append(key)
        return key

    return make


def test_the_longest_unused_goes_first_and_the_newest_stays() -> None:
    made: list[int] = []
    kept = LruCache(noted(made), lambda key: key, 10)
    for key in (4, 5, 4, 6, 4):
        kept.get(key)
    assert made == [4, 5, 6]
    kept.get(5)
    assert made == [4, 5, 6, 5]
    kept.get(99)  # larger than the bound by itself
    kept.get(99)
    assert made.count(99) == 1


def test_values_that_are_held_stay_though_they_are_large() -> None:
    made: list[int] = []
    kept = LruCache(noted(made), lambda _: 7, 10)
    kept.hold({1, 2})
    for key in (1, 2, 1, 2, 1, 2):
        kept.get(key)
    assert made == [1, 2]
    kept.get(3)  # beside them, as it is asked for
    kept.get(1)
    kept.get(2)
    assert made == [1, 2, 3]
    kept.hold({2})  # the others make room at once
    kept.get(2)
    kept.get(1)
    assert made == [1, 2, 3, 1]


def test_threads_share_the_making_of_a_value() -> None:
    made: list[int] = []
    begun = threading.Barrier(4)
    kept = LruCache(noted(made), lambda _: 1, 10)

    def ask() -> None:
        begun.wait()
        kept.get(1)

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert made == [1]


def test_a_value_whose_making_failed_is_made_again() -> None:
    tries: list[int] = []

    def make(key: int) -> int:
        tries.append(key)
        if len(tries) == 1:
            raise OSError("not now")
        return key

    kept = LruCache(make, lambda _: 1, 10)
    with pytest.raises(OSError, match="not now"):
        kept.get(1)
    assert kept.get(1) == 1


def test_room_is_made_before_a_value_is_and_not_after() -> None:
    others: list[set[int]] = []

    def make(key: int) -> None:
        others.append(set(kept._kept) - {key})

    kept: LruCache[int, None] = LruCache(
        make,
        lambda _: 7,
        10,
        expected_bytes=lambda _: 7,
    )
    for key in (1, 2, 3, 1):
        kept.get(key)
    assert others == [set()] * 4


def test_a_value_that_is_being_made_is_not_let_go() -> None:
    made: list[int] = []
    go_on = threading.Event()

    def make(key: int) -> int:
        made.append(key)
        if key == 1:
            go_on.wait(60)
        return key

    kept = LruCache(make, lambda _: 7, 10, expected_bytes=lambda _: 7)
    kept.prefetch(1)
    kept.get(2)
    kept.get(3)
    go_on.set()
    assert kept.get(1) == 1
    assert made.count(1) == 1


def test_a_value_that_is_made_ahead_is_there_when_it_is_asked_for() -> None:
    made: list[int] = []
    begun, go_on = threading.Event(), threading.Event()

    def make(key: int) -> int:
        begun.set()
        go_on.wait(60)
        made.append(key)
        return key

    kept = LruCache(make, lambda _: 1, 10)
    kept.prefetch(1)
    assert begun.wait(60)
    kept.prefetch(1)
    go_on.set()
    assert kept.get(1) == 1
    assert made == [1]


def test_a_fault_met_ahead_is_told_when_the_value_is_asked_for() -> None:
    ended = threading.Event()

    def make(_: int) -> None:
        try:
            raise InputError("photo.jpg", "is no photo")
        finally:
            ended.set()

    kept = LruCache(make, lambda _: 1, 10)
    kept.prefetch(1)
    assert ended.wait(60)
    with pytest.raises(InputError, match="is no photo"):
        kept.get(1)


# Photos decoded beforehand: in order, as many as have room; one that fails is passed over.


NAMES = ("a", "b", "c", "d", "e")
SIZE = 100


class Reader:
    """Decodes photos, and remembers which."""

    def __init__(self) -> None:
        self.read: list[str] = []
        self.go_on = threading.Event()
        self.go_on.set()
        self.asked = threading.Event()

    def __call__(self, name: str) -> Image:
        self.asked.set()
        self.go_on.wait(10.0)
        self.read.append(name)
        if name == "b":
            raise InputError(name, "cannot be read")
        return np.zeros((10, 10), np.uint8)


@pytest.fixture
def reader() -> Reader:
    return Reader()


@pytest.fixture
def photos(reader: Reader) -> Iterator[GreyPhotos]:
    made = GreyPhotos(dict.fromkeys(NAMES, SIZE), reader, most_bytes=4 * SIZE)
    yield made
    reader.go_on.set()
    made.stop()


def wait_until_read(reader: Reader, count: int) -> None:
    until = time.monotonic() + 10.0
    while len(reader.read) < count:
        assert time.monotonic() < until
        time.sleep(0.002)


def test_they_are_decoded_in_order_and_no_more_than_have_room(
    photos: GreyPhotos, reader: Reader
) -> None:
    photos.read_ahead(("c", "b", "a", "d", "e"))
    wait_until_read(reader, 4)
    photos.stop()
    assert reader.read == ["c", "b", "a", "d"]
    assert [name for name in NAMES if photos.photos.has(name)] == ["a", "c", "d"]


def test_large_ones_are_decoded_when_they_are_asked_for_not_before(reader: Reader) -> None:
    large = GreyPhotos(dict.fromkeys(NAMES, SIZE), reader, most_bytes=2 * SIZE)
    large.read_ahead(("a", "c"))
    large.stop()
    assert not reader.read
    assert large.photos.get("a").shape == (10, 10)


def test_what_is_asked_for_later_comes_first(photos: GreyPhotos, reader: Reader) -> None:
    reader.go_on.clear()
    photos.read_ahead(("a", "c"))
    reader.asked.wait(10.0)  # `a` is under way
    photos.read_ahead(("d",))
    reader.go_on.set()
    wait_until_read(reader, 2)
    assert reader.read == ["a", "d"]


def test_one_that_cannot_be_read_says_so_when_it_is_asked_for(photos: GreyPhotos) -> None:
    with pytest.raises(InputError):
        photos.photos.get("b")
