"""Polygons on the ground, against matplotlib's paths and OpenCV's rectangles."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from matplotlib.path import Path as Outline

from uavgram.geometry.ground.polygons import (
    contains,
    crosses,
    find_long_axis,
    orient_counterclockwise,
    signed_area,
    squares_on_plane,
)
from uavgram.model.arrays import Floats


def star(rng: np.random.Generator, corners: int = 9) -> Floats:
    """A polygon that is not convex and does not cross itself, counterclockwise."""
    turn = np.sort(rng.uniform(0, 2 * np.pi, corners))
    away: Floats = rng.uniform(2, 10, corners)[:, None] * np.column_stack(
        [np.cos(turn), np.sin(turn)]
    )
    return away


@pytest.mark.parametrize("seed", range(4))
def test_points_inside_are_those_of_matplotlib(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corner, point = star(rng), rng.uniform(-10, 10, (3000, 2))
    np.testing.assert_array_equal(contains(corner, point), Outline(corner).contains_points(point))


@pytest.mark.parametrize("seed", range(4))
def test_what_crosses_has_a_point_inside(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corner = star(rng)
    start, end = rng.uniform(-12, 12, (2, 400, 2))
    share = np.linspace(0, 1, 2001)[:, None, None]
    along = (start + share * (end - start)).reshape(-1, 2)
    inside = Outline(corner).contains_points(along).reshape(2001, -1).any(axis=0)
    different = inside != crosses(corner, start, end)
    assert different.mean() < 0.01  # such as cut a corner between two steps
    assert not (inside & different).any()


def test_area_and_sense() -> None:
    square = np.array([[0.0, 0], [0, 3], [4, 3], [4, 0], [0, 0]])
    assert signed_area(square) == pytest.approx(-12.0)
    turned = orient_counterclockwise(square)
    assert len(turned) == 4
    assert signed_area(turned) == pytest.approx(12.0)


@pytest.mark.parametrize("seed", range(5))
def test_the_smallest_rectangle_is_that_of_opencv(seed: int) -> None:
    corner = star(np.random.default_rng(seed))
    middle, axis, size = find_long_axis(corner)
    center, sides, _ = cv2.minAreaRect(corner.astype(np.float32))
    assert np.prod(size) == pytest.approx(np.prod(sides), rel=1e-4)
    assert size[0] >= size[1]
    np.testing.assert_allclose(middle, center, atol=1e-3)
    np.testing.assert_allclose(np.ptp(corner @ axis), size[0], rtol=1e-9)


def test_sides_and_diagonals_are_those_of_a_square_that_lies_on_the_plane() -> None:
    slope, turn = np.array([0.3, -0.2]), np.deg2rad([0.0, 33.0, 250.0])
    middle = np.array([[1.0, 2.0, 3.0], [0.0, 0.0, 0.0], [-5.0, 4.0, 1.0]])
    corner = squares_on_plane(middle, slope, turn, 0.6)
    side = np.roll(corner, -1, axis=1) - corner
    np.testing.assert_allclose(np.linalg.norm(side, axis=-1), 0.6)
    diagonal = np.linalg.norm(corner[:, [2, 3]] - corner[:, [0, 1]], axis=-1)
    np.testing.assert_allclose(diagonal, 0.6 * np.sqrt(2.0))
    away = corner - middle[:, None]
    np.testing.assert_allclose(away[..., 2], away[..., :2] @ slope, atol=1e-12)
    np.testing.assert_allclose(np.arctan2(side[:, 0, 1], side[:, 0, 0]) % (2 * np.pi), turn)
    assert (np.cross(side[:, 0], side[:, 1])[:, 2] > 0).all()  # counterclockwise
