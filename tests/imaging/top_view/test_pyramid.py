"""Halving against sums over blocks of four."""

from __future__ import annotations

import numpy as np
import pytest

from uavgram.imaging.photos.preview import Pixels
from uavgram.imaging.top_view.pyramid import halved
from uavgram.model.arrays import Floats


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

    half = halved(picture)

    assert half.shape == (32, 48, 4)
    assert np.abs(half[..., :3] - mean).max() <= 0.5
    assert np.abs(half[..., 3] - four[..., 3].mean(axis=2)).max() <= 0.5


def test_where_all_is_opaque_it_is_the_plain_mean(picture: Pixels) -> None:
    picture[..., 3] = 255

    assert np.abs(halved(picture) - blocks(picture).mean(axis=2)).max() <= 0.5


def test_an_odd_last_row_and_column_stand_for_themselves() -> None:
    rgba = np.full((5, 3, 4), 255, np.uint8)
    rgba[4, :, :3], rgba[:, 2, 0] = 10, 77

    half = halved(rgba)

    assert half.shape == (3, 2, 4)
    np.testing.assert_array_equal(half[2, 0], [10, 10, 10, 255])
    np.testing.assert_array_equal(half[0, 1], [77, 255, 255, 255])
