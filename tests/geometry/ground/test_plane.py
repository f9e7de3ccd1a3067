"""Rays and the ground plane."""

from __future__ import annotations

import numpy as np
import pytest
from derivatives import assert_derivative, central_differences
from hypothesis import given
from hypothesis import strategies as st

from uavgram.geometry.ground.plane import (
    choose_knots,
    compute_end_components,
    differentiate_by_ends,
    differentiate_by_plane,
    evaluate_correlated_basis,
    evaluate_quadratic_basis,
    fit_robust_plane,
    intersect_ground,
    intersect_ground_with_jacobian,
    knots_root,
    lengths_on_plane,
    pose_above_plane,
)
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


# A camera over a plane, from lengths alone.


def planes() -> Floats:
    normal = np.array([[0.0, 0, 1], [0.1, 0.5, 0.8], [-0.6, 0.2, 0.7], [0, -0.3, 0.9]])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    result: Floats = normal / np.array([[40.0], [55], [12], [80]])
    return result


def rays(seed: int) -> Floats:
    plane_coordinates = np.random.default_rng(seed).uniform(-0.4, 0.4, (6, 2))
    return np.concatenate([plane_coordinates, np.ones((6, 1))], axis=1)


def pairs(start: Floats, end: Floats) -> Floats:
    """Ends (3, 2, L) of lines with rays (L, 3)."""
    return np.stack([start.T, end.T], axis=1)


def lengths(plane: Floats, ends: Floats) -> Floats:
    """(S, L) on planes (S, 3)."""
    return lengths_on_plane(np.moveaxis(plane, -1, 0)[..., None], ends[:, :, None]).length


def test_lengths_are_those_between_the_ground_points_of_the_pose() -> None:
    start, end = rays(1), rays(2)
    found = lengths(planes(), pairs(start, end))
    for plane, length in zip(planes(), found, strict=True):
        center, rotation = pose_above_plane(plane)
        ground = [
            intersect_ground(center, ray @ rotation.T, np.zeros(3), np.zeros(2))
            for ray in (start, end)
        ]
        np.testing.assert_allclose(length, np.linalg.norm(ground[0] - ground[1], axis=1))


@pytest.mark.parametrize("plane", planes())
def test_derivatives_by_the_plane_equal_central_differences(plane: Floats) -> None:
    ends = pairs(rays(1), rays(2))
    on_plane = lengths_on_plane(plane[:, None], ends)
    found = differentiate_by_plane(on_plane, compute_end_components(on_plane))
    numeric = central_differences(lambda m: lengths_on_plane(m[:, None], ends).length, plane, 1e-5)
    assert_derivative(found.T, numeric)


@pytest.mark.parametrize("plane", planes())
def test_derivatives_by_the_ends_equal_central_differences(plane: Floats) -> None:
    ends = pairs(rays(1), rays(2))
    on_plane = lengths_on_plane(plane[:, None], ends)
    found = differentiate_by_ends(on_plane, compute_end_components(on_plane))

    def moved(shift: Floats) -> Floats:
        by = np.append(shift.reshape(2, 2), [[0.0, 0.0]], axis=0)
        return lengths_on_plane(plane[:, None], ends + by[:, :, None]).length

    numeric = central_differences(moved, np.zeros(4), 1e-4)
    assert_derivative(found.reshape(4, -1).T, numeric)


def test_beyond_the_horizon_there_is_no_length() -> None:
    level = np.array([0.0, 0.1, 0.0])[:, None]  # looking along the ground, 10 m above it
    above, below = np.array([[0.0, -0.2, 1.0]]), np.array([[0.0, 0.2, 1.0]])
    for ends in (pairs(above, below), pairs(below, above), pairs(below, below)):
        found = lengths_on_plane(level, ends)
        assert np.isnan(found.length).all()
        assert np.isnan(differentiate_by_plane(found, compute_end_components(found))).all()
        assert np.isnan(differentiate_by_ends(found, compute_end_components(found))).all()


@pytest.mark.parametrize("plane", [*planes(), np.array([0, 0.1, 0])])
def test_pose_stands_over_the_origin_with_image_up_to_the_north(plane: Floats) -> None:
    center, rotation = pose_above_plane(plane)
    np.testing.assert_allclose(center, np.array([0, 0, 1 / np.linalg.norm(plane)]))
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(rotation) == pytest.approx(1)
    np.testing.assert_allclose(rotation @ plane * center[2], [0, 0, -1], atol=1e-15)
    image_up = rotation @ [0, -1, 0]
    assert image_up[0] == pytest.approx(0, abs=1e-15)
    assert image_up[1] >= 0


def test_looking_at_the_horizon_the_optical_axis_is_north() -> None:
    _, rotation = pose_above_plane(np.array([0, 0.1, 0]))
    np.testing.assert_allclose(rotation @ [0, 0, 1], [0, 1, 0], atol=1e-15)


# The plane of most: as long as they are most, what the others do has no influence.


TRUE_PLANE = np.array([2.0, 0.03, -0.02])


def heights(place: np.ndarray) -> np.ndarray:
    return np.asarray(TRUE_PLANE[0] + place @ TRUE_PLANE[1:])


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("off", [0, 10, 18])
def test_points_off_the_plane_do_not_move_it(seed: int, off: int) -> None:
    rng = np.random.default_rng(seed)
    place = rng.uniform(-20, 20, (36, 2))
    true = heights(place)
    height = true + 0.01 * rng.standard_normal(36)
    height[:off] += rng.choice([0.9, 1.4, 2.5], off)

    found = fit_robust_plane(place, height, np.full(36, 0.03))

    assert found is not None
    assert np.abs(found - true).max() < 0.03


def test_exact_points_give_the_exact_plane() -> None:
    place = np.random.default_rng(0).uniform(-20, 20, (9, 2))

    found = fit_robust_plane(place, heights(place), np.full(9, 0.03))

    assert found is not None
    np.testing.assert_allclose(found, heights(place), atol=1e-12)


@pytest.mark.parametrize(
    "place",
    [
        np.zeros((3, 2)),
        np.zeros((8, 2)),
        np.column_stack([np.arange(8.0), 2.0 * np.arange(8.0)]),
    ],
    ids=["few", "one place", "a line"],
)
def test_without_three_corners_there_is_no_plane(place: np.ndarray) -> None:
    assert fit_robust_plane(place, np.zeros(len(place)), np.ones(len(place))) is None


# Smooth departures of ground from a plane.


RNG = np.random.default_rng(4)
PLACES = RNG.uniform(-20.0, 20.0, (40, 2))
KNOTS = PLACES[:12]
ROOT = knots_root(KNOTS, 9.0)


@pytest.mark.parametrize("kind", ["quadratic", "correlated"])
def test_the_slopes_equal_central_differences(kind: str) -> None:
    def value(places: Floats) -> Floats:
        if kind == "quadratic":
            return evaluate_quadratic_basis(places, np.array([1.0, -3.0]), 7.0).value
        return evaluate_correlated_basis(places, KNOTS, 9.0, ROOT).value

    basis = (
        evaluate_quadratic_basis(PLACES, np.array([1.0, -3.0]), 7.0)
        if kind == "quadratic"
        else evaluate_correlated_basis(PLACES, KNOTS, 9.0, ROOT)
    )
    for axis in range(2):
        step = np.zeros(2)
        step[axis] = 1e-5
        numeric = (value(PLACES + step) - value(PLACES - step)) / 2e-5
        np.testing.assert_allclose(basis.gradient[..., axis], numeric, rtol=1e-5, atol=1e-6)


def test_heights_at_the_knots_have_the_covariance_of_their_distances() -> None:
    value = evaluate_correlated_basis(KNOTS, KNOTS, 9.0, ROOT).value
    distance = np.linalg.norm(KNOTS[:, None] - KNOTS[None], axis=2)

    np.testing.assert_allclose(value @ value.T, np.exp(-((distance / 9.0) ** 2) / 2), atol=1e-7)


def test_far_from_all_knots_there_is_no_relief() -> None:
    assert (
        np.abs(evaluate_correlated_basis(np.array([[500.0, 0.0]]), KNOTS, 9.0, ROOT).value).max()
        < 1e-12
    )


def test_a_quadratic_surface_is_a_known_polynomial() -> None:
    basis = evaluate_quadratic_basis(np.array([[11.0, 4.0]]), np.array([1.0, -1.0]), 5.0)

    np.testing.assert_allclose(basis.value, [[4.0, 4.0, 1.0]])


def test_knots_lie_at_places_far_apart() -> None:
    line = np.column_stack([np.arange(11.0), np.zeros(11)])

    assert sorted(choose_knots(line, 3)[:, 0].tolist()) == [0.0, 5.0, 10.0]
    assert len(choose_knots(np.zeros((4, 2)), 3)) == 1
