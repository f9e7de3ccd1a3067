"""Camera poses from the telemetry: by hand, and every derivative by central differences."""

from __future__ import annotations

import numpy as np
import pytest
from derivatives import assert_derivative, central_differences
from scipy.spatial.transform import Rotation

from uavgram.geometry.motion.camera_motion import (
    SHARED_SIZE,
    FlightPath,
    correct_time,
    predict_pose,
)
from uavgram.geometry.motion.rotation import (
    ENU_FROM_NED,
    GIMBAL_FROM_CAMERA,
    log_so3,
    matrix_from_ypr,
    xyzw_from_matrix,
)
from uavgram.model.arrays import Floats

AT_S = np.array([0.5, 1.4, 2.7])
TimedTrack = tuple[Floats, Floats]
"""Times, and positions or attitudes at them."""

NO_GIMBAL = (np.empty(0), np.empty((0, 4)))


def tracks(*, gimbal: bool) -> tuple[TimedTrack, TimedTrack, TimedTrack]:
    rng = np.random.default_rng(1)
    time = np.arange(4.0)
    turns = Rotation.from_rotvec(rng.normal(size=(2, 4, 3)).reshape(8, 3) * 0.5).as_quat()
    position = rng.uniform(-30, 30, (4, 3))
    mount = (time, turns[4:]) if gimbal else NO_GIMBAL
    return (time, position), (time, turns[:4]), mount


@pytest.mark.parametrize("gimbal", [False, True])
def test_derivatives_equal_central_differences(*, gimbal: bool) -> None:
    nominal = Rotation.from_rotvec([0.3, -1.2, 0.4]).as_matrix()
    shared = np.array([0.02, -0.05, 0.03, 0.4, -0.2, 0.1, 1.0, -2, 0.5, 0.1, 0.07, 0.04])
    middle = 1.6

    def pose(values: Floats) -> tuple[Floats, Floats, Floats]:
        at = AT_S - values[10] - values[11] * (AT_S - middle)
        np.testing.assert_allclose(correct_time(values, AT_S, middle), at, atol=1e-15)
        exposures = FlightPath(*tracks(gimbal=gimbal)).at(at)
        return predict_pose(exposures, nominal, values, AT_S - middle)

    _, rotation, jacobian = pose(shared)
    back = np.swapaxes(rotation, -1, -2)

    def error(values: Floats) -> Floats:
        center, turned, _ = pose(values)
        return np.concatenate([center, log_so3(back @ turned)], axis=1)

    assert jacobian.shape == (3, 6, SHARED_SIZE)
    assert_derivative(jacobian, central_differences(error, shared, 1e-4))


def test_level_flight_heading_east_with_the_camera_looking_straight_down() -> None:
    world_from_body = ENU_FROM_NED @ matrix_from_ypr(np.pi / 2, 0, 0)
    xyzw = np.tile(xyzw_from_matrix(world_from_body), (2, 1))
    time, position = np.array([0.0, 1.0]), np.array([[0.0, 0, 50], [10, 0, 50]])
    exposures = FlightPath((time, position), (time, xyzw), NO_GIMBAL).at(np.array([0.5]))
    shared = np.zeros(SHARED_SIZE)
    shared[3:6] = [0.2, 0.1, 0.05]  # forward, right, down
    shared[6:9] = [1, 2, 3]  # the log's positions are that much too far east, north, up
    mount_from_camera = matrix_from_ypr(0, -np.pi / 2, 0) @ GIMBAL_FROM_CAMERA
    center, rotation, _ = predict_pose(exposures, mount_from_camera, shared, np.zeros(1))
    np.testing.assert_allclose(center, [[5 - 1 + 0.2, -2 - 0.1, 50 - 3 - 0.05]])
    np.testing.assert_allclose(rotation[0] @ [0, 0, 1], [0, 0, -1], atol=1e-15)
    np.testing.assert_allclose(rotation[0] @ [0, -1, 0], [1, 0, 0], atol=1e-15)


def test_a_heading_that_reads_too_far_clockwise_is_turned_back() -> None:
    xyzw = np.tile(xyzw_from_matrix(ENU_FROM_NED @ matrix_from_ypr(0.1, 0, 0)), (2, 1))
    time = np.array([0.0, 1.0])
    exposures = FlightPath((time, np.zeros((2, 3))), (time, xyzw), NO_GIMBAL).at(np.array([0.5]))
    shared = np.zeros(SHARED_SIZE)
    shared[9] = 0.1
    _, rotation, _ = predict_pose(exposures, np.eye(3), shared, np.zeros(1))
    np.testing.assert_allclose(rotation[0] @ [1, 0, 0], [0, 1, 0], atol=1e-15)
