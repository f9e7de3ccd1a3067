"""Rays and the ground plane."""

from __future__ import annotations

import numpy as np
import pytest
from derivatives import assert_derivative, central_differences
from hypothesis import given
from hypothesis import strategies as st

from uavgram.geometry.ground.plane import intersect_ground, intersect_ground_with_jacobian
from uavgram.model.arrays import Floats

PLANE = np.array([1.5, 0.02, -0.05])
PIVOT = np.array([10.0, -20.0])


def scene(count: int = 40) -> tuple[Floats, Floats, Floats]:
    rng = np.random.default_rng(1)
    center = rng.uniform(-50, 50, (count, 3)) + np.array([0, 0, 90])
    ray = rng.uniform(-1, 1, (count, 3)) - [0, 0, 2]
    return center, ray, rng.uniform(-1, 2, count)


def test_straight_down_onto_level_ground() -> None:
    point = intersect_ground(np.array([3.0, 4, 50]), np.array([0, 0, -2.0]), np.zeros(3), PIVOT)
    np.testing.assert_array_equal(point, [3, 4, 0])


def test_half_a_right_angle_on_a_slope_by_hand() -> None:
    # up = 0.25 east; from 10 m above the pivot going east and down: 10 - s = 0.25 s, s = 8.
    plane, down_east = np.array([0, 0.25, 0]), np.array([1.0, 0, -1])
    point = intersect_ground(np.array([0.0, 0, 10]), down_east, plane, np.zeros(2))
    np.testing.assert_allclose(point, [8, 0, 2])


def test_points_lie_on_the_plane_at_their_height_and_on_the_ray() -> None:
    center, ray, above = scene()
    point = intersect_ground(center, ray, PLANE, PIVOT, above)
    height = PLANE[0] + (point[:, :2] - PIVOT) @ PLANE[1:] + above
    np.testing.assert_allclose(point[:, 2], height, atol=1e-12)
    np.testing.assert_allclose(np.cross(point - center, ray), 0, atol=1e-11)


@pytest.mark.parametrize(
    ("center", "ray"),
    [
        ((0, 0, 50), (1, 0, 0)),
        ((0, 0, 50), (0, 0, 1)),
        ((0, 0, 50), (1, 0, 0.1)),
        ((0, 0, -5), (0, 0, -1)),
        ((0, 0, -5), (0, 0, 1)),
        ((0, 0, 50), (1, 0, -1e-310)),
        ((0, 0, 50), (np.nan, 0, -1)),
    ],
)
def test_no_meeting_is_nan_throughout(center: tuple[float, ...], ray: tuple[float, ...]) -> None:
    answers = intersect_ground_with_jacobian(
        np.array(center, float), np.array(ray, float), np.zeros(3), np.zeros(2)
    )
    assert all(np.isnan(answer).all() for answer in answers)
    assert [answer.shape for answer in answers] == [(3,), (3, 3), (3, 3), (3, 3)]


def test_derivatives_equal_central_differences() -> None:
    center, ray, above = scene()
    point, d_center, d_ray, d_plane = intersect_ground_with_jacobian(
        center, ray, PLANE, PIVOT, above
    )
    np.testing.assert_array_equal(point, intersect_ground(center, ray, PLANE, PIVOT, above))
    meet = intersect_ground
    by_center = central_differences(lambda c: meet(c, ray, PLANE, PIVOT, above), center, 1e-3)
    by_ray = central_differences(lambda r: meet(center, r, PLANE, PIVOT, above), ray, 1e-4)
    by_plane = central_differences(lambda p: meet(center, ray, p, PIVOT, above), PLANE, 1e-4)
    assert_derivative(d_center, by_center)
    assert_derivative(d_ray, by_ray)
    assert_derivative(d_plane, by_plane)


def test_one_centre_serves_many_rays() -> None:
    center, ray, _ = scene()
    many = intersect_ground_with_jacobian(center[0], ray, PLANE, PIVOT, 0.5)
    each = [intersect_ground_with_jacobian(center[0], r, PLANE, PIVOT, 0.5) for r in ray]
    for together, apart in zip(many, zip(*each, strict=True), strict=True):
        np.testing.assert_allclose(together, np.stack(apart), rtol=1e-13, atol=1e-13)


@given(st.floats(0.01, 100), st.tuples(*[st.floats(-100, 100)] * 3))
def test_length_of_the_ray_and_place_of_the_origin_mean_nothing(
    scale: float, shift: tuple[float, float, float]
) -> None:
    center, ray, above = scene(5)
    plain = intersect_ground(center, ray, PLANE, PIVOT, above)
    np.testing.assert_allclose(
        intersect_ground(center, scale * ray, PLANE, PIVOT, above), plain, atol=1e-9
    )
    moved = intersect_ground(
        center + shift, ray, PLANE + np.array([shift[2], 0, 0]), PIVOT + shift[:2], above
    )
    np.testing.assert_allclose(moved - shift, plain, atol=1e-9)


def test_inputs_stay_as_they_were() -> None:
    arrays = [*scene()[:2], PLANE.copy(), PIVOT.copy(), scene()[2]]
    for array in arrays:
        array.flags.writeable = False
    intersect_ground_with_jacobian(*arrays)
