"""Photos reduced for looking at."""

from __future__ import annotations

import struct
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest

from uavgram.errors import InputError
from uavgram.imaging.photos.decode import jpeg_size, read_pixels
from uavgram.imaging.photos.preview import (
    Pixels,
    decode_preview,
    make_preview,
    make_preview_of_decoded,
    read_preview,
    shrink_jpeg,
)
from uavgram.model.arrays import Floats


def photo(width: int, height: int, colour: tuple[int, int, int] = (1, 1, 1)) -> Pixels:
    """Well exposed RGB photo with a dark blob a quarter from the left, a third from the top."""
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    sigma = width / 60
    blob = np.exp(-((u - width / 4) ** 2 + (v - height / 3) ** 2) / (2 * sigma**2))
    ground = np.linspace(170, 240, width)[:, None]
    return np.asarray(ground - 150 * blob[..., None] * colour, dtype=np.uint8)


def write(path: Path, rgb: Pixels) -> Path:
    assert cv2.imwrite(str(path), rgb[:, :, ::-1])
    return path


def centroid(rgb: Pixels) -> Floats:
    weight = 130 - rgb[..., 0].astype(float)
    weight[weight < 0] = 0
    v, u = np.indices(weight.shape)
    place: Floats = np.array([(u * weight).sum(), (v * weight).sum()]) / weight.sum()
    return place


@pytest.mark.parametrize("suffix", ["jpg", "png"])
@pytest.mark.parametrize(
    ("width", "height", "asked"),
    [(1603, 1201, 400), (1603, 1201, 333), (803, 602, 700), (301, 202, 800)],
)
def test_the_scale_leads_back_to_original_pixels(
    tmp_path: Path, suffix: str, width: int, height: int, asked: int
) -> None:
    rgb = photo(width, height)
    preview, pixels = read_preview(write(tmp_path / f"photo.{suffix}", rgb), asked)
    small = decode_preview(preview)
    back = (centroid(small) + 0.5) * preview.scale - 0.5

    assert small.shape == pixels.shape == (preview.height_px, preview.width_px, 3)
    assert preview.width_px <= min(asked, width)
    assert preview.width_px >= 0.8 * min(asked, width)
    np.testing.assert_allclose(back, centroid(rgb), atol=0.15)


@pytest.mark.parametrize("suffix", ["jpg", "png"])
@pytest.mark.parametrize(
    ("width", "height"), [(600, 500), (1600, 1200), (1603, 1201), (3203, 2401)]
)
def test_a_photo_of_which_all_is_wanted_has_the_preview_of_any_other(
    tmp_path: Path, suffix: str, width: int, height: int
) -> None:
    path = write(tmp_path / f"photo.{suffix}", photo(width, height))
    other, reduced = read_preview(path, 400)
    preview, pixels, halves = make_preview_of_decoded(read_pixels(path), 400)

    np.testing.assert_array_equal(halves[0], cv2.imread(str(path)))
    for large, small in pairwise(halves):  # means of 2 x 2
        even = large[: large.shape[0] // 2 * 2, : large.shape[1] // 2 * 2].astype(float)
        means = even.reshape(even.shape[0] // 2, 2, -1, 2, 3).mean(axis=(1, 3))
        np.testing.assert_allclose(small[: len(means), : means.shape[1]], means, atol=0.5)
    assert (preview.scale, pixels.shape, preview.tone) == (other.scale, reduced.shape, other.tone)
    assert np.abs(pixels.astype(float) - reduced).mean() < 1.0
    assert np.abs(pixels.astype(float) - reduced).max() < 8.0


def test_colours_stay_in_their_channels(tmp_path: Path) -> None:
    preview, _ = read_preview(write(tmp_path / "photo.png", photo(400, 300, (1, 0, 0))), 200)
    red, green, blue = decode_preview(preview)[50, 50].astype(int)

    assert red < 60
    assert green > 170
    assert blue > 170


def test_the_rotation_in_exif_is_not_applied(tmp_path: Path) -> None:
    path = write(tmp_path / "photo.jpg", photo(400, 300))
    # Exif 2.32, 4.6.4: one IFD with one SHORT, tag 0x0112 (orientation) = 6: a quarter turn
    tiff = b"MM\x00*\x00\x00\x00\x08\x00\x01" + struct.pack(">HHIHHI", 0x0112, 3, 1, 6, 0, 0)
    segment = b"Exif\x00\x00" + tiff
    plain = path.read_bytes()
    header = b"\xff\xe1" + struct.pack(">H", len(segment) + 2)
    path.write_bytes(plain[:2] + header + segment + plain[2:])
    preview, _ = read_preview(path, 400)

    read = cv2.imread(str(path))
    assert read is not None
    assert read.shape[:2] == (400, 300)  # OpenCV would turn it
    assert (preview.width_px, preview.height_px) == (400, 300)


def test_the_size_in_the_header_is_that_of_the_pixels(tmp_path: Path) -> None:
    path = write(tmp_path / "photo.jpg", photo(123, 45))

    assert jpeg_size(path.read_bytes()) == (123, 45)
    assert jpeg_size(b"\x89PNG") is None
    assert jpeg_size(path.read_bytes()[:30]) is None


@pytest.mark.parametrize("content", [b"", b"no photo", b"\xff\xd8\xff\xe0\x00\x10JFIF"])
def test_a_file_that_is_no_photo_is_an_input_error_that_names_it(
    tmp_path: Path, content: bytes
) -> None:
    path = tmp_path / "photo.jpg"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"photo\.jpg: is no photo"):
        read_preview(path)


def test_a_missing_photo_is_an_input_error_that_names_it(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"gone\.jpg: cannot be read: No such file"):
        read_preview(tmp_path / "gone.jpg")


def test_a_real_photo_keeps_its_shape(data_dir: Path) -> None:
    preview, _ = read_preview(data_dir / "brighton_beach" / "DJI_0025.JPG", 1000)
    size = jpeg_size((data_dir / "brighton_beach" / "DJI_0025.JPG").read_bytes())
    assert size is not None
    width, height = size

    assert preview.width_px * preview.scale[0] == pytest.approx(width, abs=8)
    assert preview.height_px * preview.scale[1] == pytest.approx(height, abs=8)
    assert len(preview.jpeg) < 300_000


def test_a_decoded_photo_is_reduced_as_its_file_is() -> None:
    rng = np.random.default_rng(0)
    noise = rng.integers(0, 255, (900, 1200)).astype(np.uint8)
    grey = np.asarray(cv2.GaussianBlur(noise, (0, 0), 8), np.uint8)
    preview = make_preview(grey, 400)
    assert (preview.width_px, preview.height_px) == (400, 300)
    assert preview.scale == (3.0, 3.0)
    mean = grey.reshape(300, 3, 400, 3).mean(axis=(1, 3))
    assert np.abs(decode_preview(preview)[..., 0] - mean).mean() < 2.0
    assert jpeg_size(shrink_jpeg(preview.jpeg, 100)) == (100, 75)
    assert jpeg_size(shrink_jpeg(preview.jpeg, 1000)) == (400, 300)
