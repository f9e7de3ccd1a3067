"""Rotations against scipy, and the laws of the group."""

from __future__ import annotations

import numpy as np
import pytest
from derivatives import assert_derivative, central_differences
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from uavgram.geometry.motion.rotation import (
    ENU_FROM_NED,
    GIMBAL_FROM_CAMERA,
    exp_so3,
    hat,
    log_so3,
    matrix_from_xyzw,
    matrix_from_ypr,
    nearest_rotation,
    right_jacobian,
    right_jacobian_inverse,
    xyzw_from_matrix,
    ypr_from_matrix,
)
from uavgram.model.arrays import Floats

SCALES = [0.0, 1e-300, 1e-12, 1e-8, 1e-4, 0.1, 0.29999, 0.30001, 1.0, 2.5, 3.1]


def vectors(scale: float, count: int = 50) -> Floats:
    v = np.random.default_rng(1).normal(size=(count, 3))
    result: Floats = scale * v / np.linalg.norm(v, axis=1, keepdims=True)
    return result


def test_hat_is_the_cross_product() -> None:
    a, b = np.random.default_rng(2).normal(size=(2, 4, 5, 3))
    np.testing.assert_allclose((hat(a) @ b[..., None])[..., 0], np.cross(a, b), atol=1e-15)


@pytest.mark.parametrize("scale", [*SCALES, np.pi, 7.0])
def test_exponential_is_scipys(scale: float) -> None:
    v = vectors(scale)
    np.testing.assert_allclose(exp_so3(v), Rotation.from_rotvec(v).as_matrix(), atol=4e-15)


@pytest.mark.parametrize("scale", [*SCALES, np.pi - 1e-4, np.pi - 1e-9])
def test_logarithm_undoes_the_exponential_near_zero_and_near_pi(scale: float) -> None:
    v = vectors(scale)
    np.testing.assert_allclose(log_so3(exp_so3(v)), v, rtol=1e-13, atol=4e-15)


def test_logarithm_of_half_a_turn_is_that_half_turn_either_way_round() -> None:
    axes = np.concatenate([np.eye(3), vectors(1.0)])
    v = log_so3(2 * axes[:, :, None] * axes[:, None, :] - np.eye(3))
    np.testing.assert_allclose(np.linalg.norm(v, axis=1), np.pi, rtol=1e-15)
    np.testing.assert_allclose(np.abs(np.sum(v * axes, axis=1)), np.pi, rtol=1e-14)


@pytest.mark.parametrize("scale", SCALES)
def test_right_jacobian_equals_central_differences(scale: float) -> None:
    v = vectors(scale)
    back = np.swapaxes(exp_so3(v), -1, -2)
    numeric = central_differences(lambda x: log_so3(back @ exp_so3(x)), v, 1e-3)
    assert_derivative(right_jacobian(v), numeric, 1e-9)


@pytest.mark.parametrize("scale", SCALES)
def test_inverse_right_jacobian_is_the_inverse(scale: float) -> None:
    v = vectors(scale)
    product = right_jacobian(v) @ right_jacobian_inverse(v)
    np.testing.assert_allclose(product, np.broadcast_to(np.eye(3), product.shape), atol=1e-13)


def test_right_jacobian_is_smooth_where_the_series_ends() -> None:
    below, above = (right_jacobian(np.array([0.0, 0.0, x])) for x in (0.3 - 1e-13, 0.3 + 1e-13))
    np.testing.assert_allclose(below, above, atol=1e-13)
    below, above = (
        right_jacobian_inverse(np.array([0.0, 0.0, x])) for x in (0.3 - 1e-13, 0.3 + 1e-13)
    )
    np.testing.assert_allclose(below, above, atol=1e-13)


def test_quaternions_are_scipys() -> None:
    q = np.random.default_rng(3).normal(size=(200, 4))  # of any length, as logs have them
    np.testing.assert_allclose(matrix_from_xyzw(q), Rotation.from_quat(q).as_matrix(), atol=1e-15)


def test_quaternion_of_a_matrix_is_scipys_with_positive_w() -> None:
    rotations = Rotation.random(500, random_state=4)
    expected = rotations.as_quat(canonical=True)
    np.testing.assert_allclose(xyzw_from_matrix(rotations.as_matrix()), expected, atol=2e-15)


def test_quaternion_survives_half_turns_about_each_axis() -> None:
    for axis in np.eye(3):
        q = xyzw_from_matrix(Rotation.from_rotvec(np.pi * axis).as_matrix())
        np.testing.assert_allclose(np.abs(q), [*axis, 0], atol=1e-15)


def test_zero_quaternion_has_no_matrix() -> None:
    assert np.isnan(matrix_from_xyzw(np.zeros(4))).all()


def test_yaw_pitch_roll_are_scipys_intrinsic_zyx() -> None:
    ypr = np.random.default_rng(5).uniform(-1.5, 1.5, (100, 3)) * [2, 1, 2]
    expected = Rotation.from_euler("ZYX", ypr).as_matrix()
    rotation = matrix_from_ypr(*ypr.T)
    np.testing.assert_allclose(rotation, expected, atol=1e-15)
    np.testing.assert_allclose(np.stack(ypr_from_matrix(rotation), -1), ypr, atol=1e-13)


@pytest.mark.parametrize("offset", [0.0, 1e-15, 1e-10, 1e-8, 1e-5])
@pytest.mark.parametrize("sign", [-1, 1])
def test_angles_belong_together_even_straight_up_and_down(sign: int, offset: float) -> None:
    yaw = np.linspace(-3, 3, 20)
    rotation = matrix_from_ypr(yaw, sign * (np.pi / 2 - offset), 0.4)
    again = matrix_from_ypr(*ypr_from_matrix(rotation))
    np.testing.assert_allclose(again, rotation, atol=3e-9 if offset == 1e-10 else 2e-15)


def test_straight_down_the_heading_is_in_the_yaw() -> None:
    yaw, pitch, roll = ypr_from_matrix(matrix_from_ypr(0.7, -np.pi / 2, 0.0))
    np.testing.assert_allclose([yaw, pitch, roll], [0.7, -np.pi / 2, 0.0], atol=1e-15)


def test_straight_up_and_down_yaw_has_what_yaw_and_roll_share() -> None:
    up, down = (ypr_from_matrix(matrix_from_ypr(0.7, p, 0.4)) for p in (np.pi / 2, -np.pi / 2))
    np.testing.assert_allclose(up, [0.3, np.pi / 2, 0.0], atol=1e-15)
    np.testing.assert_allclose(down, [1.1, -np.pi / 2, 0.0], atol=1e-15)


def test_axes_of_the_conventions() -> None:
    north, down = np.array([1.0, 0, 0]), np.array([0, 0, 1.0])
    np.testing.assert_array_equal(ENU_FROM_NED @ north, [0, 1, 0])
    np.testing.assert_array_equal(ENU_FROM_NED @ down, [0, 0, -1])
    optical_axis, right, image_down = np.array([0, 0, 1.0]), [1.0, 0, 0], [0, 1.0, 0]
    np.testing.assert_array_equal(GIMBAL_FROM_CAMERA @ optical_axis, [1, 0, 0])
    np.testing.assert_array_equal(GIMBAL_FROM_CAMERA @ right, [0, 1, 0])
    np.testing.assert_array_equal(GIMBAL_FROM_CAMERA @ image_down, [0, 0, 1])
    with pytest.raises(ValueError, match="read-only"):
        ENU_FROM_NED[0, 0] = 1


def test_looking_down_from_a_vehicle_that_heads_north_image_up_is_north() -> None:
    # The rule of project.yaml: yaw 0 and pitch -90: image up is the vehicle's nose.
    world_from_camera = ENU_FROM_NED @ matrix_from_ypr(0, -np.pi / 2, 0) @ GIMBAL_FROM_CAMERA
    np.testing.assert_allclose(world_from_camera @ [0, -1, 0], [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(world_from_camera @ [0, 0, 1], [0, 0, -1], atol=1e-15)


@given(st.lists(st.floats(-3, 3), min_size=3, max_size=3))
def test_a_rotation_is_orthogonal_and_its_negative_vector_undoes_it(numbers: list[float]) -> None:
    v = np.array(numbers)
    rotation = exp_so3(v)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=5e-15)
    np.testing.assert_allclose(rotation @ exp_so3(-v), np.eye(3), atol=5e-15)
    assert np.linalg.det(rotation) == pytest.approx(1)


def test_inputs_stay_as_they_were() -> None:
    v, q = vectors(1.0), np.random.default_rng(6).normal(size=(5, 4))
    r = exp_so3(v)
    for array in (v, q, r):
        array.flags.writeable = False
    hat(v), exp_so3(v), right_jacobian(v), right_jacobian_inverse(v)
    matrix_from_xyzw(q), xyzw_from_matrix(r), log_so3(r), ypr_from_matrix(r)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_nearest_rotation_is_the_one_that_aligns_vectors_best(sign: float) -> None:
    rng = np.random.default_rng(7)
    seen = rng.normal(size=(6, 9, 3))
    turned = seen @ exp_so3(rng.normal(size=(6, 3))).swapaxes(1, 2)
    turned = sign * (turned + 0.1 * rng.normal(size=seen.shape))
    expected = [
        Rotation.align_vectors(a, b)[0].as_matrix() for a, b in zip(turned, seen, strict=True)
    ]

    found = nearest_rotation(turned.swapaxes(1, 2) @ seen)
    np.testing.assert_allclose(found, expected, atol=1e-9)
    np.testing.assert_allclose(nearest_rotation(turned[0].T @ seen[0]), expected[0], atol=1e-9)
