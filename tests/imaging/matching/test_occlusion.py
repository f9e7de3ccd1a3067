"""Occlusions about a point: shifted windows, and quarters of its surroundings."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from textures import Texture

from uavgram.imaging.matching.least_squares import fit_patches
from uavgram.imaging.matching.occlusion import (
    HALF_SQUARE,
    compute_worst_quarter_correlation,
    find_unoccluded,
)
from uavgram.imaging.patches import Grey
from uavgram.imaging.raster import Image
from uavgram.model.arrays import Floats

SIDE, HALF = 51, 10
ALONG = np.array([[0.0, 1.0]])
NOISE = 2.5


def blot(rng: np.random.Generator) -> Grey:
    """A dark, nearly even spot on rough ground, as a manhole is."""
    grain = cv2.GaussianBlur(rng.normal(0.0, 40.0, (SIDE, SIDE)), (0, 0), 1.8)
    spot = np.zeros((SIDE, SIDE))
    cv2.circle(spot, (SIDE // 2, SIDE // 2), 7, 1.0, -1)
    inside = cv2.GaussianBlur(spot, (0, 0), 1.0)
    ground = 120.0 + grain * (1.0 - 0.4 * inside) - 20.0 * inside
    return np.asarray(cv2.GaussianBlur(ground, (0, 0), 0.8), np.float32)


def edge(rng: np.random.Generator) -> Grey:
    """An edge along the line of sight, both sides even: it may be anywhere."""
    beside = np.where(np.arange(SIDE) < SIDE // 2, 60.0, 150.0) + np.zeros((SIDE, 1))
    beside += rng.normal(0.0, 0.2, beside.shape)
    return np.asarray(cv2.GaussianBlur(beside, (0, 0), 0.8), np.float32)


def share_fixed(make: object, rng: np.random.Generator, count: int = 60) -> float:
    """Of pairs of noisy photos of one thing."""
    fixed = []
    for _ in range(count):
        ground = make(rng)  # type: ignore[operator]
        near, far = (
            (ground + rng.normal(0.0, NOISE, ground.shape)).astype(np.float32) for _ in range(2)
        )
        pair = near[None], far[None]
        there = fit_patches(*pair, np.zeros((1, 2)), np.eye(2)[None], HALF, 12)
        fixed.append(find_unoccluded(*pair, there, ALONG)[0])
    return float(np.mean(fixed))


@pytest.mark.parametrize(("make", "least", "most"), [(blot, 0.8, 1.0), (edge, 0.0, 0.05)])
def test_noise_hides_no_side_and_an_edge_along_the_line_fixes_none(
    make: object, least: float, most: float
) -> None:
    assert least <= share_fixed(make, np.random.default_rng(5)) <= most


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

    assert compute_worst_quarter_correlation(source, target, AT, there, TURN) > 0.9


@pytest.mark.parametrize("quarter", range(4))
def test_another_thing_in_one_quarter_is_seen(quarter: int) -> None:
    source, target = (photo(np.eye(2), np.zeros(2), seed) for seed in (1, 2))
    other = photo(np.eye(2), np.zeros(2), 3, texture_seed=6)
    u, v = AT.astype(int)
    rows = slice(v - HALF_SQUARE, v) if quarter < 2 else slice(v + 1, v + HALF_SQUARE + 1)
    columns = slice(u - HALF_SQUARE, u) if quarter % 2 else slice(u + 1, u + HALF_SQUARE + 1)
    target[rows, columns] = other[rows, columns]

    assert compute_worst_quarter_correlation(source, target, AT, AT, np.eye(2)) < 0.5


def test_what_is_too_even_to_compare_is_not_alike() -> None:
    even = np.full(SHAPE, 90, np.uint8)

    assert compute_worst_quarter_correlation(even, even, AT, AT, np.eye(2)) == -1.0
