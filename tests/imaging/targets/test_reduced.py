"""Reduced copies keep their places."""

from __future__ import annotations

import numpy as np
import pytest

from uavgram.imaging.targets.reduced import reduced_copies, to_full_size


@pytest.mark.parametrize("shape", [(403, 605), (605, 403)])
def test_a_spot_is_where_the_copy_says(shape: tuple[int, int]) -> None:
    v, u = np.indices(shape)
    spot = np.array([222.3, 301.8]) if shape[0] > shape[1] else np.array([301.8, 222.3])
    light = 200.0 * np.exp(-0.5 * ((u - spot[0]) ** 2 + (v - spot[1]) ** 2) / 15.0**2)
    photo = np.round(light).astype(np.uint8)
    factors = []
    for factor, small in reduced_copies(photo, (100, 200, 400, 800)):
        factors.append(factor)
        weight = small.astype(float)
        row, column = np.indices(small.shape)
        middle = np.array([(column * weight).sum(), (row * weight).sum()]) / weight.sum()
        np.testing.assert_allclose(to_full_size(middle, factor), spot, atol=0.05)
    assert factors == [6, 3, 1]
