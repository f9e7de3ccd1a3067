"""Shapes by pencil and paper, and their gradients by central differences."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from derivatives import central_differences
from hypothesis import given, settings
from hypothesis import strategies as st

from uavgram.geometry.ground import shapes
from uavgram.geometry.motion.rotation import exp_so3
from uavgram.model.arrays import Floats

SQUARE = np.array([[0.0, 0, 0], [4, 0, 0], [4, 3, 0], [0, 3, 0]])
Measure = Callable[[Floats], tuple[float, Floats]]

COUNT: dict[Measure, int] = {
    shapes.distance: 2,
    shapes.polyline: 5,
    shapes.area: 6,
    shapes.angle: 3,
    shapes.line_distance: 3,
    shapes.plane_distance: 4,
}


def test_distance_is_pythagoras() -> None:
    value, gradient = shapes.distance(np.array([[1.0, 2, 3], [3, 5, 9]]))
    assert value == 7
    np.testing.assert_allclose(gradient, np.array([[-2, -3, -6], [2, 3, 6]]) / 7)


def test_polyline_adds_its_pieces() -> None:
    value, gradient = shapes.polyline(SQUARE)
    assert value == 11
    np.testing.assert_allclose(gradient[:, :2], [[-1, 0], [1, -1], [1, 1], [-1, 0]])


def test_area_of_a_rectangle_whichever_way_round() -> None:
    assert shapes.area(SQUARE)[0] == pytest.approx(12)
    assert shapes.area(SQUARE[::-1])[0] == pytest.approx(12)


def test_area_lies_in_the_polygons_own_plane() -> None:
    tilted = SQUARE @ exp_so3(np.array([0.8, 0.1, 0])).T + [5e5, 5e6, 100]
    assert shapes.area(tilted)[0] == pytest.approx(12, rel=1e-9)


def test_area_of_a_notched_polygon_by_hand() -> None:
    notched = np.array([[0.0, 0, 0], [4, 0, 0], [4, 4, 0], [2, 1, 0], [0, 4, 0]])
    assert shapes.area(notched)[0] == pytest.approx(16 - 6)


@pytest.mark.parametrize("degrees", [1e-4, 30, 90, 120, 179.9999])
def test_angle_is_the_one_at_the_middle(degrees: float) -> None:
    a = np.radians(degrees)
    points = np.array([[5, 0, 0], [0, 0, 0], [2 * np.cos(a), 0, 2 * np.sin(a)]]) + 7.0
    assert np.degrees(shapes.angle(points)[0]) == pytest.approx(degrees, rel=1e-9)


def test_line_distance_is_perpendicular_also_beyond_the_ends() -> None:
    points = np.array([[10.0, 3, 4], [0, 0, 0], [2, 0, 0]])
    value, gradient = shapes.line_distance(points)
    assert value == 5
    np.testing.assert_allclose(gradient @ [0, 0.6, 0.8], [1, 4, -5])


def test_plane_distance_is_positive_where_the_three_go_round_against_the_clock() -> None:
    points = np.array([[7.0, -5, 0.3], [0, 0, 0], [4, 0, 0], [0, 3, 0]])
    value, gradient = shapes.plane_distance(points)
    assert value == pytest.approx(0.3)
    # By hand: 7 / 4 and -5 / 3 are the foot's shares of the two legs.
    np.testing.assert_allclose(gradient[:, 2], [1, -1 + 7 / 4 - 5 / 3, -7 / 4, 5 / 3])
    assert shapes.plane_distance(points[[0, 1, 3, 2]])[0] == pytest.approx(-0.3)


def test_plane_distance_equals_the_height_of_a_tetrahedron() -> None:
    points = np.random.default_rng(5).normal(size=(4, 3))
    legs = points[1:] - points[0]
    base = shapes.area(points[1:])[0]
    six_volumes = abs(np.linalg.det(legs))
    assert abs(shapes.plane_distance(points)[0]) == pytest.approx(six_volumes / 2 / base)


@pytest.mark.parametrize("measure", COUNT)
def test_gradients_equal_central_differences(measure: Measure) -> None:
    for seed in range(20):
        points = np.random.default_rng(seed).uniform(-20, 20, (COUNT[measure], 3))

        def value(x: Floats, shape: tuple[int, ...] = points.shape) -> Floats:
            return np.array(measure(x.reshape(shape))[0])

        numeric = central_differences(value, points.ravel())
        gradient = measure(points)[1].ravel()
        assert np.abs(gradient - numeric).max() <= 1e-6 * np.abs(numeric).max()


@pytest.mark.parametrize("measure", COUNT)
@settings(max_examples=30)
@given(
    turn=st.tuples(*[st.floats(-3, 3)] * 3),
    shift=st.tuples(*[st.floats(-1e3, 1e3)] * 3),
    scale=st.floats(0.1, 10),
)
def test_moving_and_turning_change_nothing_and_scaling_scales(
    measure: Measure,
    turn: tuple[float, float, float],
    shift: tuple[float, float, float],
    scale: float,
) -> None:
    points = np.random.default_rng(1).uniform(-20, 20, (COUNT[measure], 3))
    powers: dict[Measure, int] = {shapes.area: 2, shapes.angle: 0}
    power = powers.get(measure, 1)
    moved = scale * points @ exp_so3(np.array(turn)).T + np.array(shift)
    value, gradient = measure(points)
    assert measure(moved)[0] == pytest.approx(scale**power * value, rel=1e-9)
    np.testing.assert_allclose(gradient.sum(axis=0), 0, atol=1e-9)
    assert (gradient * points).sum() == pytest.approx(power * value, abs=1e-9)  # Euler


@pytest.mark.parametrize(
    ("measure", "points"),
    [
        (shapes.distance, [[1, 2, 3], [1, 2, 3]]),
        (shapes.polyline, [[0, 0, 0], [1, 0, 0], [1, 0, 0]]),
        (shapes.area, [[0, 0, 0], [1, 0, 0], [2, 0, 0]]),
        (shapes.angle, [[0, 0, 0], [0, 0, 0], [2, 0, 0]]),
        (shapes.angle, [[-1, 0, 0], [0, 0, 0], [2, 0, 0]]),
        (shapes.line_distance, [[0, 1, 0], [2, 0, 0], [2, 0, 0]]),
        (shapes.line_distance, [[1, 0, 0], [0, 0, 0], [2, 0, 0]]),
        (shapes.plane_distance, [[1, 0, 5], [0, 0, 0], [0.1, 0.1, 0.1], [0.3, 0.3, 0.3]]),
        (shapes.plane_distance, [[1, 0, 5], [0, 0, 0], [0, 0, 0], [1, 3, 0]]),
        (shapes.distance, [[1, 2, np.nan], [1, 2, 3]]),
    ],
)
def test_what_has_no_derivative_is_nan(measure: Measure, points: list[list[float]]) -> None:
    value, gradient = measure(np.array(points, float))
    assert np.isnan(value)
    assert np.isnan(gradient).all()
    assert gradient.shape == np.shape(points)


@pytest.mark.parametrize("measure", COUNT)
def test_the_wrong_number_of_points_is_refused(measure: Measure) -> None:
    with pytest.raises(ValueError, match="points of shape"):
        measure(np.zeros((1, 3)))
    with pytest.raises(ValueError, match="points of shape"):
        measure(np.zeros((3, 2)))


@pytest.mark.parametrize(
    ("outline", "crosses"),
    [
        ([(0, 0), (4, 0), (4, 4), (0, 4)], False),
        ([(0, 0), (4, 4), (4, 0), (0, 4)], True),
        ([(0, 0), (4, 0), (2, 3)], False),
        ([(0, 0), (4, 0), (4, 4), (2, 1), (0, 4)], False),
        ([(0, 0), (4, 0), (4, 4), (2, -1), (0, 4)], True),
        ([(0, 0), (4, 0), (4, 4), (2, 0), (0, 4)], True),
        ([(0, 0), (4, 0), (1, 0)], True),
        ([(0, 0), (4, 0), (4, 0), (4, 4), (0, 4), (0, 0)], False),
        ([(0, 0), (2, 0), (4, 0), (4, 4), (0, 4)], False),
        ([(0, 0), (4, 0), (0, 0), (4, 0)], True),
        ([(0, 0), (4, 0)], True),
        ([(0, 0), (0, 0), (0, 0)], False),
        ([(0, 0), (1, 0), (1, 1), (2, 1), (2, 0), (3, 0), (3, 2), (0, 2)], False),
    ],
)
def test_outlines_that_cross_or_touch_themselves(
    outline: list[tuple[int, int]], *, crosses: bool
) -> None:
    corner = np.array(outline, float)
    assert shapes.polygon_self_intersects(corner) is crosses
    assert shapes.polygon_self_intersects(corner[::-1]) is crosses
    assert shapes.polygon_self_intersects(np.roll(corner, 1, axis=0)) is crosses


@pytest.mark.parametrize("turn", [(0.0, 0, 0), (np.pi / 2, 0, 0), (0.9, 1.1, -0.4)])
def test_the_outline_of_a_wall_is_judged_in_its_own_plane(turn: tuple[float, ...]) -> None:
    wall = SQUARE @ exp_so3(np.array(turn)).T + [30.0, -8, 2]
    assert not shapes.outline_crosses_itself(wall)
    assert shapes.outline_crosses_itself(wall[[0, 2, 1, 3]])
    assert not shapes.outline_crosses_itself(wall[[0, 1, 0, 1]])  # in line: there is none


@pytest.mark.parametrize("measure", COUNT)
def test_inputs_stay_as_they_were(measure: Measure) -> None:
    points = np.random.default_rng(1).uniform(-20, 20, (COUNT[measure], 3))
    points.flags.writeable = False
    measure(points)
