"""Whether all that surrounds a match is alike: textures known at every place."""

from __future__ import annotations

import numpy as np
import pytest
from textures import Texture

from uavgram.imaging.matching.quarters import HALF, least_likeness
from uavgram.imaging.raster import Image
from uavgram.model.arrays import Floats

SHAPE = (120, 140)
AT = np.array([66.0, 58.0])
TURN = np.array([[0.96, -0.28], [0.28, 0.96]])


def photo(affine: Floats, shift: Floats, seed: int, texture_seed: int = 5) -> Image:
    """Pixels of the texture at affine (pixel) + shift."""
    return Texture.random(texture_seed).photo(
        SHAPE, affine, shift, 1.5, np.random.default_rng(seed)
    )


def test_flat_ground_is_alike_all_around_also_in_a_turned_photo() -> None:
    source = photo(np.eye(2), np.zeros(2), 1)
    there = np.array([60.0, 63.0])
    target = photo(TURN.T, AT - TURN.T @ there, 2)

    assert least_likeness(source, target, AT, there, TURN) > 0.9


@pytest.mark.parametrize("quarter", range(4))
def test_another_thing_in_one_quarter_is_seen(quarter: int) -> None:
    source, target = (photo(np.eye(2), np.zeros(2), seed) for seed in (1, 2))
    other = photo(np.eye(2), np.zeros(2), 3, texture_seed=6)
    u, v = AT.astype(int)
    rows = slice(v - HALF, v) if quarter < 2 else slice(v + 1, v + HALF + 1)
    columns = slice(u - HALF, u) if quarter % 2 else slice(u + 1, u + HALF + 1)
    target[rows, columns] = other[rows, columns]

    assert least_likeness(source, target, AT, AT, np.eye(2)) < 0.5


def test_what_is_too_even_to_compare_is_not_alike() -> None:
    even = np.full(SHAPE, 90, np.uint8)

    assert least_likeness(even, even, AT, AT, np.eye(2)) == -1.0
