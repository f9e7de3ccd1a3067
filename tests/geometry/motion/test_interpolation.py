"""Positions and rotations between samples."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from scipy.ndimage import median_filter, minimum_filter, percentile_filter
from scipy.spatial.transform import Rotation, Slerp

from uavgram.geometry.motion.interpolation import (
    SmoothPositions,
    SmoothRotations,
    compute_running_median,
    compute_running_rank,
    interpolate_rotation,
    make_running_windows,
)
from uavgram.geometry.motion.rotation import exp_so3
from uavgram.model.arrays import Floats

EPOCH_S = 1_700_000_000.0
Interpolate = Callable[[Floats, Floats, Floats], tuple[Floats, Floats]]
"""Of times, samples at them, and the times asked for: values and their rates."""


def flight() -> tuple[Floats, Floats, Floats, Floats]:
    rng = np.random.default_rng(1)
    time = EPOCH_S + np.cumsum(rng.uniform(0.1, 0.4, 50))
    at = np.sort(rng.uniform(time[0], time[-1], 200))
    xyzw = Rotation.random(50, random_state=2).as_quat()
    return time, rng.normal(size=(50, 3)), xyzw, np.concatenate([at, time])


def smooth_position(time: Floats, position: Floats, at: Floats) -> tuple[Floats, Floats]:
    return SmoothPositions(time, position).at(at)


def smooth_rotation(time: Floats, xyzw: Floats, at: Floats) -> tuple[Floats, Floats]:
    return SmoothRotations(time, xyzw).at(at)


def test_positions_are_scipys_cubic_hermite_through_the_samples() -> None:
    time, position, _, at = flight()
    # The parabola through three samples, by its own polynomial fit.
    velocity = np.empty_like(position)
    for i in range(1, 49):
        t = time[i - 1 : i + 2] - time[i]
        velocity[i] = np.polyfit(t, position[i - 1 : i + 2], 2)[1]
    velocity[0] = (position[1] - position[0]) / (time[1] - time[0])
    velocity[-1] = (position[-1] - position[-2]) / (time[-1] - time[-2])
    expected = CubicHermiteSpline(time - time[0], position, velocity)
    found, rate = smooth_position(time, position, at)
    np.testing.assert_allclose(found, expected(at - time[0]), atol=1e-6)
    np.testing.assert_allclose(rate, expected.derivative()(at - time[0]), atol=2e-5)


def test_a_steady_motion_is_interpolated_exactly() -> None:
    time = np.array([0.0, 2.0, 3.0, 7.0, 7.5])
    start, velocity = np.array([1.0, 2, 3]), np.array([0.5, -1, 2])
    at = np.array([0.0, 0.4, 2.0, 4.4, 7.5])
    position, rate = smooth_position(time, start + time[:, None] * velocity, at)
    np.testing.assert_allclose(position, start + at[:, None] * velocity, atol=1e-12)
    np.testing.assert_allclose(rate, np.broadcast_to(velocity, (5, 3)), atol=1e-12)


def test_two_samples_are_joined_by_a_straight_line() -> None:
    position, rate = smooth_position(np.array([0.0, 2.0]), np.eye(3)[:2], np.array([0.5]))
    np.testing.assert_allclose(position, [[0.75, 0.25, 0]])
    np.testing.assert_allclose(rate, [[-0.5, 0.5, 0]])


@pytest.mark.parametrize("smooth", ["position", "rotation"])
def test_rates_are_derivatives_and_have_no_steps_at_the_samples(smooth: str) -> None:
    time, position, xyzw, _ = flight()
    time = time - EPOCH_S
    step = Rotation.from_quat(xyzw[0])
    turns = np.random.default_rng(4).normal(0, 0.2, (50, 3))
    track = [step := step * Rotation.from_rotvec(t) for t in turns]
    xyzw = np.array([t.as_quat() for t in track])

    def at(instants: Floats) -> tuple[Floats, Floats]:
        if smooth == "position":
            return smooth_position(time, position, instants)
        return smooth_rotation(time, xyzw, instants)

    inner = np.random.default_rng(5).uniform(time[1], time[-2], 100)
    h = 1e-5
    (ahead, _), (behind, _), (_, rate) = at(inner + h), at(inner - h), at(inner)
    if smooth == "position":
        numeric = (ahead - behind) / (2 * h)
    else:
        numeric = Rotation.from_matrix(np.swapaxes(behind, 1, 2) @ ahead).as_rotvec() / (2 * h)
    np.testing.assert_allclose(rate, numeric, atol=1e-5)
    before, after = at(time[1:-1] - 1e-9)[1], at(time[1:-1] + 1e-9)[1]
    np.testing.assert_allclose(before, after, atol=1e-6)


def test_smooth_rotations_pass_through_their_samples() -> None:
    time, _, xyzw, _ = flight()
    expected = Rotation.from_quat(xyzw).as_matrix()
    np.testing.assert_allclose(smooth_rotation(time, xyzw, time)[0], expected, atol=1e-6)


def test_a_path_answers_alike_however_often_and_in_whatever_order_it_is_asked() -> None:
    time, position, xyzw, at = flight()
    for path in (SmoothPositions(time, position), SmoothRotations(time, xyzw)):
        first, backwards, again = path.at(at), path.at(at[::-1]), path.at(at)
        for found, turned, expected in zip(again, backwards, first, strict=True):
            np.testing.assert_array_equal(found, expected)
            np.testing.assert_array_equal(turned[::-1], expected)
        moved = path.at(at[50:150] + 1e-4)[0] - first[0][50:150]
        assert 0 < np.abs(moved).max() < 0.02


def test_rotations_are_scipys_slerp() -> None:
    time, _, xyzw, at = flight()
    expected = Slerp(time, Rotation.from_quat(xyzw))(at).as_matrix()
    np.testing.assert_allclose(interpolate_rotation(time, xyzw, at)[0], expected, atol=1e-6)


def test_the_sign_of_a_quaternion_means_nothing() -> None:
    time, _, xyzw, at = flight()
    flipped = xyzw * np.random.default_rng(3).choice([-1.0, 1.0], (50, 1))
    plain, rate = interpolate_rotation(time, xyzw, at)
    other, other_rate = interpolate_rotation(time, flipped, at)
    np.testing.assert_allclose(other, plain, atol=1e-12)
    np.testing.assert_allclose(other_rate, rate, atol=1e-9)


@pytest.mark.parametrize("interpolate", [interpolate_rotation, smooth_rotation])
def test_rate_is_the_angular_velocity_in_body_axes(interpolate: Interpolate) -> None:
    rate = np.array([0.3, -0.2, 0.5])
    time = np.arange(5.0)
    start = Rotation.from_rotvec([0.4, 1.0, -2.0])
    xyzw = (start * Rotation.from_rotvec(time[:, None] * rate)).as_quat()
    at = np.array([0.0, 0.37, 2.0, 3.9, 4.0])
    rotation, found = interpolate(time, xyzw, at)
    np.testing.assert_allclose(found, np.broadcast_to(rate, (5, 3)), atol=1e-14)
    np.testing.assert_allclose(
        rotation, start.as_matrix() @ exp_so3(at[:, None] * rate), atol=1e-14
    )


def test_a_turn_through_north_goes_the_short_way() -> None:
    xyzw = Rotation.from_euler("z", [[170.0], [-170.0]], degrees=True).as_quat()
    rotation, rate = interpolate_rotation(np.array([0.0, 1.0]), xyzw, np.array([0.5]))
    np.testing.assert_allclose(rotation[0] @ [1, 0, 0], [-1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(np.degrees(rate), [[0, 0, 20]], atol=1e-12)


@pytest.mark.parametrize("at", [-0.001, 1.001, np.nan])
@pytest.mark.parametrize(
    ("interpolate", "samples"),
    [(smooth_position, np.zeros((2, 3))), (interpolate_rotation, np.eye(4)[2:])],
)
def test_nothing_is_extrapolated(interpolate: Interpolate, samples: Floats, at: float) -> None:
    with pytest.raises(ValueError, match="1 of 2 instants lie outside"):
        interpolate(np.array([0.0, 1.0]), samples, np.array([0.5, at]))


def test_samples_must_be_two_and_in_order() -> None:
    with pytest.raises(ValueError, match="at least two"):
        smooth_position(np.zeros(1), np.zeros((1, 3)), np.zeros(1))
    with pytest.raises(ValueError, match="strictly increasing"):
        smooth_position(np.zeros(2), np.zeros((2, 3)), np.zeros(1))


def test_no_instants_make_no_rows() -> None:
    time, position, xyzw, _ = flight()
    assert smooth_position(time, position, np.empty(0))[0].shape == (0, 3)
    assert interpolate_rotation(time, xyzw, np.empty(0))[0].shape == (0, 3, 3)


def test_inputs_stay_as_they_were() -> None:
    arrays = flight()
    for array in arrays:
        array.flags.writeable = False
    time, position, xyzw, at = arrays
    smooth_position(time, position, at)
    interpolate_rotation(time, xyzw, at)


@pytest.mark.parametrize("size", [1, 2, 5, 6, 15])
@pytest.mark.parametrize("count", [1, 4, 100, 4097])  # less than a window, and more than a block
def test_running_ranks_are_those_of_scipys_filters(count: int, size: int) -> None:
    values = np.random.default_rng(count).normal(size=(count, 2))

    median, ninth = (
        compute_running_median(values, size),
        compute_running_rank(values, size, size * 9 // 10),
    )
    least, about = make_running_windows(values, size).min(axis=-1), (size, 1)
    np.testing.assert_array_equal(median, median_filter(values, about, mode="nearest"))
    np.testing.assert_array_equal(ninth, percentile_filter(values, 90, about, mode="nearest"))
    np.testing.assert_array_equal(least, minimum_filter(values, about, mode="nearest"))


def test_a_running_median_keeps_what_is_infinite_apart() -> None:
    values = np.array([0.0, np.inf, 1.0, np.inf, np.inf])

    assert compute_running_median(values, 3).tolist() == [0.0, 1.0, np.inf, np.inf, np.inf]
