"""The adjustment against OpenCV, against dense algebra, and against laws."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import board_scenes as scenes
import cv2
import numpy as np
import pytest

from uavgram.estimation.calibration import adjustment
from uavgram.estimation.calibration.adjustment import (
    Fit,
    Normals,
    UndeterminedError,
    adjust,
    fit_poses,
)
from uavgram.estimation.calibration.problem import Lens, Linearisation, make_lens, pad
from uavgram.estimation.calibration.start import estimate_first_values
from uavgram.model.arrays import Floats
from uavgram.model.board import BoardObservations, Bow, CalibrationOptions, IntrinsicsPrior

USUAL = CalibrationOptions()


def fit_of(observations: BoardObservations, options: CalibrationOptions = USUAL) -> Fit:
    lens, corners = make_lens(options), pad(observations, options.bow)
    photo = observations.photos[0]
    return adjust(
        lens, corners, estimate_first_values(lens, corners, (photo.width_px, photo.height_px))
    )


def residual_sigma(fit: Fit) -> Floats:
    """Standard deviations scaled by the residuals, as OpenCV does."""
    scale = fit.cost / fit.degrees_of_freedom
    return np.sqrt(np.diag(fit.parameter_covariance()) * scale)


@pytest.mark.parametrize("side", ["left", "right"])
def test_real_photos_give_opencvs_parameters_and_standard_deviations(
    data_dir: Path, side: str
) -> None:
    observations = scenes.opencv_chess(data_dir, side)
    fit = fit_of(observations)
    parameters, sigma, rms, _ = scenes.opencv_calibration(observations)
    assert fit.converged
    # OpenCV stops within 1e-6 of a sigma; k2 and k3 are no larger than their own sigmas
    np.testing.assert_allclose(fit.state.parameters[:4], parameters[:4], rtol=1e-6)
    assert (
        np.abs(fit.state.parameters - parameters) < 1e-6 * np.abs(parameters) + 1e-5 * sigma
    ).all()
    np.testing.assert_allclose(residual_sigma(fit), sigma, rtol=1e-3)
    count = fit.corners.count.sum()
    assert np.sqrt(fit.cost / count) * 0.1 == pytest.approx(rms, rel=1e-7)


def test_correlations_of_a_real_camera_are_what_they_are_known_to_be(data_dir: Path) -> None:
    covariance = fit_of(scenes.opencv_chess(data_dir, "left")).parameter_covariance()
    sigma = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(sigma, sigma)
    assert correlation[0, 1] == pytest.approx(0.98, abs=0.005)
    assert correlation[4, 5] == pytest.approx(-0.97, abs=0.01)


@pytest.mark.parametrize(
    ("options", "flags"),
    [
        (CalibrationOptions(coefficients=3), cv2.CALIB_ZERO_TANGENT_DIST),
        (CalibrationOptions(fixed_principal_point=True), cv2.CALIB_FIX_PRINCIPAL_POINT),
        (CalibrationOptions(), 0),
    ],
)
def test_every_option_gives_opencvs_result(options: CalibrationOptions, flags: int) -> None:
    scene = scenes.make_scene(7, photos=10, noise=0.2)
    observations = scenes.as_float32(scene.observations)
    fit = fit_of(observations, options)
    parameters, sigma, _, pose_sigma = scenes.opencv_calibration(observations, flags)
    free = sigma > 0
    np.testing.assert_allclose(fit.state.parameters[:4], parameters[:4], rtol=1e-6)
    assert (np.abs(fit.state.parameters - parameters)[free] < 1e-4 * sigma[free]).all()
    np.testing.assert_allclose(residual_sigma(fit)[free], sigma[free], rtol=1e-3)
    assert not fit.parameter_covariance()[~free].any()
    assert pose_sigma.shape == (10, 6)


def test_a_fixed_aspect_gives_opencvs_result() -> None:
    scene = scenes.make_scene(7, photos=10, noise=0.2)
    observations = scenes.as_float32(scene.observations)
    fit = fit_of(observations, CalibrationOptions(aspect=1.0))
    board = observations.board.corner_board_m.astype(np.float32)
    start = np.array([[800.0, 0, 512], [0, 800, 384], [0, 0, 1]])
    found = cv2.calibrateCameraExtended(
        [board[p.corner] for p in observations.photos],
        [p.pixel_px.astype(np.float32)[:, None] for p in observations.photos],
        scenes.SIZE, start, np.zeros(5),
        flags=cv2.CALIB_FIX_ASPECT_RATIO | cv2.CALIB_USE_INTRINSIC_GUESS,
        criteria=(3, 300, 1e-16),
    )  # fmt: skip
    matrix, sigma = found[1], found[5].ravel()
    np.testing.assert_allclose(
        fit.state.parameters[:4],
        [matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]],
        rtol=1e-6,
    )
    np.testing.assert_allclose(residual_sigma(fit)[1:9], sigma[1:9], rtol=1e-3)
    assert residual_sigma(fit)[0] == residual_sigma(fit)[1]  # fx hangs on fy


def test_a_rational_lens_fits_as_well_as_opencvs() -> None:
    scene = scenes.make_scene(8, scenes.BROWN8, photos=14, noise=0.05, whole=False, distance=(4, 9))
    observations = scenes.as_float32(scene.observations)
    fit = fit_of(observations, CalibrationOptions(coefficients=8))
    *_, rms, _ = scenes.opencv_calibration(observations, cv2.CALIB_RATIONAL_MODEL)
    ours = np.sqrt(fit.cost / fit.corners.count.sum()) * 0.05
    assert ours <= rms * (1 + 1e-6)
    # its parameters wander along a bent valley, so the likelihood judges
    truth = replace(fit.state, parameters=scene.parameters)
    excess = fit_poses(fit.lens, fit.corners, truth)[1].sum() - fit.cost
    assert 0 <= excess < 32.9  # chi-square with 12 degrees of freedom, 0.1 %


def test_a_fisheye_is_opencvs() -> None:
    scene = scenes.make_scene(9, scenes.FISHEYE, "fisheye", photos=10, noise=0.1, distance=(4.5, 8))
    fit = fit_of(scene.observations, CalibrationOptions(model="fisheye", coefficients=4))
    photos = scene.observations.photos
    board = scene.observations.board.corner_board_m
    flags = cv2.CALIB_RECOMPUTE_EXTRINSIC | cv2.CALIB_FIX_SKEW
    _, matrix, distortion, *_ = cv2.fisheye.calibrate(
        [board[p.corner][None] for p in photos],
        [p.pixel_px[None] for p in photos],
        scenes.SIZE, np.eye(3), np.zeros(4), flags=flags, criteria=(3, 300, 1e-14),
    )  # fmt: skip
    expected = [matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], *distortion.ravel()]
    sigma = np.sqrt(np.diag(fit.parameter_covariance()))
    assert (np.abs(fit.state.parameters - expected) < 1e-3 * sigma).all()


def dense(fit: Fit) -> Floats:
    """Joint covariance from one dense normal matrix."""
    photos, rows, q = fit.linear.border.shape
    whole = np.zeros((photos * rows, q + 6 * photos))
    for i in range(photos):
        part = slice(i * rows, (i + 1) * rows)
        whole[part, :q] = fit.linear.border[i]
        whole[part, q + 6 * i : q + 6 * (i + 1)] = fit.linear.pose[i]
    normal = whole.T @ whole
    normal[:q, :q] += fit.lens.full_basis.T @ fit.lens.prior_information @ fit.lens.full_basis
    scale = 1 / np.sqrt(np.diag(normal))
    return scale[:, None] * np.linalg.inv(normal * np.outer(scale, scale)) * scale


def joint_covariance(fit: Fit) -> Floats:
    """(q + 6 M, q + 6 M) covariance of all unknowns: the border, then the photos in their order."""
    gain = fit.normals.gain
    q, photos = fit.lens.size, len(gain)
    # pose = own error - gain @ (error of the border)
    spread = np.concatenate([np.eye(q), -gain.reshape(-1, q)])
    joint = spread @ fit.border_covariance @ spread.T
    for i in range(photos):
        block = slice(q + 6 * i, q + 6 * (i + 1))
        joint[block, block] += fit.normals.pose_inverse[i]
    result: Floats = joint
    return result


@pytest.mark.parametrize("bow", ["flat", "paraboloid"])
def test_the_joint_covariance_is_that_of_the_whole_normal_matrix(bow: Bow) -> None:
    scene = scenes.make_scene(10, photos=5, whole=False)
    fit = fit_of(scene.observations, CalibrationOptions(bow=bow, bow_sigma_m=0.1))
    expected = dense(fit)
    scale = np.sqrt(np.diag(expected))
    difference = (joint_covariance(fit) - expected) / np.outer(scale, scale)
    assert np.abs(difference).max() < 1e-6
    q = fit.lens.size
    np.testing.assert_allclose(fit.border_covariance, expected[:q, :q], rtol=1e-6, atol=1e-18)


def test_without_the_poses_errors_the_covariance_would_be_wrong(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # the planted bug: the border's normal matrix with the poses taken as known
    def no_schur(lens: Lens, linear: Linearisation) -> Normals:
        photo = np.swapaxes(linear.border, 1, 2) @ linear.border
        border = photo.sum(axis=0) + adjustment.compute_prior_normal(lens)
        return schur(lens, linear)._replace(border=border)

    schur = adjustment.eliminate_poses
    monkeypatch.setattr(adjustment, "eliminate_poses", no_schur)
    fit = fit_of(scenes.make_scene(10, photos=5).observations)
    wrong, right = np.diag(fit.border_covariance), np.diag(dense(fit))[: fit.lens.size]
    assert (wrong < 0.9 * right).any()


def test_a_photo_counted_twice_is_an_observation_more() -> None:
    scene = scenes.make_scene(11, photos=6)
    photos = scene.observations.photos
    once = fit_of(scene.observations)
    twice = fit_of(BoardObservations(board=scene.observations.board, photos=(*photos, *photos)))
    np.testing.assert_allclose(twice.state.parameters, once.state.parameters, rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(twice.border_covariance * 2, once.border_covariance, rtol=1e-5)


def test_a_prior_is_an_observation_of_the_parameters() -> None:
    scene = scenes.make_scene(12, photos=5)
    sigma = np.array([5.0, 5, 3, 3, 0.01, 0.02, 1e-3, 1e-3, 0.02])
    mean = scenes.BROWN5 + sigma * np.array([1, -1, 1, 1, -1, 1, 0, 1, 1])
    prior = IntrinsicsPrior(source="test", parameters=mean, information=np.diag(sigma**-2.0))
    free = fit_of(scene.observations)
    fit = fit_of(scene.observations, CalibrationOptions(prior=prior))
    # two independent estimates of the same parameters, put together
    first, second = np.linalg.inv(free.border_covariance), np.diag(sigma**-2.0)
    joint = np.linalg.inv(first + second)
    expected = joint @ (first @ free.state.parameters + second @ mean)
    np.testing.assert_allclose(np.diag(fit.border_covariance), np.diag(joint), rtol=0.02)
    assert (np.abs(fit.state.parameters - expected) < 0.1 * np.sqrt(np.diag(joint))).all()
    assert fit.degrees_of_freedom == free.degrees_of_freedom + 9
    assert fit.corner_redundancy < free.degrees_of_freedom + 9


def test_a_bent_board_is_found_bent() -> None:
    scene = scenes.make_scene(13, photos=12, noise=0.1, bow=(0.05, -0.03))
    options = CalibrationOptions(bow="paraboloid", bow_sigma_m=1.0)
    fit = fit_of(scene.observations, options)
    sigma = np.sqrt(np.diag(fit.parameter_covariance()))[9:]
    assert (np.abs(fit.state.bow_m - [0.05, -0.03]) < 3.5 * sigma).all()
    assert fit.cost / fit.degrees_of_freedom < 1.2
    flat = fit_of(scene.observations)
    assert flat.cost / flat.degrees_of_freedom > 1.5


def test_poses_alone_are_opencvs() -> None:
    scene = scenes.make_scene(14, photos=4, noise=0.3)
    fit = fit_of(scene.observations)
    camera = fit.state.parameters
    state, cost = fit_poses(fit.lens, fit.corners, fit.state)
    matrix = np.array([[camera[0], 0, camera[2]], [0, camera[1], camera[3]], [0, 0, 1]])
    for i, photo in enumerate(scene.observations.photos):
        point = scene.observations.board.corner_board_m[photo.corner]
        _, turn, shift = cv2.solvePnP(point, photo.pixel_px, matrix, camera[4:])
        turn, shift = cv2.solvePnPRefineLM(
            point, photo.pixel_px, matrix, camera[4:], turn, shift, (3, 100, 1e-15)
        )
        rotation = cv2.Rodrigues(turn)[0]
        np.testing.assert_allclose(state.camera_from_board[i], rotation, atol=1e-6)
    assert cost.sum() <= fit.cost * (1 + 1e-9)


def test_photos_that_do_not_determine_the_camera_are_told() -> None:
    # the board always parallel to the image: focal length and distance are one unknown
    pinhole = np.array([820.0, 815, 511.5, 383.5, 0, 0, 0, 0, 0])
    scene = scenes.make_scene(15, pinhole, photos=5, noise=0, tilt_deg=0)
    lens, corners = make_lens(CalibrationOptions()), pad(scene.observations, "flat")
    with pytest.raises(UndeterminedError, match=r"do not determine .*: take more photos"):
        adjust(lens, corners, scenes.true_state(scene, pinhole))
