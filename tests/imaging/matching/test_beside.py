"""Whether all that surrounds a match has one place along its line of sight."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from uavgram.imaging.matching.beside import fixed_on_all_sides
from uavgram.imaging.matching.least_squares import fitted
from uavgram.imaging.patches import Grey

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
        there = fitted(*pair, np.zeros((1, 2)), np.eye(2)[None], HALF, 12)
        fixed.append(fixed_on_all_sides(*pair, there, ALONG)[0])
    return float(np.mean(fixed))


@pytest.mark.parametrize(("make", "least", "most"), [(blot, 0.8, 1.0), (edge, 0.0, 0.05)])
def test_noise_hides_no_side_and_an_edge_along_the_line_fixes_none(
    make: object, least: float, most: float
) -> None:
    assert least <= share_fixed(make, np.random.default_rng(5)) <= most
