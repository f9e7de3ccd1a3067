"""Smaller pictures, against means taken over each pixel's area."""

from __future__ import annotations

import numpy as np
import pytest

from uavgram.imaging.photos.shrink import shrunk
from uavgram.model.arrays import Floats


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
    found = shrunk(picture.astype(np.uint8), longest)
    rows, columns = found.shape[:2]
    assert max(rows, columns) == longest
    expected = means(means(picture.astype(float), rows).swapaxes(0, 1), columns).swapaxes(0, 1)
    assert np.abs(found - expected).max() < 3.0  # of halves of halves, at edges that cut a pixel
    assert abs(float((found - expected).mean())) < 0.7  # OpenCV cuts fractions off


def test_odd_sides_move_a_feature_nowhere() -> None:
    picture = np.zeros((301, 403), np.uint8)
    picture[:, 390:] = 200
    found = shrunk(picture, 100).astype(float)
    edge = found.shape[1] - float((found / 200).mean(axis=0).sum())
    assert edge == pytest.approx(390 * 100 / 403, abs=0.02)


def test_what_is_small_enough_stays() -> None:
    picture = np.zeros((30, 40), np.uint8)
    assert shrunk(picture, 40) is picture
    assert shrunk(picture.T, 30, across_only=True).shape == (40, 30)
