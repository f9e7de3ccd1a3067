"""Polygons on the ground, against matplotlib's paths and OpenCV's rectangles."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.path import Path as Outline
from scipy.stats import chi2

from uavgram.geometry.ground.figures import (
    ELLIPSE_95,
    ELLIPSOID_95,
    error_ellipse,
    error_ellipsoid,
    find_long_axis,
    mark_crossing_segments,
    mark_points_inside,
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
    np.testing.assert_array_equal(
        mark_points_inside(corner, point), Outline(corner).contains_points(point)
    )


@pytest.mark.parametrize("seed", range(4))
def test_what_crosses_has_a_point_inside(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corner = star(rng)
    start, end = rng.uniform(-12, 12, (2, 400, 2))
    share = np.linspace(0, 1, 2001)[:, None, None]
    along = (start + share * (end - start)).reshape(-1, 2)
    inside = Outline(corner).contains_points(along).reshape(2001, -1).any(axis=0)
    different = inside != mark_crossing_segments(corner, start, end)
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


# Error ellipses against eigenvectors.


def test_level_is_the_root_of_the_chi_square_quantile() -> None:
    assert pytest.approx(np.sqrt(chi2.ppf(0.95, 2)), rel=1e-14) == ELLIPSE_95
    assert pytest.approx(2.4477, abs=5e-5) == ELLIPSE_95


def test_axes_are_those_of_the_eigenvectors() -> None:
    half = np.random.default_rng(1).normal(size=(300, 2, 2))
    covariance = half @ np.swapaxes(half, 1, 2)
    values, axes = np.linalg.eigh(covariance)
    major, minor, azimuth = error_ellipse(covariance)
    np.testing.assert_allclose(major**2, values[:, 1], rtol=1e-12)
    np.testing.assert_allclose(minor**2, values[:, 0], rtol=1e-9, atol=1e-12)
    direction = np.stack([np.sin(azimuth), np.cos(azimuth)], -1)  # east, north
    np.testing.assert_allclose(np.abs(np.sum(direction * axes[:, :, 1], 1)), 1, atol=1e-12)
    assert ((azimuth >= 0) & (azimuth < np.pi)).all()


@pytest.mark.parametrize(
    ("covariance", "expected"),
    [
        ([[1, 0], [0, 4]], (2, 1, 0)),
        ([[4, 0], [0, 1]], (2, 1, np.pi / 2)),
        ([[4, -0.0], [-0.0, 1]], (2, 1, np.pi / 2)),
        ([[2.5, 1.5], [1.5, 2.5]], (2, 1, np.pi / 4)),
        ([[2.5, -1.5], [-1.5, 2.5]], (2, 1, 3 * np.pi / 4)),
        ([[9, 0], [0, 9]], (3, 3, 0)),
        ([[1, 1], [1, 1]], (np.sqrt(2), 0, np.pi / 4)),
        ([[0, 0], [0, 0]], (0, 0, 0)),
        ([[1, -1e-30], [-1e-30, 4]], (2, 1, 0)),
        ([[1, 1 + 1e-13], [1 + 1e-13, 1]], (np.sqrt(2), 0, np.pi / 4)),
    ],
)
def test_ellipses_by_hand(covariance: list[list[float]], expected: tuple[float, ...]) -> None:
    np.testing.assert_allclose(error_ellipse(np.array(covariance, float)), expected, atol=1e-12)


@pytest.mark.parametrize(
    "wrong",
    [[[1, 2], [2, 1]], [[-1, 0], [0, -2]], [[np.nan, 0], [0, 1]], [[1e-12, 2e-12], [2e-12, 1e-12]]],
)
def test_what_is_no_covariance_has_no_ellipse(
    wrong: list[list[float]],
) -> None:
    assert np.isnan(error_ellipse(np.array(wrong, float))).all()


@given(st.floats(0.01, 100), st.floats(0, 0.99), st.floats(0, 3.14), st.floats(-3, 3))
def test_turning_the_covariance_turns_the_ellipse(
    major: float, ratio: float, azimuth: float, turn: float
) -> None:
    def covariance(angle: float) -> Floats:
        axis = np.array([np.sin(angle), np.cos(angle)])
        other = np.array([axis[1], -axis[0]])
        return major**2 * (np.outer(axis, axis) + ratio**2 * np.outer(other, other))

    before, after = (error_ellipse(covariance(a)) for a in (azimuth, azimuth + turn))
    np.testing.assert_allclose(before[0], after[0], rtol=1e-9)
    assert np.sin(after[2] - before[2] - turn) == pytest.approx(0, abs=1e-9)


def test_inputs_stay_as_they_were() -> None:
    covariance = np.eye(2)
    covariance.flags.writeable = False
    error_ellipse(covariance)


def test_the_ellipsoid_s_level_is_the_root_of_the_chi_square_quantile() -> None:
    assert pytest.approx(np.sqrt(chi2.ppf(0.95, 3)), rel=1e-14) == ELLIPSOID_95


def test_ellipsoids_hold_as_many_draws_as_their_level_says_and_are_right_handed() -> None:
    rng = np.random.default_rng(4)
    root = rng.normal(size=(20, 3, 3))
    covariance = root @ np.swapaxes(root, 1, 2)
    half_axes, directions = error_ellipsoid(covariance)
    draws = np.einsum("nij,ndj->ndi", root, rng.normal(size=(20, 4000, 3)))
    along = np.einsum("ndi,nij->ndj", draws, directions) / (ELLIPSOID_95 * half_axes)[:, None]

    assert np.mean(np.sum(along**2, axis=2) <= 1) == pytest.approx(0.95, abs=0.004)
    np.testing.assert_allclose(along.std(axis=1), 1 / ELLIPSOID_95, rtol=0.06)
    np.testing.assert_allclose(np.linalg.det(directions), 1.0, rtol=1e-12)
    assert (np.diff(half_axes, axis=1) <= 0).all()
