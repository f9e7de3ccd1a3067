"""Pixels of photo files."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest

from uavgram.errors import InputError
from uavgram.imaging.photos.decode import REDUCED, is_same_exposure, read_pixels, read_reduced


def written(path: Path, width: int, height: int) -> bytes:
    noise = np.random.default_rng(2).integers(0, 256, (height, width, 3), np.uint8)
    assert cv2.imwrite(str(path), cv2.GaussianBlur(noise, (0, 0), 3))
    return path.read_bytes()


@pytest.mark.parametrize("reduction", REDUCED)
@pytest.mark.parametrize(("width", "height"), [(320, 240), (323, 241), (5, 3)])
def test_a_photo_at_a_fraction_of_its_size_is_what_opencv_makes_of_its_content(
    tmp_path: Path, width: int, height: int, reduction: int
) -> None:
    content = written(tmp_path / "photo.jpg", width, height)
    pixels, by = read_reduced(tmp_path / "photo.jpg", lambda _: reduction)

    wanted = cv2.imdecode(np.frombuffer(content, np.uint8), REDUCED[reduction])
    assert by == reduction
    np.testing.assert_array_equal(pixels, wanted)


def test_what_is_no_jpeg_is_never_reduced(tmp_path: Path) -> None:
    written(tmp_path / "photo.png", 64, 48)
    pixels, by = read_reduced(tmp_path / "photo.png", lambda _: 2)

    assert (by, pixels.shape) == (1, (48, 64, 3))


@pytest.mark.parametrize("reduction", REDUCED)
@pytest.mark.parametrize("share", [0.03, 0.1, 0.5, 0.99])
def test_a_photo_that_is_cut_off_is_refused(tmp_path: Path, share: float, reduction: int) -> None:
    content = written(tmp_path / "photo.jpg", 320, 240)
    thumbnail = b"\xff\xe1\x00\x06\xff\xd8\xff\xd9"  # it has an end of its own
    whole = content[:2] + thumbnail + content[2:]
    (tmp_path / "photo.jpg").write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(InputError, match=r"photo\.jpg: is no photo"):
        read_reduced(tmp_path / "photo.jpg", lambda _: reduction)
    with pytest.raises(InputError, match=r"photo\.jpg: is no photo"):
        read_pixels(tmp_path / "photo.jpg", (320, 240))


@pytest.mark.parametrize("suffix", ["jpg", "png"])
def test_pixels_take_the_room_of_others_where_these_are_as_many(
    tmp_path: Path, suffix: str
) -> None:
    path = tmp_path / f"photo.{suffix}"
    written(path, 320, 240)
    wanted = read_pixels(path)
    for height, width in ((240, 320), (320, 240), (241, 320)):
        room = np.zeros((height, width, 3), np.uint8)
        pixels = read_pixels(path, (320, 240), room)
        np.testing.assert_array_equal(pixels, wanted)
        assert (pixels is room) == (room.shape == wanted.shape)


def test_a_header_that_promises_more_than_there_can_be_is_refused(tmp_path: Path) -> None:
    content = written(tmp_path / "photo.jpg", 320, 240)
    size = content.index(b"\x00\xf0\x01\x40")
    (tmp_path / "photo.jpg").write_bytes(content[:size] + b"\xff\xff" * 2 + content[size + 4 :])
    with pytest.raises(InputError, match=r"photo\.jpg: is no photo"):
        read_reduced(tmp_path / "photo.jpg", lambda _: 1)


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    """Of ground with grains of many sizes."""
    rng = np.random.default_rng(5)
    layers = [
        cv2.resize(rng.normal(0, 14, (6 << k, 8 << k)), (1024, 768), interpolation=cv2.INTER_CUBIC)
        for k in range(7)
    ]
    path = tmp_path / "ground.png"
    assert cv2.imwrite(str(path), np.clip(sum(layers) + 120, 0, 255).astype(np.uint8))
    return path


@pytest.mark.parametrize(("suffix", "quality"), [(".jpg", 95), (".jpg", 30), (".png", 0)])
def test_a_photo_saved_anew_shows_the_same(photo: Path, suffix: str, quality: int) -> None:
    again = photo.with_name(f"again{suffix}")
    options = [cv2.IMWRITE_JPEG_QUALITY, quality] if quality else []
    assert cv2.imwrite(str(again), read_pixels(photo), options)

    assert is_same_exposure(str(photo), str(again))
    assert is_same_exposure(str(again), str(photo))


def test_a_photo_of_the_same_place_from_beside_does_not(photo: Path) -> None:
    beside = photo.with_name("beside.png")
    assert cv2.imwrite(str(beside), np.roll(read_pixels(photo), 24, axis=1))

    assert not is_same_exposure(str(photo), str(beside))


def test_plain_pictures_of_two_greys_are_no_copies(tmp_path: Path) -> None:
    one, other = (tmp_path / name for name in ("one.png", "other.png"))
    for path, grey in ((one, 90), (other, 140)):
        assert cv2.imwrite(str(path), np.full((300, 400, 3), grey, np.uint8))

    assert not is_same_exposure(str(one), str(other))


def test_photos_of_a_flight_are_no_copies(data_dir: Path) -> None:
    photos = sorted((data_dir / "street_nadir" / "photos").glob("*.jpg"))
    assert not any(is_same_exposure(str(one), str(other)) for one, other in pairwise(photos))
