"""Photos decoded beforehand: in order, as many as have room; one that fails is passed over."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest

from uavgram.errors import InputError
from uavgram.imaging.photos.grey_photos import GreyPhotos
from uavgram.imaging.raster import Image

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
