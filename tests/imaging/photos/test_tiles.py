"""Tiles: exact halves, in the original orientation."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from uavgram.errors import InputError
from uavgram.imaging.photos.decode import read_pixels
from uavgram.imaging.photos.preview import Pixels
from uavgram.imaging.photos.reduction import halve
from uavgram.imaging.photos.tiles import (
    FIRST_COARSE,
    TILE_PX,
    fine_tile,
    halve_repeatedly,
    level_count,
    make_overview,
)

TURNED = (
    b"\xff\xe1\x00\x22Exif\x00\x00MM\x00\x2a\x00\x00\x00\x08"
    b"\x00\x01\x01\x12\x00\x03\x00\x00\x00\x01\x00\x06\x00\x00\x00\x00\x00\x00"
)


@pytest.mark.parametrize("shape", [(8, 6, 3), (7, 5, 3), (1, 9, 3), (101, 64, 3)])
def test_a_half_is_the_mean_of_two_by_two_with_odd_edges_repeated(
    shape: tuple[int, int, int],
) -> None:
    pixels = np.random.default_rng(1).integers(0, 256, shape, np.uint8)
    even = np.pad(pixels, ((0, shape[0] % 2), (0, shape[1] % 2), (0, 0)), mode="edge")
    height, width = even.shape[:2]
    mean = even.reshape(height // 2, 2, width // 2, 2, 3).mean(axis=(1, 3))
    assert np.abs(halve(pixels) - mean).max() <= 0.5


def decoded(jpeg: bytes) -> Pixels:
    pixels = cv2.imdecode(np.frombuffer(jpeg, np.uint8), 1)
    assert pixels is not None
    return np.asarray(pixels, np.uint8)


def tiles_of(pixels: Pixels) -> Callable[[int, int, int], bytes | None]:
    """What gives the tiles of a photo."""
    overview = make_overview(pixels)

    def tile(level: int, column: int, row: int) -> bytes | None:
        if level < FIRST_COARSE:
            return fine_tile(pixels, level, column, row)
        return overview.tile(level, column, row)

    return tile


def joined(tile: Callable[[int, int, int], bytes | None], level: int) -> Pixels:
    """A whole level from its tiles."""
    rows = []
    for row in range(99):
        tiles = [tile(level, column, row) for column in range(99)]
        parts = [decoded(jpeg) for jpeg in tiles if jpeg is not None]
        if not parts:
            break
        rows.append(np.hstack(parts))
    return np.vstack(rows)


def test_marks_stay_where_they_are_on_every_level() -> None:
    pixels = np.zeros((1401, 2003, 3), np.uint8)
    v, u = np.mgrid[:1401, :2003]
    pixels[...] = (200 * np.exp(-((u - 1950.0) ** 2 + (v - 1340.0) ** 2) / 128))[..., None]
    for k in range(4):
        grey = halve_repeatedly(pixels, k)[..., 0].astype(float)
        place = [
            (grey * axis).sum() / grey.sum() for axis in np.mgrid[: grey.shape[0], : grey.shape[1]]
        ]
        original = (np.array(place) + 0.5) * 2**k - 0.5
        assert np.abs(original - [1340.0, 1950.0]).max() < 0.1


@pytest.mark.parametrize("shape", [(2051, 3077, 3), (4096, 2048, 3), (1537, 5, 3)])
def test_levels_that_are_made_of_parts_are_those_of_the_whole_photo(
    shape: tuple[int, int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    pixels = np.random.default_rng(3).integers(0, 256, shape, np.uint8)
    tile = tiles_of(pixels)
    cut: list[Pixels] = []

    def encoded(_: str, part: Pixels, __: list[int]) -> tuple[bool, Pixels]:
        cut.append(part)
        return False, part

    monkeypatch.setattr(cv2, "imencode", encoded)
    whole = pixels
    for level in range(level_count(shape[1], shape[0])):
        height, width = whole.shape[:2]
        for row in range(-(-height // TILE_PX)):
            for column in range(-(-width // TILE_PX)):
                tile(level, column, row)
                top, left = row * TILE_PX, column * TILE_PX
                there = whole[top : top + TILE_PX, left : left + TILE_PX]
                np.testing.assert_array_equal(cut.pop(), there)
        assert tile(level, -(-width // TILE_PX), 0) is None
        whole = halve(whole)


def test_tiles_join_to_the_photo() -> None:
    pixels = np.full((600, 1100, 3), 120, np.uint8)
    pixels[:, 700:] = 30
    assert np.abs(joined(tiles_of(pixels), 0).astype(int) - pixels).max() <= 12


@pytest.mark.parametrize(
    "place",
    [(0, 3, 0), (0, 0, 2), (9, 0, 0), (-1, 0, 0), (0, -1, 0), (2, 1, 0), (2, 0, 1), (2, -1, 0)],
)
def test_there_is_no_tile_outside_the_photo(place: tuple[int, int, int]) -> None:
    assert tiles_of(np.zeros((600, 1100, 3), np.uint8))(*place) is None


def test_a_level_has_its_tiles_from_one_source_only() -> None:
    pixels = np.zeros((1401, 2003, 3), np.uint8)
    assert fine_tile(pixels, FIRST_COARSE, 0, 0) is None
    assert make_overview(pixels).tile(FIRST_COARSE - 1, 0, 0) is None


def test_levels_are_as_many_as_the_page_is_told() -> None:
    tile = tiles_of(np.zeros((1401, 2003, 3), np.uint8))
    last = level_count(2003, 1401) - 1
    assert tile(last + 1, 0, 0) is None
    whole = tile(last, 0, 0)
    assert whole is not None
    assert max(decoded(whole).shape) <= TILE_PX


def test_exif_orientation_turns_nothing(tmp_path: Path) -> None:
    pixels = np.random.default_rng(2).integers(0, 256, (40, 60, 3), np.uint8)
    encoded = cv2.imencode(".jpg", pixels)[1].tobytes()
    turned = tmp_path / "turned.jpg"
    turned.write_bytes(encoded[:2] + TURNED + encoded[2:])
    read = cv2.imread(str(turned))
    assert read is not None
    assert read.shape[:2] == (60, 40)  # whoever follows the tag turns it
    stored = cv2.imdecode(np.frombuffer(encoded, np.uint8), 1)
    for size_px in (None, (60, 40), (40, 60)):  # unknown, known, and said wrongly
        np.testing.assert_array_equal(read_pixels(turned, size_px), stored)


@pytest.mark.parametrize("size_px", [None, (60, 40)])
@pytest.mark.parametrize("content", [b"", b"no photo", b"cut"])
def test_what_is_no_photo_is_said(
    tmp_path: Path, content: bytes, size_px: tuple[int, int] | None
) -> None:
    path = tmp_path / "photo.jpg"
    if content == b"cut":
        pixels = np.random.default_rng(2).integers(0, 256, (40, 60, 3), np.uint8)
        content = cv2.imencode(".jpg", pixels)[1].tobytes()[:300]
    path.write_bytes(content)
    with pytest.raises(InputError, match="no photo"):
        read_pixels(path, size_px)
