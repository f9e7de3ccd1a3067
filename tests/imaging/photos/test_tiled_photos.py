"""Photos of which few are decoded at a time: what is shown stays the photo's own pixels."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from uavgram.errors import InputError
from uavgram.imaging.photos import tiled_photos as module
from uavgram.imaging.photos.decode import read_pixels
from uavgram.imaging.photos.preview import Pixels
from uavgram.imaging.photos.tiled_photos import PhotoFile, TiledPhotos
from uavgram.imaging.photos.tiles import FIRST_COARSE, TILE_PX, fine_tile, make_overview
from uavgram.imaging.photos.tone import IDENTITY_TONE

WIDTH, HEIGHT = 1500, 1100


@pytest.fixture
def files(tmp_path: Path) -> list[PhotoFile]:
    """Three photos."""
    for k in range(3):
        pixels = np.random.default_rng(k).integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8)
        cv2.imwrite(str(tmp_path / f"{k}.bmp"), pixels)
    return [PhotoFile(str(tmp_path / f"{k}.bmp"), WIDTH, HEIGHT) for k in range(3)]


@pytest.fixture
def decoded(monkeypatch: pytest.MonkeyPatch) -> list[str]:
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
    files: list[PhotoFile], decoded: list[str]
) -> None:
    photos = TiledPhotos(files)
    before = every_tile(photos, 0)
    every_tile(photos, 1)
    assert every_tile(photos, 0) == before
    pixels = np.asarray(cv2.imread(files[0].path), np.uint8)
    assert before[0] == fine_tile(pixels, 0, 0, 0)
    assert photos.tile(0, FIRST_COARSE, 0, 0) == make_overview(pixels).tile(FIRST_COARSE, 0, 0)
    assert decoded[:3] == ["0.bmp", "1.bmp", "0.bmp"]


def test_the_whole_of_a_photo_is_shown_again_without_waiting_for_its_pixels(
    files: list[PhotoFile], decoded: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    photos = TiledPhotos(files)
    shown = photos.tile(0, FIRST_COARSE, 0, 0)
    photos.tile(1, FIRST_COARSE, 0, 0)
    read: Callable[..., Pixels] = vars(module)["read_pixels"]  # as `decoded` counts it
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
    assert decoded == ["0.bmp", "1.bmp", "0.bmp"]


def test_photos_that_a_page_shows_side_by_side_are_decoded_once_each(
    files: list[PhotoFile], decoded: list[str]
) -> None:
    photos = TiledPhotos(files)
    for _ in range(3):
        for photo in range(3):
            photos.show("page", (0, 1, 2))
            photos.tile(photo, 0, 0, 0)
    assert sorted(decoded) == ["0.bmp", "1.bmp", "2.bmp"]


def test_what_one_page_shows_is_not_taken_from_it_by_another(
    files: list[PhotoFile], decoded: list[str]
) -> None:
    photos = TiledPhotos(files)
    for _ in range(3):
        for photo in range(2):
            photos.show(f"page {photo}", (photo,))
            photos.tile(photo, 0, 0, 0)
    assert sorted(decoded) == ["0.bmp", "1.bmp"]


def test_a_page_that_is_closed_keeps_nothing(
    files: list[PhotoFile], decoded: list[str], monkeypatch: pytest.MonkeyPatch
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
    assert decoded == ["0.bmp", "1.bmp", "0.bmp"]


@pytest.mark.usefixtures("decoded")
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
    files: list[PhotoFile], decoded: list[str]
) -> None:
    photos = TiledPhotos(files)
    photos.read_ahead(2)
    assert photos.tile(2, FIRST_COARSE, 0, 0) is not None
    assert photos.tile(2, 0, 0, 0) is not None
    assert decoded == ["2.bmp"]


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
