"""A readout time among the unknowns: against a projection of its own, row by row."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rolling_scenes import NOMINAL, read_in_rows, true_motion
from scenes import Scene, make_scene

from uavgram.estimation.measuring.predicted_pixels import predict_pixels
from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.observed import add_readout
from uavgram.estimation.survey.unknowns import apply_increment
from uavgram.geometry.ground.row_projection import RowPoses, project_rows, sight_lines
from uavgram.geometry.motion.camera_motion import camera_motion
from uavgram.model.arrays import Floats
from uavgram.model.camera import Readout
from uavgram.model.flight_log import Track
from uavgram.model.options import SolveOptions
from uavgram.stages.refine import refine

READOUT_S = 0.04


@pytest.fixture(scope="module")
def exact() -> Scene:
    return read_in_rows(make_scene(4, noise=0.0), READOUT_S, noise=0.0)


def dense(block: Block, size: int) -> Floats:
    """(n, r, size) Jacobian of a block by all unknowns."""
    n, r, _ = block.jacobian.shape
    whole = np.zeros((n, r, size))
    rows = np.arange(n)[:, None, None]
    np.add.at(whole, (rows, np.arange(r)[:, None], block.columns[:, None, :]), block.jacobian)
    return whole


def problem_of(scene: Scene) -> SurveyProblem:
    return SurveyProblem(scene.survey, scene.pivot, np.ones(6, dtype=bool))


def test_exact_rows_leave_no_residual_and_their_shift_is_large(exact: Scene) -> None:
    blocks = problem_of(exact).evaluate(exact.truth)
    still = problem_of(exact).evaluate(replace(exact.truth, readout=np.zeros(1)))

    assert blocks is not None
    assert still is not None
    assert np.abs(blocks["pixels"].residual).max() < 1e-4  # in sigmas: the looked-up motion's error
    assert np.abs(still["pixels"].residual).max() > 1.0


def test_every_jacobian_equals_central_differences() -> None:
    scene = read_in_rows(make_scene(3, roughness=0.05, control=3), READOUT_S)
    problem = problem_of(scene)
    layout = problem.layout
    change = 0.01 * np.random.default_rng(1).normal(size=layout.size)
    state = apply_increment(layout, scene.truth, change)
    blocks = problem.evaluate(state)

    assert blocks is not None
    assert layout.readout == 1
    for name in ("pixels", "readout"):
        analytic = dense(blocks[name], layout.size)
        numeric = np.zeros_like(analytic)
        for column in range(layout.size):
            step = np.zeros(layout.size)
            step[column] = 1e-5
            ahead, behind = (
                problem.evaluate(apply_increment(layout, state, s * step)) for s in (1, -1)
            )
            assert ahead is not None
            assert behind is not None
            numeric[:, :, column] = (ahead[name].residual - behind[name].residual) / 2e-5
        scale = np.abs(analytic).max(axis=(0, 1))  # each unknown by its own size
        error = np.abs(analytic - numeric).max(axis=(0, 1))
        assert (error <= 3e-6 * np.maximum(scale, scale.max() * 1e-6)).all(), name
    assert np.abs(dense(blocks["pixels"], layout.size)[:, :, layout.first_readout]).max() > 1.0


def test_the_motion_is_that_of_the_camera(exact: Scene) -> None:
    survey = exact.survey
    assert survey.telemetry is not None
    assert isinstance(survey.track, Track)
    found = camera_motion(survey.track, survey.telemetry, survey.frame_id, exact.truth.telemetry)

    np.testing.assert_allclose(found, true_motion(exact), atol=1e-6)


def test_the_adjustment_finds_it_and_predicts_the_pixels(exact: Scene) -> None:
    adjustment = refine(exact.survey, SolveOptions())[0].adjustment
    survey = adjustment.survey
    sigma = np.sqrt(adjustment.shared_covariance(adjustment.problem.layout.first_readout, 1)[0, 0])

    assert abs(adjustment.state.readout[0] - READOUT_S) < sigma  # drawn to its prior
    assert sigma < 0.02
    residual = adjustment.minimum.blocks["pixels"].residual * survey.pick_sigma_px[:, None]
    predicted = adjustment.pixels(survey.pick_frame, survey.pick_label)
    np.testing.assert_allclose(predicted, survey.pixel_px + residual, atol=0.01)
    again, covariance = predict_pixels(adjustment, survey.pick_frame, survey.pick_label)
    np.testing.assert_allclose(again, predicted, atol=0.01)
    assert (np.linalg.eigvalsh(covariance) > 0).all()


def test_rows_project_as_opencv_has_them_and_lines_of_sight_lead_back(exact: Scene) -> None:
    survey, truth = exact.survey, exact.truth
    frame = survey.pick_frame
    sweep = READOUT_S * true_motion(exact)[frame]
    poses = RowPoses(truth.center[frame], truth.rotation[frame], sweep)
    lens, world = survey.calibration.parameters, exact.world[survey.pick_label]

    pixel = project_rows(survey.calibration, lens, poses, world)
    np.testing.assert_allclose(pixel, survey.pixel_px, atol=1e-3)  # after two steps
    center, ray = sight_lines(survey.calibration, lens, poses, survey.pixel_px)
    along = world - center
    aside = np.cross(along, ray / np.linalg.norm(ray, axis=1)[:, None])
    assert np.abs(aside).max() < 1e-6


def test_it_is_left_out_where_it_says_nothing(exact: Scene) -> None:
    def rolling(value_s: float, sigma_s: float) -> object:
        known = Readout(value_s=value_s, sigma_s=sigma_s)
        calibration = replace(exact.survey.calibration, readout=known)
        return add_readout(replace(exact.survey, calibration=calibration), NOMINAL).rolling

    assert rolling(0.0, 0.0) is None  # a shutter that exposes all rows at once
    assert rolling(0.0, 1e-5) is None  # nobody would feel it
    assert rolling(0.03, 0.0) is not None  # known, and felt
    assert add_readout(replace(exact.survey, track=None, telemetry=None), NOMINAL).rolling is None


def test_a_readout_that_no_camera_has_is_left_out_and_said(exact: Scene) -> None:
    assert exact.survey.rolling is not None
    known = replace(exact.survey.rolling, readout=Readout(value_s=-0.4, sigma_s=0.03))
    refined, messages = refine(replace(exact.survey, rolling=known), SolveOptions())

    assert refined.adjustment.problem.layout.readout == 0
    assert "readout-left-out" in [message.code for message in messages]
