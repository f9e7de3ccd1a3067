"""Conditions on points: their values by independent geometry, derivatives at zero and elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
import pytest
from derivatives import assert_derivative, central_differences

from uavgram.geometry.ground import conditions, measurements
from uavgram.geometry.ground.conditions import (
    compute_inverse_root,
    compute_joint_covariance,
    compute_line_offsets,
)
from uavgram.geometry.motion.rotation import exp_so3
from uavgram.model.arrays import Floats

Condition = Callable[[Floats], conditions.Residuals]


class _Kind(NamedTuple):
    """A condition, how many residuals it has, and points that fulfil it."""

    of: Condition
    rows: int
    fulfilled: list[list[float]]


KINDS = {
    "right_angle": _Kind(conditions.right_angle, 1, [[5, 1, 2], [1, 1, 2], [1, 4, 6]]),
    "collinear": _Kind(conditions.collinear, 4, [[1, 2, 3], [3, 3, 3.5], [7, 5, 4.5], [9, 6, 5]]),
    "collinear on the ground": _Kind(
        partial(conditions.collinear, on_ground=True),
        2,
        [[1, 2, 0], [3, 3, 9], [7, 5, 1], [9, 6, 0]],
    ),
    "a collinear edge of a wall": _Kind(
        conditions.collinear, 2, [[1, 2, 0], [1.1, 2.1, 1.5], [1.2, 2.2, 3]]
    ),
    "line_offset": _Kind(conditions.line_offset, 2, [[3, 3, 3.5], [1, 2, 3], [9, 6, 5]]),
    "line_offset on the ground": _Kind(
        partial(conditions.line_offset, on_ground=True), 1, [[3, 3, 0], [1, 2, 3], [9, 6, 5]]
    ),
    "parallel": _Kind(conditions.parallel, 2, [[0, 0, 0], [4, 2, 1], [7, 7, 7], [-1, 3, 5]]),
    "parallel on the ground": _Kind(
        partial(conditions.parallel, on_ground=True),
        1,
        [[0, 0, 0], [4, 2, 1], [7, 7, 7], [9, 8, 5]],
    ),
    "parallel edges of walls": _Kind(
        conditions.parallel, 2, [[0, 0, 0], [0.1, 0.2, 3], [7, 7, 7], [7.2, 7.4, 13]]
    ),
    "coplanar": _Kind(
        conditions.coplanar, 2, [[0, 0, 1], [4, 0, 3], [0, 3, 1], [2, 9, 2], [-4, 1, -1]]
    ),
    "level": _Kind(conditions.level, 2, [[0, 0, 7], [3, 4, 7], [9, -4, 7]]),
    "vertical": _Kind(conditions.vertical, 2, [[3, 4, 0], [3, 4, 2.5]]),
    "equal_lengths": _Kind(
        conditions.equal_lengths,
        2,
        [[0, 0, 0], [3, 4, 0], [1, 1, 1], [1, 6, 1], [2, 2, 2], [2, 5, 6]],
    ),
}


@pytest.mark.parametrize("name", KINDS)
def test_a_fulfilled_condition_is_zero_and_has_derivatives_there(name: str) -> None:
    kind = KINDS[name]
    points = np.array(kind.fulfilled)
    found = kind.of(points)
    assert found.value.shape == (kind.rows,)
    np.testing.assert_allclose(found.value, 0.0, atol=1e-12)
    assert_derivative(found.gradient.reshape(kind.rows, -1), _numeric(kind.of, points), 1e-8)


@pytest.mark.parametrize("name", KINDS)
def test_gradients_equal_central_differences_elsewhere(name: str) -> None:
    kind = KINDS[name]
    for seed in range(20):
        rng = np.random.default_rng(seed)
        points = rng.uniform(-20, 20, np.shape(kind.fulfilled))
        found = kind.of(points)
        assert (found.value != 0).all()
        assert_derivative(found.gradient.reshape(kind.rows, -1), _numeric(kind.of, points), 1e-6)


@pytest.mark.parametrize("name", KINDS)
def test_many_at_once_are_each_by_itself(name: str) -> None:
    kind = KINDS[name]
    points = np.random.default_rng(3).uniform(-20, 20, (2, 3, *np.shape(kind.fulfilled)))
    points[1, 2] = points[1, 2, 0]  # all in one place
    found = kind.of(points)
    for i, j in np.ndindex(2, 3):
        alone = kind.of(points[i, j])
        np.testing.assert_array_equal(found.value[i, j], alone.value)
        np.testing.assert_array_equal(found.gradient[i, j], alone.gradient)


@pytest.mark.parametrize("name", KINDS)
def test_a_shift_and_a_turn_about_up_change_nothing_on_the_whole(name: str) -> None:
    kind = KINDS[name]
    points = np.random.default_rng(4).uniform(-20, 20, np.shape(kind.fulfilled))
    found = kind.of(points)
    np.testing.assert_allclose(found.gradient.sum(axis=1), 0.0, atol=1e-12)
    turned = kind.of(points @ exp_so3(np.array([0.0, 0, 1.1])).T + [5e3, 1e3, 70])
    # Components of a vector may turn with it; their square sum may not.
    assert np.sum(turned.value**2) == pytest.approx(np.sum(found.value**2), rel=1e-9)


def test_a_right_angle_misses_by_the_angle_less_than_ninety() -> None:
    for degrees in (1.0, 60.0, 89.999, 90.0, 90.001, 150.0):
        leg = np.radians(degrees)
        points = np.array([[4.0, 0, 0], [0, 0, 0], [7 * np.cos(leg), 0, 7 * np.sin(leg)]])
        assert conditions.right_angle(points).value[0] == pytest.approx(90 - degrees, abs=1e-9)


def test_a_right_angle_and_the_measured_one_are_the_same() -> None:
    points = np.random.default_rng(5).uniform(-20, 20, (3, 3))
    angle, gradient = measurements.angle(points)
    found = conditions.right_angle(points)
    assert found.value[0] == pytest.approx(90 - np.degrees(angle))
    np.testing.assert_allclose(found.gradient[0], -np.degrees(gradient))


def test_offsets_from_a_line_by_hand() -> None:
    # The line runs north along e = 1, rising by 3 in 4.
    line = np.array([[1.0, 0, 0], [1, 4, 3]])
    point = np.array([[0.25, 4 - 0.6, 3 + 0.8]])  # 0.75 to the left; 1 upwards, square to the line
    value = conditions.line_offset(np.concatenate([point, line])).value
    np.testing.assert_allclose(value, [0.75, 1.0])
    value = conditions.collinear(np.concatenate([line[:1], point, line[1:]])).value
    np.testing.assert_allclose(value, [0.75, 1.0])


@pytest.mark.parametrize("seed", range(10))
def test_offsets_make_up_the_distance_from_the_line(seed: int) -> None:
    points = np.random.default_rng(seed).uniform(-20, 20, (3, 3))
    if seed % 2:  # steep
        points[2] = points[1] + [1.0, -0.5, 8.0]
    value = conditions.line_offset(points).value
    assert np.hypot(*value) == pytest.approx(measurements.line_distance(points)[0])


def test_an_offset_along_the_ground_is_the_distance_on_the_map() -> None:
    points = np.random.default_rng(6).uniform(-20, 20, (3, 3))
    start, end = points[1, :2], points[2, :2]
    across = np.array([-(end - start)[1], (end - start)[0]]) / np.linalg.norm(end - start)
    value = conditions.line_offset(points, on_ground=True).value
    np.testing.assert_allclose(value, [across @ (points[0, :2] - start)])


@pytest.mark.parametrize("turn", [-60.0, -1.0, 0.0, 20.0])
@pytest.mark.parametrize("rise", [-10.0, 0.0, 5.0])
@pytest.mark.parametrize("backwards", [False, True])
def test_parallels_by_azimuth_and_rise(turn: float, rise: float, *, backwards: bool) -> None:
    a, b = np.radians(turn), np.radians(rise)
    second = 3 * np.array([np.cos(a), np.sin(a), np.tan(b) * np.cos(a)])
    points = np.array([[1.0, 2, 3], [9, 2, 3], [7, 7, 7], [7, 7, 7]])
    points[3] += second
    if backwards:
        points[2:] = points[:1:-1].copy()
    value = conditions.parallel(points).value
    np.testing.assert_allclose(value, [turn, rise], atol=1e-9)
    np.testing.assert_allclose(conditions.parallel(points, on_ground=True).value, value[:1])


def test_distances_from_a_plane_by_hand() -> None:
    plane = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    further = np.array([[5.0, 6, 2], [5, 6, -3]])
    turn, shift = exp_so3(np.array([0.4, -1.0, 2.0])), np.array([100.0, 50, 7])
    points = np.concatenate([plane, further]) @ turn.T + shift
    np.testing.assert_allclose(conditions.coplanar(points).value, [2.0, -3.0])


def test_heights_plumb_lines_and_lengths_by_hand() -> None:
    np.testing.assert_allclose(
        conditions.level(np.array([[0.0, 0, 7], [1, 1, 7.5], [2, 2, 6]])).value, [0.5, -1.0]
    )
    np.testing.assert_allclose(
        conditions.vertical(np.array([[1.0, 2, 3], [1.5, 1, 9]])).value, [0.5, -1.0]
    )
    points = np.array([[0.0, 0, 0], [0, 3, 4], [1, 1, 1], [1, 1, 3]])
    np.testing.assert_allclose(conditions.equal_lengths(points).value, [-3.0])


@pytest.mark.parametrize(
    ("of", "points"),
    [
        (conditions.right_angle, [[0, 0, 0], [0, 0, 0], [2, 0, 0]]),
        (conditions.right_angle, [[-1, 0, 0], [0, 0, 0], [2, 0, 0]]),
        (conditions.collinear, [[1, 2, 3], [4, 5, 6], [1, 2, 3]]),
        (partial(conditions.line_offset, on_ground=True), [[1, 2, 3], [4, 5, 6], [4, 5, 6]]),
        (conditions.parallel, [[0, 0, 0], [4, 2, 1], [7, 7, 7], [7, 7, 7]]),
        (conditions.parallel, [[0, 0, 0], [0, 0, 0], [7, 7, 7], [8, 7, 7]]),
        (conditions.parallel, [[0, 0, 0], [4, 0, 0], [7, 7, 7], [7, 9, 7]]),
        (conditions.coplanar, [[0, 0, 0], [1, 1, 1], [2, 2, 2], [7, 7, 7]]),
        (conditions.equal_lengths, [[0, 0, 0], [1, 1, 1], [2, 2, 2], [2, 2, 2]]),
        (conditions.level, [[0, 0, 0], [0, 0, np.nan]]),
    ],
)
def test_what_has_no_derivative_is_nan(of: Condition, points: list[list[float]]) -> None:
    found = of(np.array(points, float))
    assert np.isnan(found.value).all()
    assert np.isnan(found.gradient).all()
    assert found.gradient.shape == (*found.value.shape, *np.shape(points))


@pytest.mark.parametrize("name", KINDS)
def test_the_wrong_number_of_points_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match="points"):
        KINDS[name].of(np.zeros((1, 3)))
    with pytest.raises(ValueError, match="points of shape"):
        KINDS[name].of(np.zeros((4, 2)))


def test_half_a_line_is_refused() -> None:
    with pytest.raises(ValueError, match="two points for each line"):
        conditions.equal_lengths(np.zeros((5, 3)))


def _numeric(of: Condition, points: Floats) -> Floats:
    return central_differences(lambda x: of(x.reshape(points.shape)).value, points.ravel())


# How far points lie beside a known line: offsets, derivatives, and errors that they share.


ENDS = np.array([[2.0, -1.0, 0.4], [14.0, 4.0, 1.7]])
ALONG = (ENDS[1, :2] - ENDS[0, :2]) / 13.0
LEFT = np.array([-ALONG[1], ALONG[0]])


def beside(share: float, left_m: float, above_m: float) -> Floats:
    place = ENDS[0] + share * (ENDS[1] - ENDS[0]) + [*(left_m * LEFT), above_m]
    return np.asarray(place)


def test_offsets_are_to_the_left_and_up() -> None:
    points = np.stack([beside(0.3, 0.25, -0.1), beside(1.2, -2.0, 0.6)])

    np.testing.assert_allclose(
        compute_line_offsets(points, ENDS, upwards=True).value,
        [[0.25, -0.1], [-2.0, 0.6]],
        atol=1e-12,
    )
    np.testing.assert_allclose(
        compute_line_offsets(points, ENDS, upwards=False).value, [[0.25], [-2.0]], atol=1e-12
    )


def test_derivatives_by_points_and_by_ends_are_central_differences() -> None:
    point = beside(0.7, 0.0, 0.0)
    found = compute_line_offsets(point[None], ENDS, upwards=True)

    def of_point(place: Floats) -> Floats:
        return np.asarray(compute_line_offsets(place[None], ENDS, upwards=True).value[0])

    def of_ends(ends: Floats) -> Floats:
        return np.asarray(
            compute_line_offsets(point[None], ends.reshape(2, 3), upwards=True).value[0]
        )

    assert_derivative(found.gradient[0], central_differences(of_point, point, 1e-5))
    by_ends = found.by_ends[0].reshape(2, 6)
    assert_derivative(by_ends, central_differences(of_ends, ENDS.ravel(), 1e-5))


def test_two_points_at_one_place_err_alike_and_those_at_the_ends_do_not() -> None:
    points = np.stack([beside(share, 0.0, 0.0) for share in (0.0, 1.0, 0.5, 0.5)])
    sigma = np.array([[0.03, 0.03, 0.05], [0.04, 0.04, 0.07]])
    found = compute_joint_covariance(
        compute_line_offsets(points, ENDS, upwards=False).by_ends, sigma, 0.0
    )

    np.testing.assert_allclose(found[0, :2], [0.03**2, 0.0], atol=1e-15)
    np.testing.assert_allclose(found[1, 1], 0.04**2)
    np.testing.assert_allclose(found[2, 2:], (0.03**2 + 0.04**2) / 4)
    own = compute_joint_covariance(
        compute_line_offsets(points, ENDS, upwards=False).by_ends, sigma, 0.01
    )
    np.testing.assert_allclose(own - found, 1e-4 * np.eye(4), atol=1e-15)


def test_the_joint_covariance_is_that_of_drawn_ends() -> None:
    points = np.stack([beside(share, 0.0, 0.0) for share in (-0.4, 0.2, 0.9, 1.6)])
    sigma = np.array([[0.02, 0.03, 0.01], [0.01, 0.02, 0.04]])
    rng = np.random.default_rng(5)
    drawn = [
        compute_line_offsets(
            points, ENDS + sigma * rng.normal(size=(2, 3)), upwards=True
        ).value.ravel()
        for _ in range(4000)
    ]
    stated = compute_joint_covariance(
        compute_line_offsets(points, ENDS, upwards=True).by_ends, sigma, 0.0
    )
    scale = np.sqrt(np.diag(stated))

    # A correlation from n draws has a standard deviation of at most 1 / sqrt(n).
    assert np.abs((np.cov(np.array(drawn).T) - stated) / np.outer(scale, scale)).max() < 0.1


def test_the_inverse_root_whitens_and_is_symmetric() -> None:
    root = np.random.default_rng(2).normal(size=(5, 5))
    covariance = root @ root.T + 0.1 * np.eye(5)
    found = compute_inverse_root(covariance)

    np.testing.assert_allclose(found @ covariance @ found, np.eye(5), atol=1e-10)
    np.testing.assert_allclose(found, found.T, atol=1e-12)


@pytest.mark.parametrize("share", [-30.0, 40.0])
def test_far_along_the_line_its_direction_counts_no_less_than_near(share: float) -> None:
    point = beside(share, 0.0, 0.0)
    lever = compute_line_offsets(point[None], ENDS, upwards=False).by_ends[0, 0, :, :2] @ -LEFT

    assert np.abs(lever).max() == pytest.approx(2.0)
