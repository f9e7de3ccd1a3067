"""Heights, slopes, volumes and profiles by pencil and paper; their gradients by differences."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from derivatives import central_differences
from scipy.integrate import dblquad

from uavgram.geometry.ground import heights
from uavgram.model.arrays import Floats

Measure = Callable[[Floats], tuple[float, Floats]]
SHAPE = np.array([(0.0, 0), (6, 0), (6, 4), (4, 4), (4, 1), (0, 2)])
"""An outline that no point sees all of."""


def _volume(points: Floats) -> tuple[float, Floats]:
    found = heights.volume(points, np.array([0.4, -1.0, 3.0, 0.2, 0.1, 0.0]))
    return found.value, found.by_points


def _volume_with_top(points: Floats) -> tuple[float, Floats]:
    found = heights.volume(points, np.array([0.4, -1.0, 3.0, 0.2, 0.1]), top=True)
    return found.value, found.by_points


COUNT: dict[Measure, int] = {
    heights.horizontal_distance: 2,
    heights.vertical_distance: 2,
    heights.slope: 2,
    heights.profile_length: 5,
    _volume: 6,
    _volume_with_top: 5,
}


def test_a_line_by_hand() -> None:
    points = np.array([[1.0, 2, 3], [4, 6, 8]])
    assert heights.horizontal_distance(points)[0] == 5
    assert heights.vertical_distance(points)[0] == 5
    assert np.degrees(heights.slope(points)[0]) == pytest.approx(45)
    assert np.degrees(heights.slope(points[::-1])[0]) == pytest.approx(-45)
    assert heights.vertical_distance(points[::-1])[0] == -5


def test_ten_percent_are_not_quite_six_degrees() -> None:
    points = np.array([[0.0, 0, 7], [0, 50, 12]])
    assert np.degrees(heights.slope(points)[0]) == pytest.approx(5.7106, abs=1e-4)


@pytest.mark.parametrize("measure", COUNT, ids=lambda one: one.__name__)
def test_gradients_equal_central_differences(measure: Measure) -> None:
    for seed in range(20):
        points = np.random.default_rng(seed).uniform(-20, 20, (COUNT[measure], 3))

        def value(x: Floats, shape: tuple[int, ...] = points.shape) -> Floats:
            return np.array(measure(x.reshape(shape))[0])

        numeric = central_differences(value, points.ravel())
        gradient = measure(points)[1].ravel()
        assert np.abs(gradient - numeric).max() <= 1e-6 * np.abs(numeric).max()


def test_a_box_and_its_hole_have_the_volume_of_boxes() -> None:
    box = np.column_stack([SHAPE, np.full(len(SHAPE), 12.5)])
    area = cv2.contourArea(SHAPE.astype(np.float32))
    over = heights.volume(box, np.full(len(SHAPE), 10.0))
    assert over.value == pytest.approx(2.5 * area)
    assert heights.volume(box, np.full(len(SHAPE), 13.0)).value == pytest.approx(-0.5 * area)
    assert heights.volume(box[::-1], np.full(len(SHAPE), 10.0)).value == pytest.approx(over.value)
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
        assert heights.volume(points, base).value == pytest.approx(truth, rel=1e-6)


def test_a_pyramid_is_a_third_of_its_box() -> None:
    square = np.array([[0.0, 0, 2], [6, 0, 2], [6, 6, 2], [0, 6, 2], [2, 4, 5]])
    assert heights.volume(square, np.full(5, 2.0), top=True).value == pytest.approx(36 * 3 / 3)
    assert heights.sees_all(square)
    assert heights.sees_all(square[[3, 2, 1, 0, 4]])
    square[4, 0] = -0.1
    assert not heights.sees_all(square)


def test_a_warped_square_has_the_volume_of_the_bilinear_surface() -> None:
    corners = np.array([[0.0, 0, 1], [2, 0, 3], [2, 2, 0], [0, 2, 5]])

    def surface(y: float, x: float) -> float:
        u, v = x / 2, y / 2
        return (1 - u) * (1 - v) * 1 + u * (1 - v) * 3 + u * v * 0 + (1 - u) * v * 5

    truth, _ = dblquad(surface, 0, 2, 0, 2)
    assert heights.volume(corners, np.zeros(4)).value == pytest.approx(truth)


def test_the_plane_below_and_its_derivatives() -> None:
    rng = np.random.default_rng(3)
    three, places = rng.uniform(-5, 5, (3, 3)), rng.uniform(-9, 9, (4, 2))
    found = heights.plane_below(places, three)
    normal = np.cross(three[1] - three[0], three[2] - three[0])
    on_it = np.column_stack([places, found.height_m])
    np.testing.assert_allclose((on_it - three[0]) @ normal, 0, atol=1e-12)
    by_three = central_differences(
        lambda x: heights.plane_below(places, x.reshape(3, 3)).height_m, three.ravel()
    )
    np.testing.assert_allclose(found.by_three.reshape(4, 9), by_three, rtol=1e-6, atol=1e-8)
    by_place = central_differences(
        lambda x: heights.plane_below(x[None], three).height_m, places[0]
    )
    np.testing.assert_allclose(found.slope, by_place.ravel(), rtol=1e-6)


def test_a_profile_by_hand() -> None:
    points = np.array([[10.0, 20, 3], [13, 23, 5], [10, 30, 4]])
    value, _ = heights.profile(points)
    # The line runs north: 3 m to its right is 3 m east.
    np.testing.assert_allclose(value, [[0, 0, 0], [3, 3, 2], [10, 0, 1]], atol=1e-12)


def test_derivatives_of_a_profile_equal_central_differences() -> None:
    points = np.random.default_rng(8).uniform(-20, 20, (5, 3))
    gradient = heights.profile(points).gradient
    numeric = central_differences(
        lambda x: heights.profile(x.reshape(5, 3)).value.ravel(), points.ravel()
    )
    np.testing.assert_allclose(gradient.reshape(15, 15), numeric, rtol=1e-6, atol=1e-7)


UPRIGHT = np.array([[0.3, 0.1, 1], [0.3, 0.1, 2]])
IN_LINE = np.array([[0.0, 0, 1], [1, 1, 2], [3, 3, 0]])


def test_what_has_no_derivative_is_nan() -> None:
    for measure in (heights.horizontal_distance, heights.slope, heights.profile_length):
        value, gradient = measure(UPRIGHT)
        assert np.isnan(value)
        assert np.isnan(gradient).all()
    assert np.isnan(heights.profile(UPRIGHT).value).all()
    assert np.isnan(heights.volume(IN_LINE, np.zeros(3)).value)
    assert np.isnan(heights.plane_below(IN_LINE[:, :2], IN_LINE).height_m).all()
    assert heights.vertical_distance(UPRIGHT)[0] == 1
