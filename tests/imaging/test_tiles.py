"""Tiles: exact halves, original orientation, and a memory that forgets the longest unused."""

from __future__ import annotations

import threading

import cv2
import numpy as np
import pytest

from uavgram.errors import InputError
from uavgram.imaging import tiles
from uavgram.imaging.tiles import (
    TILE_PX,
    Kept,
    half,
    level_count,
    pyramid_of,
    read_pyramid,
    reduced,
)

TURNED = (
    b"\xff\xe1\x00\x22Exif\x00\x00MM\x00\x2a\x00\x00\x00\x08"
    b"\x00\x01\x01\x12\x00\x03\x00\x00\x00\x01\x00\x06\x00\x00\x00\x00\x00\x00"
)


@pytest.mark.parametrize("shape", [(8, 6, 3), (7, 5, 3), (1, 9, 3), (101, 64, 3)])
def test_a_half_is_the_mean_of_two_by_two_with_odd_edges_repeated(shape):
    pixels = np.random.default_rng(1).integers(0, 256, shape, np.uint8)
    even = np.pad(pixels, ((0, shape[0] % 2), (0, shape[1] % 2), (0, 0)), mode="edge")
    height, width = even.shape[:2]
    mean = even.reshape(height // 2, 2, width // 2, 2, 3).mean(axis=(1, 3))
    assert np.abs(half(pixels) - mean).max() <= 0.5


def decoded(jpeg):
    return cv2.imdecode(np.frombuffer(jpeg, np.uint8), 1)


def joined(pyramid, level):
    """A whole level from its tiles."""
    rows = []
    for row in range(99):
        tiles = [pyramid.tile(level, column, row) for column in range(99)]
        parts = [decoded(tile) for tile in tiles if tile is not None]
        if not parts:
            break
        rows.append(np.hstack(parts))
    return np.vstack(rows)


def test_marks_stay_where_they_are_on_every_level():
    pixels = np.zeros((1401, 2003, 3), np.uint8)
    v, u = np.mgrid[:1401, :2003]
    pixels[...] = (200 * np.exp(-((u - 1950.0) ** 2 + (v - 1340.0) ** 2) / 128))[..., None]
    for k in range(4):
        grey = reduced(pixels, k)[..., 0].astype(float)
        place = [
            (grey * axis).sum() / grey.sum() for axis in np.mgrid[: grey.shape[0], : grey.shape[1]]
        ]
        original = (np.array(place) + 0.5) * 2**k - 0.5
        assert np.abs(original - [1340.0, 1950.0]).max() < 0.1


@pytest.mark.parametrize("shape", [(2051, 3077, 3), (4096, 2048, 3), (1537, 5, 3)])
def test_levels_that_are_made_of_parts_are_those_of_the_whole_photo(shape, monkeypatch):
    pixels = np.random.default_rng(3).integers(0, 256, shape, np.uint8)
    pyramid = pyramid_of(pixels)
    cut = []
    monkeypatch.setattr(cv2, "imencode", lambda _, part, __: cut.append(part) or (0, part))
    whole = pixels
    for level in range(level_count(shape[1], shape[0])):
        height, width = whole.shape[:2]
        for row in range(-(-height // TILE_PX)):
            for column in range(-(-width // TILE_PX)):
                pyramid.tile(level, column, row)
                top, left = row * TILE_PX, column * TILE_PX
                there = whole[top : top + TILE_PX, left : left + TILE_PX]
                np.testing.assert_array_equal(cut.pop(), there)
        assert pyramid.tile(level, -(-width // TILE_PX), 0) is None
        whole = half(whole)


def test_tiles_join_to_the_photo():
    pixels = np.full((600, 1100, 3), 120, np.uint8)
    pixels[:, 700:] = 30
    pyramid = pyramid_of(pixels)
    assert np.abs(joined(pyramid, 0).astype(int) - pixels).max() <= 12


@pytest.mark.parametrize("place", [(0, 3, 0), (0, 0, 2), (9, 0, 0), (-1, 0, 0), (0, -1, 0)])
def test_there_is_no_tile_outside_the_photo(place):
    assert pyramid_of(np.zeros((600, 1100, 3), np.uint8)).tile(*place) is None


def test_levels_are_as_many_as_the_page_is_told():
    pyramid = pyramid_of(np.zeros((1401, 2003, 3), np.uint8))
    last = level_count(2003, 1401) - 1
    assert pyramid.tile(last + 1, 0, 0) is None
    assert max(decoded(pyramid.tile(last, 0, 0)).shape) <= TILE_PX


def test_exif_orientation_turns_nothing(tmp_path):
    pixels = np.random.default_rng(2).integers(0, 256, (40, 60, 3), np.uint8)
    encoded = cv2.imencode(".jpg", pixels)[1].tobytes()
    turned = tmp_path / "turned.jpg"
    turned.write_bytes(encoded[:2] + TURNED + encoded[2:])
    assert cv2.imread(str(turned)).shape[:2] == (60, 40)  # whoever follows the tag turns it
    stored = cv2.imdecode(np.frombuffer(encoded, np.uint8), 1)
    for size_px in (None, (60, 40), (40, 60)):  # unknown, known, and said wrongly
        np.testing.assert_array_equal(read_pyramid(turned, size_px).photo, stored)


@pytest.mark.parametrize("size_px", [None, (60, 40)])
@pytest.mark.parametrize("content", [b"", b"no photo", b"cut"])
def test_what_is_no_photo_is_said(tmp_path, content, size_px):
    path = tmp_path / "photo.jpg"
    if content == b"cut":
        pixels = np.random.default_rng(2).integers(0, 256, (40, 60, 3), np.uint8)
        content = cv2.imencode(".jpg", pixels)[1].tobytes()[:300]
    path.write_bytes(content)
    with pytest.raises(InputError, match="no photo"):
        read_pyramid(path, size_px)


def test_the_longest_unused_goes_first_and_the_newest_stays():
    made = []
    kept = Kept(lambda key: made.append(key) or key, lambda key: key, 10)
    for key in (4, 5, 4, 6, 4):
        kept.get(key)
    assert made == [4, 5, 6]
    kept.get(5)
    assert made == [4, 5, 6, 5]
    kept.get(99)  # larger than the bound by itself
    kept.get(99)
    assert made.count(99) == 1


def test_photos_that_are_looked_at_side_by_side_stay_though_they_are_large(monkeypatch):
    made, now = [], [0.0]
    monkeypatch.setattr(tiles.time, "monotonic", lambda: now[0])
    kept = Kept(lambda key: made.append(key) or key, lambda _: 7, 10, in_use=2)
    for key in (1, 2, 1, 2, 1, 2):
        kept.get(key)
    assert made == [1, 2]
    kept.get(3)  # the third takes the place of the longest unused
    kept.get(2)
    assert made == [1, 2, 3]
    now[0] = tiles.IN_USE_S + 1
    kept.get(4)  # the others are not looked at any more
    now[0] += tiles.IN_USE_S + 1
    kept.get(4)
    kept.get(2)
    assert made == [1, 2, 3, 4, 2]


def test_threads_share_the_making_of_a_value():
    made, begun = [], threading.Barrier(4)
    kept = Kept(lambda key: made.append(key) or key, lambda _: 1, 10)

    def ask():
        begun.wait()
        kept.get(1)

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert made == [1]


def test_a_value_whose_making_failed_is_made_again():
    tries = []

    def make(key):
        tries.append(key)
        if len(tries) == 1:
            raise OSError("not now")
        return key

    kept = Kept(make, lambda _: 1, 10)
    with pytest.raises(OSError, match="not now"):
        kept.get(1)
    assert kept.get(1) == 1
