"""One exposure in several files is told from photos of the same place."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest

from uavgram.imaging.photos.alike import shows_the_same
from uavgram.imaging.photos.decode import read_pixels


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

    assert shows_the_same(str(photo), str(again))
    assert shows_the_same(str(again), str(photo))


def test_a_photo_of_the_same_place_from_beside_does_not(photo: Path) -> None:
    beside = photo.with_name("beside.png")
    assert cv2.imwrite(str(beside), np.roll(read_pixels(photo), 24, axis=1))

    assert not shows_the_same(str(photo), str(beside))


def test_photos_of_a_flight_are_no_copies(data_dir: Path) -> None:
    photos = sorted((data_dir / "street_nadir" / "photos").glob("*.jpg"))
    assert not any(shows_the_same(str(one), str(other)) for one, other in pairwise(photos))
