"""Pixels of photo files."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest

from uavgram.errors import InputError
from uavgram.imaging.photos.decoding import (
    REDUCED,
    halve_with_opacity,
    is_same_exposure,
    make_reduced_copies,
    read_pixels,
    read_reduced,
    scale_to_original,
    shrink,
)
from uavgram.imaging.photos.preview import Pixels
from uavgram.model.arrays import Floats


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
    shade = np.linspace(0.0, 12.0, 400) * np.ones((300, 1))  # as of a lens
    for shading in (0.0 * shade, shade):
        for path, grey in ((one, 90), (other, 140)):
            pixels = np.repeat((grey + shading)[..., None], 3, axis=2)
            assert cv2.imwrite(str(path), pixels.astype(np.uint8))
        assert not is_same_exposure(str(one), str(other))


def test_photos_of_a_flight_are_no_copies(data_dir: Path) -> None:
    photos = sorted((data_dir / "street_nadir" / "photos").glob("*.jpg"))
    assert not any(is_same_exposure(str(one), str(other)) for one, other in pairwise(photos))


# Reduction of pictures.


def means(values: Floats, size: int) -> Floats:
    """Along the first axis: each mean over its share of a step function."""
    total = np.concatenate([[np.zeros(values.shape[1:])], np.cumsum(values, axis=0)])
    edges = np.linspace(0, len(values), size + 1)
    low = np.minimum(edges.astype(int), len(values) - 1)
    at = total[low] + (edges - low).reshape(-1, *[1] * (values.ndim - 1)) * values[low]
    return np.asarray(np.diff(at, axis=0) * size / len(values))


@pytest.mark.parametrize(
    ("height", "width", "longest"), [(90, 120, 97), (240, 320, 75), (96, 64, 12)]
)
def test_each_pixel_is_the_mean_of_what_it_covers(height: int, width: int, longest: int) -> None:
    v, u = np.mgrid[:height, :width]
    picture = (
        127 + 60 * np.sin(0.05 * u)[..., None] * [1, 0.5, -1] + 60 * np.cos(0.07 * v)[..., None]
    )
    found = shrink(picture.astype(np.uint8), longest)
    rows, columns = found.shape[:2]
    assert max(rows, columns) == longest
    expected = means(means(picture.astype(float), rows).swapaxes(0, 1), columns).swapaxes(0, 1)
    assert np.abs(found - expected).max() < 3.0  # of halves of halves, at edges that cut a pixel
    assert abs(float((found - expected).mean())) < 0.7  # OpenCV cuts fractions off


def test_odd_sides_move_a_feature_nowhere() -> None:
    picture = np.zeros((301, 403), np.uint8)
    picture[:, 390:] = 200
    found = shrink(picture, 100).astype(float)
    edge = found.shape[1] - float((found / 200).mean(axis=0).sum())
    assert edge == pytest.approx(390 * 100 / 403, abs=0.02)


def test_what_is_small_enough_stays() -> None:
    picture = np.zeros((30, 40), np.uint8)
    assert shrink(picture, 40) is picture
    assert shrink(picture.T, 30, across_only=True).shape == (40, 30)


@pytest.mark.parametrize("shape", [(403, 605), (605, 403)])
def test_a_spot_is_where_the_copy_says(shape: tuple[int, int]) -> None:
    v, u = np.indices(shape)
    spot = np.array([222.3, 301.8]) if shape[0] > shape[1] else np.array([301.8, 222.3])
    light = 200.0 * np.exp(-0.5 * ((u - spot[0]) ** 2 + (v - spot[1]) ** 2) / 15.0**2)
    photo = np.round(light).astype(np.uint8)
    factors = []
    for factor, small in make_reduced_copies(photo, (100, 200, 400, 800)):
        factors.append(factor)
        weight = small.astype(float)
        row, column = np.indices(small.shape)
        middle = np.array([(column * weight).sum(), (row * weight).sum()]) / weight.sum()
        np.testing.assert_allclose(scale_to_original(middle, factor), spot, atol=0.05)
    assert factors == [6, 3, 1]


def blocks(rgba: Pixels) -> Floats:
    """(h, w, 4, channels) of the four pixels behind each of an even picture."""
    height, width = rgba.shape[0] // 2, rgba.shape[1] // 2
    split = rgba.astype(float).reshape(height, 2, width, 2, -1)
    return np.moveaxis(split, 2, 1).reshape(height, width, 4, -1)


@pytest.fixture
def picture() -> Pixels:
    """Noise, of which a random part is transparent (and then black), some of it half."""
    rng = np.random.default_rng(3)
    rgba = rng.integers(0, 256, (64, 96, 4)).astype(np.uint8)
    rgba[..., 3] = rng.choice([0, 128, 255], (64, 96), p=[0.3, 0.1, 0.6])
    rgba[rgba[..., 3] == 0] = 0
    return rgba


def test_colours_are_means_weighted_by_opacity(picture: Pixels) -> None:
    four = blocks(picture)
    weight = four[..., 3:]
    with np.errstate(invalid="ignore"):
        mean = np.nan_to_num((four[..., :3] * weight).sum(2) / weight.sum(2))

    half = halve_with_opacity(picture)

    assert half.shape == (32, 48, 4)
    assert np.abs(half[..., :3] - mean).max() <= 0.5
    assert np.abs(half[..., 3] - four[..., 3].mean(axis=2)).max() <= 0.5


def test_where_all_is_opaque_it_is_the_plain_mean(picture: Pixels) -> None:
    picture[..., 3] = 255

    assert np.abs(halve_with_opacity(picture) - blocks(picture).mean(axis=2)).max() <= 0.5


def test_an_odd_last_row_and_column_stand_for_themselves() -> None:
    rgba = np.full((5, 3, 4), 255, np.uint8)
    rgba[4, :, :3], rgba[:, 2, 0] = 10, 77

    half = halve_with_opacity(rgba)

    assert half.shape == (3, 2, 4)
    np.testing.assert_array_equal(half[2, 0], [10, 10, 10, 255])
    np.testing.assert_array_equal(half[0, 1], [77, 255, 255, 255])
