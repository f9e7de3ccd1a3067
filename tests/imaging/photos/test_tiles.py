"""Tiles: exact halves, in the original orientation."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from uavgram.errors import InputError
from uavgram.imaging.photos import tiles as module
from uavgram.imaging.photos.decoding import halve, read_pixels
from uavgram.imaging.photos.preview import IDENTITY_TONE, Pixels
from uavgram.imaging.photos.tiles import (
    FIRST_COARSE,
    TILE_PX,
    PhotoFile,
    TiledPhotos,
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


# Photos of which few are decoded at a time: what is shown stays the photo's own pixels.


WIDTH, HEIGHT = 1500, 1100


@pytest.fixture
def files(tmp_path: Path) -> list[PhotoFile]:
    """Three photos."""
    for k in range(3):
        pixels = np.random.default_rng(k).integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8)
        cv2.imwrite(str(tmp_path / f"{k}.bmp"), pixels)
    return [PhotoFile(str(tmp_path / f"{k}.bmp"), WIDTH, HEIGHT) for k in range(3)]


@pytest.fixture
def decoded_names(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the files that were decoded; so little is kept that only one photo's pixels are."""
    names: list[str] = []

    def counted(path: str, size_px: tuple[int, int] | None) -> Pixels:
        names.append(path.rsplit("/", 1)[1])
        return read_pixels(path, size_px)

    monkeypatch.setattr(module, "read_pixels", counted)
    monkeypatch.setattr(module, "PIXELS_BYTES", WIDTH * HEIGHT * 4)
    return names


def every_tile(photos: TiledPhotos, photo: int) -> list[bytes | None]:
    return [
        photos.tile(photo, level, column, row)
        for level in range(4)
        for row in range(-(-HEIGHT // (TILE_PX << level)))
        for column in range(-(-WIDTH // (TILE_PX << level)))
    ]


def test_tiles_are_the_same_before_and_after_a_photo_made_room_for_another(
    files: list[PhotoFile], decoded_names: list[str]
) -> None:
    photos = TiledPhotos(files)
    before = every_tile(photos, 0)
    every_tile(photos, 1)
    assert every_tile(photos, 0) == before
    pixels = np.asarray(cv2.imread(files[0].path), np.uint8)
    assert before[0] == fine_tile(pixels, 0, 0, 0)
    assert photos.tile(0, FIRST_COARSE, 0, 0) == make_overview(pixels).tile(FIRST_COARSE, 0, 0)
    assert decoded_names[:3] == ["0.bmp", "1.bmp", "0.bmp"]


def test_the_whole_of_a_photo_is_shown_again_without_waiting_for_its_pixels(
    files: list[PhotoFile], decoded_names: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    photos = TiledPhotos(files)
    shown = photos.tile(0, FIRST_COARSE, 0, 0)
    photos.tile(1, FIRST_COARSE, 0, 0)
    read: Callable[..., Pixels] = vars(module)["read_pixels"]  # as `decoded_names` counts it
    go_on, begun = threading.Event(), threading.Event()

    def later(path: str, size_px: tuple[int, int] | None) -> Pixels:
        begun.set()
        go_on.wait(60)
        return read(path, size_px)

    monkeypatch.setattr(module, "read_pixels", later)
    assert photos.tile(0, FIRST_COARSE, 0, 0) == shown
    assert begun.wait(60)  # before anyone looks closer
    go_on.set()
    photos.pixels(0)
    assert decoded_names == ["0.bmp", "1.bmp", "0.bmp"]


def test_photos_that_a_page_shows_side_by_side_are_decoded_once_each(
    files: list[PhotoFile], decoded_names: list[str]
) -> None:
    photos = TiledPhotos(files)
    for _ in range(3):
        for photo in range(3):
            photos.show("page", (0, 1, 2))
            photos.tile(photo, 0, 0, 0)
    assert sorted(decoded_names) == ["0.bmp", "1.bmp", "2.bmp"]


def test_what_one_page_shows_is_not_taken_from_it_by_another(
    files: list[PhotoFile], decoded_names: list[str]
) -> None:
    photos = TiledPhotos(files)
    for _ in range(3):
        for photo in range(2):
            photos.show(f"page {photo}", (photo,))
            photos.tile(photo, 0, 0, 0)
    assert sorted(decoded_names) == ["0.bmp", "1.bmp"]


def test_a_page_that_is_closed_keeps_nothing(
    files: list[PhotoFile], decoded_names: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [0.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    photos = TiledPhotos(files)
    photos.show("closed", (0,))
    photos.tile(0, 0, 0, 0)
    now[0] = module.IN_USE_S + 1
    photos.show("open", (1,))
    photos.tile(1, 0, 0, 0)
    photos.tile(0, 0, 0, 0)
    assert decoded_names == ["0.bmp", "1.bmp", "0.bmp"]


@pytest.mark.usefixtures("decoded_names")
def test_what_cannot_be_decoded_any_more_is_said_and_the_rest_lives_on(
    files: list[PhotoFile], tmp_path: Path
) -> None:
    photos = TiledPhotos(files)
    shown = photos.tile(0, FIRST_COARSE, 0, 0)
    photos.tile(1, 0, 0, 0)
    (tmp_path / "0.bmp").write_bytes(b"no photo")
    assert photos.tile(0, FIRST_COARSE, 0, 0) == shown
    for _ in range(2):
        with pytest.raises(InputError, match="no photo"):
            photos.tile(0, 0, 0, 0)
    assert photos.tile(1, 0, 0, 0) is not None


@pytest.mark.parametrize("level", [0, FIRST_COARSE])
@pytest.mark.parametrize("photo", [-1, 3])
def test_there_is_no_tile_of_a_photo_that_is_not_there(
    files: list[PhotoFile], photo: int, level: int
) -> None:
    assert TiledPhotos(files).tile(photo, level, 0, 0) is None


def test_a_photo_that_is_read_ahead_is_decoded_once(
    files: list[PhotoFile], decoded_names: list[str]
) -> None:
    photos = TiledPhotos(files)
    photos.read_ahead(2)
    assert photos.tile(2, FIRST_COARSE, 0, 0) is not None
    assert photos.tile(2, 0, 0, 0) is not None
    assert decoded_names == ["2.bmp"]


def test_a_dark_photo_is_brightened_on_its_tiles_and_not_in_its_pixels(tmp_path: Path) -> None:
    dark = np.random.default_rng(1).integers(30, 60, (HEIGHT // 20, WIDTH // 20, 3), np.uint8)
    dark = np.asarray(cv2.resize(dark, (WIDTH, HEIGHT), interpolation=cv2.INTER_LINEAR), np.uint8)
    cv2.imwrite(str(tmp_path / "dark.bmp"), dark)
    photos = TiledPhotos([PhotoFile(str(tmp_path / "dark.bmp"), WIDTH, HEIGHT)])
    found = photos.tones(0)
    assert found is not None
    first, stretched = found
    shown = [
        np.asarray(cv2.imdecode(np.frombuffer(tile or b"", np.uint8), cv2.IMREAD_COLOR), np.uint8)
        for tile in (photos.tile(0, level, 0, 0, None) for level in (0, FIRST_COARSE))
    ]

    assert first == stretched != IDENTITY_TONE
    assert dark.mean() < 50
    assert all(tile.mean() > 100 for tile in shown)
    assert photos.tile(0, 0, 0, 0) == fine_tile(dark, 0, 0, 0)
    assert np.array_equal(photos.pixels(0), dark)
    assert photos.tones(1) is None
