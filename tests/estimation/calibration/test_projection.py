"""The difference of two calibrations against OpenCV and scipy, and its covariance by experiment."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from opencv_rays import undistort
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from uavgram.errors import GeometryError
from uavgram.estimation.calibration.projection import (
    compare_cameras,
    compute_length_sigmas,
    compute_projection_covariance,
    compute_worst_sigma,
    make_image_grid,
)
from uavgram.model.arrays import Floats
from uavgram.model.camera import Calibration

WIDTH, HEIGHT = 4000, 3000
PARAMETERS = np.array([2300.0, 2305, 2005, 1490, -0.05, 0.02, 4e-4, -2e-4, 0.001])
OTHER = np.array([2330.0, 2331, 1960, 1530, -0.03, 0.01, -1e-4, 3e-4, 0.003])
SIGMA = np.array([3.0, 5, 8, 4, 1e-3, 2e-3, 1e-4, 2e-4, 1e-3])


def brown(
    parameters: Floats = PARAMETERS,
    sigma: Floats | None = None,
    size: tuple[int, int] = (WIDTH, HEIGHT),
) -> Calibration:
    n = len(parameters)
    covariance = np.zeros((n, n)) if sigma is None else np.diag(np.square(sigma))
    return Calibration(
        name="c",
        model="brown",
        width_px=size[0],
        height_px=size[1],
        parameters=parameters,
        covariance=covariance,
    )


def cv_matrix(p: Floats) -> Floats:
    return np.array([[p[0], 0, p[2]], [0, p[1], p[3]], [0, 0, 1.0]])


def cv_project(parameters: Floats, points: Floats) -> Floats:
    pixel = cv2.projectPoints(
        points, np.zeros(3), np.zeros(3), cv_matrix(parameters), parameters[4:]
    )
    return np.asarray(pixel[0][:, 0], np.float64)


def cv_rays(parameters: Floats, pixel: Floats) -> Floats:
    """OpenCV's own iteration, long enough."""
    flat = undistort(pixel[:, None], cv_matrix(parameters), parameters[4:])[:, 0]
    return np.column_stack([flat, np.ones(len(flat))])


def test_it_is_the_smallest_difference_that_opencv_and_scipy_can_find() -> None:
    found = compare_cameras(brown(), brown(OTHER), columns=12)
    pixel = make_image_grid(WIDTH, HEIGHT, 12)
    points = cv_rays(PARAMETERS, pixel)

    def misfit(x: Floats) -> Floats:
        return (
            cv_project(OTHER, points @ Rotation.from_rotvec(x[:3]).as_matrix().T) - pixel
        ).ravel()

    best = least_squares(misfit, np.zeros(3), xtol=1e-15, ftol=1e-15, gtol=1e-15)

    np.testing.assert_allclose(found.pixel_px, pixel)
    np.testing.assert_allclose(found.difference_px.ravel(), best.fun, atol=2e-4)
    np.testing.assert_allclose(found.rotation_rad, best.x[:3], atol=1e-7)
    np.testing.assert_allclose(found.rms_px, np.sqrt(2 * best.cost / len(pixel)), rtol=1e-6)


def test_a_camera_does_not_differ_from_itself() -> None:
    difference = compare_cameras(brown(), brown())

    assert difference.max_px < 1e-8
    assert difference.share_seen == 1.0
    assert (difference.z == 0).all()


def test_a_principal_point_moved_aside_is_mostly_a_turn_of_the_camera() -> None:
    tele = np.array([20000.0, 20000, 1999.5, 1499.5, 0, 0, 0, 0, 0])
    difference = compare_cameras(brown(tele), brown(tele + np.eye(9)[2] * 20.0))

    # 20 px to the right at f = 20000 px: turned about y by a thousandth
    np.testing.assert_allclose(difference.rotation_rad, [0, -1e-3, 0], atol=1e-5)
    assert difference.rms_px < 0.2


def test_lens_models_may_differ() -> None:
    fisheye = Calibration(
        name="f",
        model="fisheye",
        width_px=WIDTH,
        height_px=HEIGHT,
        parameters=np.array([2300.0, 2300, 1999.5, 1499.5, 0, 0, 0, 0]),
        covariance=np.zeros((8, 8)),
    )
    pinhole = brown(np.array([2300.0, 2300, 1999.5, 1499.5, 0, 0, 0, 0, 0]))
    difference = compare_cameras(pinhole, fisheye)
    radius = np.hypot(*(difference.pixel_px - [1999.5, 1499.5]).T)

    # f tan(theta) against f theta, and by symmetry without a turn
    np.testing.assert_allclose(difference.rotation_rad, 0, atol=1e-9)
    np.testing.assert_allclose(
        difference.size_px, radius - 2300 * np.arctan(radius / 2300), atol=1e-6
    )


@pytest.mark.statistical
@pytest.mark.parametrize("which", ["first", "second"])
def test_the_covariance_is_that_of_repeated_calibrations(which: str) -> None:
    rng = np.random.default_rng(5)
    runs, squared = 100, []
    for _ in range(runs):
        drawn = brown(PARAMETERS + rng.normal(size=9) * SIGMA, SIGMA)
        pair = (drawn, brown()) if which == "first" else (brown(), drawn)
        difference = compare_cameras(*pair, columns=5)
        squared.append(difference.z**2)
    mean = np.mean(squared, axis=0)
    low, high = chi2.ppf(np.array([1e-6, 1 - 1e-6]), 2 * runs) / runs

    assert (mean > low).all()
    assert (mean < high).all()


def test_without_the_turn_in_it_the_covariance_would_be_wrong(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The experiment above sees it: the raw projection errors are far larger than what remains."""
    known = compare_cameras(brown(sigma=SIGMA), brown(), columns=8)
    monkeypatch.setattr(np.linalg, "lstsq", _blind(np.linalg.lstsq))
    raw = compare_cameras(brown(sigma=SIGMA), brown(), columns=8)

    assert raw.expected_rms_px > 1.5 * known.expected_rms_px


def _blind(solve: Callable[..., Any]) -> Callable[..., Any]:
    def lstsq(a: Floats, b: Floats, rcond: None = None) -> Any:  # noqa: ANN401 - as lstsq
        solution = solve(a, b, rcond=rcond)
        return (np.zeros_like(solution[0]), *solution[1:]) if b.ndim == 2 else solution

    return lstsq


def test_images_of_different_sizes_cannot_be_compared() -> None:
    with pytest.raises(GeometryError, match="scale one of them"):
        compare_cameras(brown(), brown(size=(2000, 1500)))


def test_cameras_that_see_nothing_in_common_are_refused() -> None:
    folded = PARAMETERS.copy()
    folded[4] = -60.0
    with pytest.raises(GeometryError, match="in common"):
        compare_cameras(brown(), brown(folded))


# What errors of a calibration do in the image and on the ground: against sampled calibrations.


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
    found = compute_length_sigmas(CAMERA, tilt_rad=tilt)
    ends = found.pixel_px
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
        compute_length_sigmas(CAMERA, tilt_rad=np.radians(150))
    level = compute_length_sigmas(CAMERA, tilt_rad=np.radians(75))  # those below it are there
    assert 0 < len(level.length) < 18
