"""Positions and rotations between samples."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import interp1d
from scipy.spatial.transform import Rotation, Slerp

from uavgram.geometry.interpolation import interpolate_position, interpolate_rotation
from uavgram.geometry.rotation import exp_so3

EPOCH_S = 1_700_000_000.0


def flight() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    time = EPOCH_S + np.cumsum(rng.uniform(0.1, 0.4, 50))
    at = np.sort(rng.uniform(time[0], time[-1], 200))
    xyzw = Rotation.random(50, random_state=2).as_quat()
    return time, rng.normal(size=(50, 3)), xyzw, np.concatenate([at, time])


def test_positions_are_scipys_linear_interpolation():
    time, position, _, at = flight()
    expected = interp1d(time, position, axis=0)(at)
    np.testing.assert_allclose(interpolate_position(time, position, at)[0], expected, atol=1e-7)


def test_velocity_is_the_slope_of_the_interval():
    time = np.array([0.0, 2.0, 3.0])
    position = np.array([[0.0, 0, 0], [2, 4, 6], [5, 5, 5]])
    _, velocity = interpolate_position(time, position, np.array([0.0, 1.9, 2.0, 3.0]))
    np.testing.assert_allclose(velocity, [[1, 2, 3], [1, 2, 3], [3, 1, -1], [3, 1, -1]])


def test_rotations_are_scipys_slerp():
    time, _, xyzw, at = flight()
    expected = Slerp(time, Rotation.from_quat(xyzw))(at).as_matrix()
    np.testing.assert_allclose(interpolate_rotation(time, xyzw, at)[0], expected, atol=1e-6)


def test_the_sign_of_a_quaternion_means_nothing():
    time, _, xyzw, at = flight()
    flipped = xyzw * np.random.default_rng(3).choice([-1.0, 1.0], (50, 1))
    plain, rate = interpolate_rotation(time, xyzw, at)
    other, other_rate = interpolate_rotation(time, flipped, at)
    np.testing.assert_allclose(other, plain, atol=1e-12)
    np.testing.assert_allclose(other_rate, rate, atol=1e-9)


def test_rate_is_the_angular_velocity_in_body_axes():
    rate = np.array([0.3, -0.2, 0.5])
    time = np.arange(5.0)
    start = Rotation.from_rotvec([0.4, 1.0, -2.0])
    xyzw = (start * Rotation.from_rotvec(time[:, None] * rate)).as_quat()
    at = np.array([0.0, 0.37, 2.0, 3.9, 4.0])
    rotation, found = interpolate_rotation(time, xyzw, at)
    np.testing.assert_allclose(found, np.broadcast_to(rate, (5, 3)), atol=1e-14)
    np.testing.assert_allclose(
        rotation, start.as_matrix() @ exp_so3(at[:, None] * rate), atol=1e-14
    )


def test_a_turn_through_north_goes_the_short_way():
    xyzw = Rotation.from_euler("z", [[170.0], [-170.0]], degrees=True).as_quat()
    rotation, rate = interpolate_rotation(np.array([0.0, 1.0]), xyzw, np.array([0.5]))
    np.testing.assert_allclose(rotation[0] @ [1, 0, 0], [-1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(np.degrees(rate), [[0, 0, 20]], atol=1e-12)


@pytest.mark.parametrize("at", [-0.001, 1.001, np.nan])
@pytest.mark.parametrize(
    ("interpolate", "samples"),
    [(interpolate_position, np.zeros((2, 3))), (interpolate_rotation, np.eye(4)[2:])],
)
def test_nothing_is_extrapolated(interpolate, samples, at):
    with pytest.raises(ValueError, match="1 of 2 instants lie outside"):
        interpolate(np.array([0.0, 1.0]), samples, np.array([0.5, at]))


def test_samples_must_be_two_and_in_order():
    with pytest.raises(ValueError, match="at least two"):
        interpolate_position(np.zeros(1), np.zeros((1, 3)), np.zeros(1))
    with pytest.raises(ValueError, match="strictly increasing"):
        interpolate_position(np.zeros(2), np.zeros((2, 3)), np.zeros(1))


def test_no_instants_make_no_rows():
    time, position, xyzw, _ = flight()
    assert interpolate_position(time, position, np.empty(0))[0].shape == (0, 3)
    assert interpolate_rotation(time, xyzw, np.empty(0))[0].shape == (0, 3, 3)


def test_inputs_stay_as_they_were():
    arrays = flight()
    for array in arrays:
        array.flags.writeable = False
    time, position, xyzw, at = arrays
    interpolate_position(time, position, at)
    interpolate_rotation(time, xyzw, at)
