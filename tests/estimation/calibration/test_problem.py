"""Residuals and Jacobians of a calibration: OpenCV's projection, central differences, padding."""

from __future__ import annotations

from dataclasses import replace

import board_scenes as scenes
import numpy as np
import pytest

from uavgram.estimation.calibration.problem import (
    compute_bow,
    linearise,
    make_focal_and_center_prior,
    make_lens,
    pad,
)
from uavgram.model.arrays import Floats
from uavgram.model.board import CalibrationOptions, IntrinsicsPrior, flat_board
from uavgram.model.camera import Calibration

CASES = {
    "brown 3": (scenes.BROWN3, CalibrationOptions(coefficients=3)),
    "brown 5": (scenes.BROWN5, CalibrationOptions()),
    "brown 8": (scenes.BROWN8, CalibrationOptions(coefficients=8)),
    "fisheye": (scenes.FISHEYE, CalibrationOptions(model="fisheye", coefficients=4)),
    "aspect": (scenes.BROWN5, CalibrationOptions(aspect=820 / 815)),
    "centre held": (scenes.BROWN5, CalibrationOptions(fixed_principal_point=True)),
    "bowl": (scenes.BROWN5, CalibrationOptions(bow="bowl")),
    "paraboloid": (scenes.BROWN8, CalibrationOptions(coefficients=8, bow="paraboloid")),
}


@pytest.mark.parametrize("name", CASES)
def test_derivatives_equal_central_differences(name: str) -> None:
    parameters, options = CASES[name]
    scene = scenes.make_scene(3, parameters, options.model, photos=3, noise=0.0, whole=False)
    lens, corners = make_lens(options), pad(scene.observations, options.bow)
    bow = [0.03, -0.02][: corners.bow.shape[2]]
    state = scenes.true_state(scene, parameters, bow)
    linear = linearise(lens, corners, state)
    q = lens.size
    scale = np.ones(q)
    scale[lens.full_basis[:2].any(axis=0) | lens.full_basis[2:4].any(axis=0)] = 100.0

    def residual(step: Floats) -> Floats:
        moved = state.apply_step(lens, step[:q] * scale, np.tile(step[q:], (3, 1)))
        there = linearise(lens, corners, moved)
        assert there is not None
        return there.residual

    assert linear is not None
    numeric = np.empty((*linear.residual.shape, q + 6))
    for i in range(q + 6):
        h = np.zeros(q + 6)
        h[i] = 1e-4
        numeric[..., i] = (residual(h) - residual(-h)) / 2e-4
    analytic = np.concatenate([linear.border * scale, linear.pose], axis=2)
    size = np.abs(numeric).max(axis=(0, 1))
    assert (size > 0).all()
    assert (np.abs(analytic - numeric) < 1e-5 * size).all()


@pytest.mark.parametrize("name", ["brown 5", "brown 8", "fisheye"])
def test_residuals_of_the_truth_are_zero(name: str) -> None:
    parameters, options = CASES[name]
    scene = scenes.make_scene(
        3, parameters, options.model, photos=8, noise=0.0, whole=False, distance=(4, 9)
    )
    lens, corners = make_lens(options), pad(scene.observations, "flat")
    assert len(set(corners.count)) > 1  # partial views
    linear = linearise(lens, corners, scenes.true_state(scene, parameters))
    assert linear is not None
    assert np.abs(linear.residual).max() < 1e-9


def test_a_board_behind_the_camera_is_refused() -> None:
    scene = scenes.make_scene(3, photos=3)
    state = scenes.true_state(scene, scenes.BROWN5)
    behind = replace(state, middle_camera_m=-state.middle_camera_m)
    assert (
        linearise(make_lens(CalibrationOptions()), pad(scene.observations, "flat"), behind) is None
    )


def test_a_bow_is_the_height_of_the_middle_over_the_rim() -> None:
    board = flat_board(5, 3, 0.1)
    both = compute_bow(board, "paraboloid")
    np.testing.assert_allclose(both[7], [1, 1])  # the middle
    np.testing.assert_allclose(both[[0, 4, 10, 14]], 0, atol=1e-15)
    one = compute_bow(board, "bowl")[:, 0]
    assert one[7] == 1
    np.testing.assert_allclose(one[[0, 4, 10, 14]], 0, atol=1e-15)
    # a bowl has the same curvature both ways: the fall is as the squared distance
    assert (1 - one[6]) == pytest.approx((1 - one[2]), rel=1e-12)


def test_coefficients_beyond_a_prior_stay_unknown() -> None:
    prior = IntrinsicsPrior(source="a table", parameters=scenes.BROWN5, information=np.eye(9))
    lens = make_lens(CalibrationOptions(coefficients=8, prior=prior))  # k4 to k6
    assert lens.prior_information.shape == (12, 12)
    assert lens.prior_information[:9, :9].any()
    assert not lens.prior_information[9:].any()


@pytest.mark.parametrize("options", [CASES["brown 8"][1], CASES["fisheye"][1]])
def test_focal_length_and_centre_are_known_for_any_lens_and_its_distortion_is_not(
    options: CalibrationOptions,
) -> None:
    covariance = np.diag([8.0, 8, 5, 6, 0.1, 0.1, 0.1, 0.1, 0.1]) ** 2
    covariance[0, 1] = covariance[1, 0] = 0.9 * 64
    camera = Calibration(
        name="table",
        model="brown",
        width_px=1024,
        height_px=768,
        parameters=np.array([800.0, 801, 510, 380, 0.3, 0, 0, 0, 0]),
        covariance=covariance,
    )
    lens = make_lens(
        replace(options, prior=make_focal_and_center_prior(camera, options.model, "EXIF"))
    )
    np.testing.assert_array_equal(lens.prior_mean[:4], [800, 801, 510, 380])
    np.testing.assert_allclose(
        np.linalg.inv(lens.prior_information[:4, :4]), covariance[:4, :4], rtol=1e-9
    )
    assert not lens.prior_information[4:].any() or options.bow != "flat"
    assert not lens.prior_mean[4:].any()
