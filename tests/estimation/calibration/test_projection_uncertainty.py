"""What errors of a calibration do in the image and on the ground: against sampled calibrations."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from uavgram.errors import GeometryError
from uavgram.estimation.calibration.difference import compare_cameras
from uavgram.estimation.calibration.projection_uncertainty import (
    compute_length_sigmas,
    compute_projection_covariance,
    compute_worst_sigma,
)
from uavgram.model.arrays import Floats
from uavgram.model.camera import Calibration

CAMERA = Calibration(
    name="c",
    model="brown",
    width_px=1024,
    height_px=768,
    parameters=np.array([820.0, 815, 512, 380, -0.21, 0.09, 8e-4, -5e-4, -0.02]),
    covariance=np.diag([1.5, 1.2, 2, 3, 2e-3, 3e-3, 1e-4, 2e-4, 1e-3]) ** 2,
)


def only(name: str, sigma: float) -> Calibration:
    index = CAMERA.parameter_names.index(name)
    covariance = np.zeros((9, 9))
    covariance[index, index] = sigma**2
    return replace(CAMERA, covariance=covariance)


def ground(
    parameters: Floats,
    pixel: Floats,
    tilt: float,
    turn: tuple[float, float, float] = (0, 0, 0),
    center: tuple[float, float, float] = (0, 0, 1),
) -> Floats:
    """Where OpenCV's rays meet the ground z = 0."""
    fx, fy, cx, cy = parameters[:4]
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    plane = cv2.undistortPoints(
        pixel[:, None].astype(float), matrix, parameters[4:], criteria=(3, 100, 1e-14)
    )[:, 0]
    ray = np.column_stack([plane, np.ones(len(plane))])
    down = np.array([[1, 0, 0], [0, -1, 0], [0, 0, -1.0]])
    world = (
        cv2.Rodrigues(np.array([tilt, 0, 0]))[0] @ down @ cv2.Rodrigues(np.array(turn, float))[0]
    )
    ray = ray @ world.T
    result: Floats = np.array(center) - ray * (center[2] / ray[:, 2:])
    return result


def test_an_unsure_principal_point_hides_in_a_turn() -> None:
    pixel, covariance = compute_projection_covariance(only("cx", 3.0))
    middle = np.argmin(np.sum((pixel - [512, 380]) ** 2, axis=1))
    assert compute_worst_sigma(covariance)[middle] < 0.6  # of 3 px
    free = compute_projection_covariance(only("fx", 3.0))
    assert compute_worst_sigma(free[1]).max() > 1.0


def test_the_uncertainty_of_a_projection_is_that_of_sampled_calibrations() -> None:
    pixel, covariance = compute_projection_covariance(CAMERA, columns=12)
    rng = np.random.default_rng(0)
    count = 300
    misses = np.array(
        [
            compare_cameras(CAMERA, replace(CAMERA, parameters=sample), columns=12).difference_px
            for sample in rng.multivariate_normal(CAMERA.parameters, CAMERA.covariance, count)
        ]
    )
    assert misses.shape[1:] == pixel.shape
    sampled = np.mean(np.sum(misses**2, axis=2), axis=0)
    expected = np.trace(covariance, axis1=1, axis2=2)
    # a sum of two squares with its chi-square bounds, 4 sigma; a sigma in place of a variance fails
    np.testing.assert_allclose(sampled, expected, rtol=4 * np.sqrt(2 / count))


def test_lengths_from_a_known_pose_are_those_of_sampled_calibrations() -> None:
    tilt = np.radians(30)
    ends = np.array([[[300.0, 300], [700, 320]], [[500, 200], [520, 600]]])
    found = compute_length_sigmas(CAMERA, tilt_rad=tilt, pixel_px=ends)
    rng = np.random.default_rng(1)
    samples = rng.multivariate_normal(CAMERA.parameters, CAMERA.covariance, 3000)
    points = np.array([ground(p, ends.reshape(-1, 2), tilt) for p in samples])
    length = np.linalg.norm(points[:, 1::2] - points[:, ::2], axis=2)
    np.testing.assert_allclose(found.length, length.mean(axis=0), rtol=2e-3)
    relative = length.std(axis=0) / length.mean(axis=0)
    np.testing.assert_allclose(found.pose_known, relative, rtol=5 / np.sqrt(2 * 3000))


def test_a_focal_length_alone_scales_all_lengths_seen_from_above() -> None:
    camera = replace(
        CAMERA,
        parameters=np.array([800.0, 800, 511.5, 383.5, 0, 0, 0, 0, 0]),
        covariance=np.zeros((9, 9)) + np.pad(np.full((2, 2), 64.0), (0, 7)),
    )
    found = compute_length_sigmas(camera, tilt_rad=0.0)
    np.testing.assert_allclose(found.pose_known, 0.01, rtol=1e-9)
    # from straight above a pose at another height sees just the same
    assert (found.pose_fitted < 1e-9).all()


def test_a_pose_that_follows_takes_most_of_the_error_away() -> None:
    found = compute_length_sigmas(CAMERA, tilt_rad=np.radians(30))
    assert (found.pose_fitted < found.pose_known).mean() > 0.9
    assert np.median(found.pose_fitted) < 0.5 * np.median(found.pose_known)


def test_lengths_above_the_horizon_are_told() -> None:
    with pytest.raises(GeometryError, match="does not see the ground"):
        compute_length_sigmas(
            CAMERA, tilt_rad=np.radians(85), pixel_px=np.array([[[500, 10], [600, 10]]])
        )
    level = compute_length_sigmas(CAMERA, tilt_rad=np.radians(75))  # those below it are there
    assert 0 < len(level.length) < 18
