"""Shapes by pencil and paper, and their gradients by central differences."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from derivatives import central_differences
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import dblquad

from uavgram.geometry.ground import measurements
from uavgram.geometry.motion.rotation import exp_so3
from uavgram.model.arrays import Floats

SQUARE = np.array([[0.0, 0, 0], [4, 0, 0], [4, 3, 0], [0, 3, 0]])
Measure = Callable[[Floats], tuple[float, Floats]]

COUNT: dict[Measure, int] = {
    measurements.distance: 2,
    measurements.polyline: 5,
    measurements.area: 6,
    measurements.angle: 3,
    measurements.line_distance: 3,
    measurements.plane_distance: 4,
}


def test_distance_is_pythagoras() -> None:
    value, gradient = measurements.distance(np.array([[1.0, 2, 3], [3, 5, 9]]))
    assert value == 7
    np.testing.assert_allclose(gradient, np.array([[-2, -3, -6], [2, 3, 6]]) / 7)


def test_polyline_adds_its_pieces() -> None:
    value, gradient = measurements.polyline(SQUARE)
    assert value == 11
    np.testing.assert_allclose(gradient[:, :2], [[-1, 0], [1, -1], [1, 1], [-1, 0]])


def test_area_of_a_rectangle_whichever_way_round() -> None:
    assert measurements.area(SQUARE)[0] == pytest.approx(12)
    assert measurements.area(SQUARE[::-1])[0] == pytest.approx(12)


def test_area_lies_in_the_polygons_own_plane() -> None:
    tilted = SQUARE @ exp_so3(np.array([0.8, 0.1, 0])).T + [5e5, 5e6, 100]
    assert measurements.area(tilted)[0] == pytest.approx(12, rel=1e-9)


def test_area_of_a_notched_polygon_by_hand() -> None:
    notched = np.array([[0.0, 0, 0], [4, 0, 0], [4, 4, 0], [2, 1, 0], [0, 4, 0]])
    assert measurements.area(notched)[0] == pytest.approx(16 - 6)


@pytest.mark.parametrize("degrees", [1e-4, 30, 90, 120, 179.9999])
def test_angle_is_the_one_at_the_middle(degrees: float) -> None:
    a = np.radians(degrees)
    points = np.array([[5, 0, 0], [0, 0, 0], [2 * np.cos(a), 0, 2 * np.sin(a)]]) + 7.0
    assert np.degrees(measurements.angle(points)[0]) == pytest.approx(degrees, rel=1e-9)


def test_line_distance_is_perpendicular_also_beyond_the_ends() -> None:
    points = np.array([[10.0, 3, 4], [0, 0, 0], [2, 0, 0]])
    value, gradient = measurements.line_distance(points)
    assert value == 5
    np.testing.assert_allclose(gradient @ [0, 0.6, 0.8], [1, 4, -5])


def test_plane_distance_is_positive_where_the_three_go_round_against_the_clock() -> None:
    points = np.array([[7.0, -5, 0.3], [0, 0, 0], [4, 0, 0], [0, 3, 0]])
    value, gradient = measurements.plane_distance(points)
    assert value == pytest.approx(0.3)
    # By hand: 7 / 4 and -5 / 3 are the foot's shares of the two legs.
    np.testing.assert_allclose(gradient[:, 2], [1, -1 + 7 / 4 - 5 / 3, -7 / 4, 5 / 3])
    assert measurements.plane_distance(points[[0, 1, 3, 2]])[0] == pytest.approx(-0.3)


def test_plane_distance_equals_the_height_of_a_tetrahedron() -> None:
    points = np.random.default_rng(5).normal(size=(4, 3))
    legs = points[1:] - points[0]
    base = measurements.area(points[1:])[0]
    six_volumes = abs(np.linalg.det(legs))
    assert abs(measurements.plane_distance(points)[0]) == pytest.approx(six_volumes / 2 / base)


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
    powers: dict[Measure, int] = {measurements.area: 2, measurements.angle: 0}
    power = powers.get(measure, 1)
    moved = scale * points @ exp_so3(np.array(turn)).T + np.array(shift)
    value, gradient = measure(points)
    assert measure(moved)[0] == pytest.approx(scale**power * value, rel=1e-9)
    np.testing.assert_allclose(gradient.sum(axis=0), 0, atol=1e-9)
    assert (gradient * points).sum() == pytest.approx(power * value, abs=1e-9)  # Euler


@pytest.mark.parametrize(
    ("measure", "points"),
    [
        (measurements.distance, [[1, 2, 3], [1, 2, 3]]),
        (measurements.polyline, [[0, 0, 0], [1, 0, 0], [1, 0, 0]]),
        (measurements.area, [[0, 0, 0], [1, 0, 0], [2, 0, 0]]),
        (measurements.angle, [[0, 0, 0], [0, 0, 0], [2, 0, 0]]),
        (measurements.angle, [[-1, 0, 0], [0, 0, 0], [2, 0, 0]]),
        (measurements.line_distance, [[0, 1, 0], [2, 0, 0], [2, 0, 0]]),
        (measurements.line_distance, [[1, 0, 0], [0, 0, 0], [2, 0, 0]]),
        (measurements.plane_distance, [[1, 0, 5], [0, 0, 0], [0.1, 0.1, 0.1], [0.3, 0.3, 0.3]]),
        (measurements.plane_distance, [[1, 0, 5], [0, 0, 0], [0, 0, 0], [1, 3, 0]]),
        (measurements.distance, [[1, 2, np.nan], [1, 2, 3]]),
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
    assert measurements.polygon_self_intersects(corner) is crosses
    assert measurements.polygon_self_intersects(corner[::-1]) is crosses
    assert measurements.polygon_self_intersects(np.roll(corner, 1, axis=0)) is crosses


@pytest.mark.parametrize("turn", [(0.0, 0, 0), (np.pi / 2, 0, 0), (0.9, 1.1, -0.4)])
def test_the_outline_of_a_wall_is_judged_in_its_own_plane(turn: tuple[float, ...]) -> None:
    wall = SQUARE @ exp_so3(np.array(turn)).T + [30.0, -8, 2]
    assert not measurements.outline_crosses_itself(wall)
    assert measurements.outline_crosses_itself(wall[[0, 2, 1, 3]])
    assert not measurements.outline_crosses_itself(wall[[0, 1, 0, 1]])  # in line: there is none


@pytest.mark.parametrize("measure", COUNT)
def test_inputs_stay_as_they_were(measure: Measure) -> None:
    points = np.random.default_rng(1).uniform(-20, 20, (COUNT[measure], 3))
    points.flags.writeable = False
    measure(points)


# Heights, slopes, volumes and profiles by pencil and paper; their gradients by differences.


SHAPE = np.array([(0.0, 0), (6, 0), (6, 4), (4, 4), (4, 1), (0, 2)])
"""An outline that no point sees all of."""


def _volume(points: Floats) -> tuple[float, Floats]:
    found = measurements.volume(points, np.array([0.4, -1.0, 3.0, 0.2, 0.1, 0.0]))
    return found.value, found.by_points


def _volume_with_top(points: Floats) -> tuple[float, Floats]:
    found = measurements.volume(points, np.array([0.4, -1.0, 3.0, 0.2, 0.1]), top=True)
    return found.value, found.by_points


HEIGHT_COUNT: dict[Measure, int] = {
    measurements.horizontal_distance: 2,
    measurements.vertical_distance: 2,
    measurements.slope: 2,
    measurements.profile_length: 5,
    _volume: 6,
    _volume_with_top: 5,
}


def test_a_line_by_hand() -> None:
    points = np.array([[1.0, 2, 3], [4, 6, 8]])
    assert measurements.horizontal_distance(points)[0] == 5
    assert measurements.vertical_distance(points)[0] == 5
    assert np.degrees(measurements.slope(points)[0]) == pytest.approx(45)
    assert np.degrees(measurements.slope(points[::-1])[0]) == pytest.approx(-45)
    assert measurements.vertical_distance(points[::-1])[0] == -5


def test_ten_percent_are_not_quite_six_degrees() -> None:
    points = np.array([[0.0, 0, 7], [0, 50, 12]])
    assert np.degrees(measurements.slope(points)[0]) == pytest.approx(5.7106, abs=1e-4)


@pytest.mark.parametrize("measure", HEIGHT_COUNT, ids=lambda one: one.__name__)
def test_gradients_of_vertical_quantities_equal_central_differences(measure: Measure) -> None:
    for seed in range(20):
        points = np.random.default_rng(seed).uniform(-20, 20, (HEIGHT_COUNT[measure], 3))

        def value(x: Floats, shape: tuple[int, ...] = points.shape) -> Floats:
            return np.array(measure(x.reshape(shape))[0])

        numeric = central_differences(value, points.ravel())
        gradient = measure(points)[1].ravel()
        assert np.abs(gradient - numeric).max() <= 1e-6 * np.abs(numeric).max()


def test_a_box_and_its_hole_have_the_volume_of_boxes() -> None:
    box = np.column_stack([SHAPE, np.full(len(SHAPE), 12.5)])
    area = cv2.contourArea(SHAPE.astype(np.float32))
    over = measurements.volume(box, np.full(len(SHAPE), 10.0))
    assert over.value == pytest.approx(2.5 * area)
    assert measurements.volume(box, np.full(len(SHAPE), 13.0)).value == pytest.approx(-0.5 * area)
    assert measurements.volume(box[::-1], np.full(len(SHAPE), 10.0)).value == pytest.approx(
        over.value
    )
    # The whole top 1 m higher is one area more, and the whole base one area less.
    assert over.by_points[:, 2].sum() == pytest.approx(area)
    assert over.by_base.sum() == pytest.approx(-area)


def test_between_two_planes_it_is_exact_for_an_outline_with_a_notch() -> None:
    turn = np.array([[np.cos(0.6), -np.sin(0.6)], [np.sin(0.6), np.cos(0.6)]])
    outline = SHAPE @ turn.T
    top = outline @ [0.2, -0.1] + 3.0
    base = outline @ [-0.05, 0.3] - 1.0
    # A linear function over a shape: its integral is made of the shape's moments.
    moments = cv2.moments(outline.astype(np.float32)[:, None])
    truth = 0.25 * moments["m10"] - 0.4 * moments["m01"] + 4.0 * moments["m00"]
    for north_m in (0.0, 5e6):  # as far off as map coordinates are
        points = np.column_stack([outline[:, 0], outline[:, 1] + north_m, top])
        assert measurements.volume(points, base).value == pytest.approx(truth, rel=1e-6)


def test_a_pyramid_is_a_third_of_its_box() -> None:
    square = np.array([[0.0, 0, 2], [6, 0, 2], [6, 6, 2], [0, 6, 2], [2, 4, 5]])
    assert measurements.volume(square, np.full(5, 2.0), top=True).value == pytest.approx(36 * 3 / 3)
    assert measurements.sees_all(square)
    assert measurements.sees_all(square[[3, 2, 1, 0, 4]])
    square[4, 0] = -0.1
    assert not measurements.sees_all(square)


def test_a_warped_square_has_the_volume_of_the_bilinear_surface() -> None:
    corners = np.array([[0.0, 0, 1], [2, 0, 3], [2, 2, 0], [0, 2, 5]])

    def surface(y: float, x: float) -> float:
        u, v = x / 2, y / 2
        return (1 - u) * (1 - v) * 1 + u * (1 - v) * 3 + u * v * 0 + (1 - u) * v * 5

    truth, _ = dblquad(surface, 0, 2, 0, 2)
    assert measurements.volume(corners, np.zeros(4)).value == pytest.approx(truth)


def test_the_plane_below_and_its_derivatives() -> None:
    rng = np.random.default_rng(3)
    three, places = rng.uniform(-5, 5, (3, 3)), rng.uniform(-9, 9, (4, 2))
    found = measurements.plane_below(places, three)
    normal = np.cross(three[1] - three[0], three[2] - three[0])
    on_it = np.column_stack([places, found.height_m])
    np.testing.assert_allclose((on_it - three[0]) @ normal, 0, atol=1e-12)
    by_three = central_differences(
        lambda x: measurements.plane_below(places, x.reshape(3, 3)).height_m, three.ravel()
    )
    np.testing.assert_allclose(found.by_three.reshape(4, 9), by_three, rtol=1e-6, atol=1e-8)
    by_place = central_differences(
        lambda x: measurements.plane_below(x[None], three).height_m, places[0]
    )
    np.testing.assert_allclose(found.slope, by_place.ravel(), rtol=1e-6)


def test_a_profile_by_hand() -> None:
    points = np.array([[10.0, 20, 3], [13, 23, 5], [10, 30, 4]])
    value, _ = measurements.profile(points)
    # The line runs north: 3 m to its right is 3 m east.
    np.testing.assert_allclose(value, [[0, 0, 0], [3, 3, 2], [10, 0, 1]], atol=1e-12)


def test_derivatives_of_a_profile_equal_central_differences() -> None:
    points = np.random.default_rng(8).uniform(-20, 20, (5, 3))
    gradient = measurements.profile(points).gradient
    numeric = central_differences(
        lambda x: measurements.profile(x.reshape(5, 3)).value.ravel(), points.ravel()
    )
    np.testing.assert_allclose(gradient.reshape(15, 15), numeric, rtol=1e-6, atol=1e-7)


UPRIGHT = np.array([[0.3, 0.1, 1], [0.3, 0.1, 2]])
IN_LINE = np.array([[0.0, 0, 1], [1, 1, 2], [3, 3, 0]])


def test_vertical_quantities_without_a_derivative_are_nan() -> None:
    for measure in (
        measurements.horizontal_distance,
        measurements.slope,
        measurements.profile_length,
    ):
        value, gradient = measure(UPRIGHT)
        assert np.isnan(value)
        assert np.isnan(gradient).all()
    assert np.isnan(measurements.profile(UPRIGHT).value).all()
    assert np.isnan(measurements.volume(IN_LINE, np.zeros(3)).value)
    assert np.isnan(measurements.plane_below(IN_LINE[:, :2], IN_LINE).height_m).all()
    assert measurements.vertical_distance(UPRIGHT)[0] == 1
