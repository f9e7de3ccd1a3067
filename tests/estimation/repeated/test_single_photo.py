"""Adjustment of one photo for many draws: minima and covariances against other solvers."""

from __future__ import annotations

import dataclasses
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from photo_draws import HEIGHT_M, Scene, photo_scene, residuals, start_of
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from uavgram.estimation.first_poses.photo_problem import Photos, SharedErrors
from uavgram.estimation.repeated.single_photo import adjust_photos, intersect_ground
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.readjustment import refit
from uavgram.geometry.motion.rotation import log_so3
from uavgram.model.arrays import Floats
from uavgram.model.survey import Survey
from uavgram.pipeline.measure.compute import assemble_survey
from uavgram.pipeline.measure.pose import pose_frames
from uavgram.stages.refine import refine
from uavgram.synthetic.accident_scene import SceneLine, ScenePoint
from uavgram.synthetic.scenario import CameraSpec, FlightPlan, Scenario
from uavgram.synthetic.survey import make_inputs, simulate


@pytest.mark.parametrize(("slope", "joined"), [(False, False), (True, False), (True, True)])
def test_the_minimum_is_that_of_scipy_over_all_unknowns(slope: bool, joined: bool) -> None:  # noqa: FBT001
    scene = photo_scene(3, slope=slope, joined=joined)
    found = adjust_photos(scene.shared, scene.draws, (scene.center, scene.rotation))
    assert found.converged.all()
    for draw in range(3):
        best = least_squares(
            partial(residuals, scene, draw),
            start_of(scene, draw),
            jac="3-point",
            method="trf",
            x_scale="jac",
            xtol=1e-15,
            ftol=1e-15,
            gtol=1e-15,
        )
        assert found.cost[draw] == pytest.approx(2 * best.cost, abs=1e-9)
        off = np.concatenate(
            [
                found.center_world_m[draw] - best.x[:3],
                Rotation.from_matrix(
                    (scene.draws.rotation[draw] @ turn(best.x[3:6])).T
                    @ found.world_from_camera[draw]
                ).as_rotvec(),
            ]
        )
        sigma = np.sqrt(np.diag(found.covariance[draw]))
        assert np.abs(off / sigma).max() < 1e-5


def turn(vector: Floats) -> Floats:
    return np.asarray(Rotation.from_rotvec(vector).as_matrix())


@pytest.mark.parametrize("joined", [False, True])
def test_errors_are_as_large_as_the_covariances_say(joined: bool) -> None:  # noqa: FBT001
    scene = photo_scene(2000, seed=3, slope=True, joined=joined)
    found = adjust_photos(scene.shared, scene.draws)
    assert found.converged.all()
    error = pose_errors(scene, found.center_world_m, found.world_from_camera)
    weight = np.linalg.inv(found.covariance)
    total = float(np.einsum("bi,bij,bj->", error, weight, error))
    assert chi2.ppf(1e-4, 6 * len(error)) < total < chi2.isf(1e-4, 6 * len(error))
    # The cost has as many degrees of freedom as there are lengths: each pose beforehand and each
    # sighting stand against an unknown.
    free = scene.draws.line.shape[1] * len(error)
    assert chi2.ppf(1e-4, free) < float(found.cost.sum()) < chi2.isf(1e-4, free)


def pose_errors(scene: Scene, center: Floats, rotation: Floats) -> Floats:
    back = np.swapaxes(np.broadcast_to(scene.rotation, rotation.shape), 1, 2)
    return np.concatenate([center - scene.center, log_so3(back @ rotation)], axis=1)


def test_where_it_begins_does_not_matter() -> None:
    scene = photo_scene(300, seed=5)
    near = adjust_photos(scene.shared, scene.draws, (scene.center, scene.rotation))
    far = adjust_photos(scene.shared, scene.draws)
    both = near.converged & far.converged
    assert both.all()
    sigma = np.sqrt(np.einsum("bii->bi", near.covariance))
    off = pose_errors(scene, near.center_world_m, near.world_from_camera) - pose_errors(
        scene, far.center_world_m, far.world_from_camera
    )
    assert np.abs(off / sigma).max() < 1e-6


def test_what_does_not_come_to_rest_is_marked_and_nothing_else_suffers() -> None:
    scene = photo_scene(50, seed=7)
    behind = scene.draws.center.copy()
    behind[:5, 2] -= 2 * HEIGHT_M  # below the ground: no end is in front of the camera
    draws = scene.draws._replace(center=behind)
    found = adjust_photos(scene.shared, draws)
    assert not found.converged[:5].any()
    assert np.isnan(found.cost[:5]).all()
    assert np.isnan(found.covariance[:5]).all()
    alone = adjust_photos(scene.shared, scene.draws)
    assert np.allclose(found.center_world_m[5:], alone.center_world_m[5:], atol=1e-9)


def test_pixels_meet_the_ground_where_the_points_stand() -> None:
    scene = photo_scene(1, slope=True)
    pose = scene.center[None], scene.rotation[None]
    place = intersect_ground(scene.shared.calibration, scene.draws, pose)
    # A pixel is HEIGHT_M / 2250 m: the draw's noise, five sigmas of it on tilted ground.
    assert np.abs(place[0] - scene.ends_m[:, :2]).max() < 8 * 0.8 * HEIGHT_M / 2250


# Batched adjustment against the survey's own, to a millionth of a sigma.


ENDS = ((-9.0, -6.0), (8.0, -7.0), (9.0, 6.0), (-8.0, 7.0), (0.5, -1.0), (2.0, 3.0))
LINES = (("A", "B"), ("B", "C"), ("C", "D"), ("D", "A"), ("E", "F"), ("A", "E"))
EXACT = 1e-7
"""Sigma of what the batch takes as known: metres, radians, seconds."""


CAMERA_SIGMA = (30.0, 30.0, 20.0, 20.0, 0.02, 0.01, 1e-3, 1e-3, 0.004)
TAPE_SCALE = 0.003


def scenario(sigma: tuple[float, ...]) -> Scenario:
    points = tuple(
        ScenePoint(label=label, x_m=x, y_m=y) for label, (x, y) in zip("ABCDEF", ENDS, strict=True)
    )
    lines = tuple(SceneLine(name=a + b, start=a, end=b) for a, b in LINES)
    return replace(
        Scenario(),
        flight=FlightPlan(pattern="single", gimbal_pitch_deg=-75.0, height_m=35.0),
        camera=replace(CameraSpec(), sigma=sigma),
        points=points,
        lines=lines,
        measurements=(),
    )


def known_but_the_pose(survey: Survey, *, shared: bool) -> Survey:
    """The survey with everything as good as known that the batch takes as known."""
    assert survey.telemetry is not None
    telemetry = replace(
        survey.telemetry,
        clock_sigma_s=EXACT,
        clock_drift_sigma=1e-12,
        boresight_sigma_rad=EXACT,
        heading_bias_sigma_rad=EXACT,
        lever_arm_sigma_m=EXACT,
        position_bias_sigma_m=np.full(3, EXACT),
    )
    ground = survey.ground
    if not shared:
        ground = replace(ground, height_sigma_m=EXACT, slope_sigma_rad=EXACT / 30)
    calibration = survey.calibration
    if not shared:
        calibration = replace(calibration, covariance=np.zeros((9, 9)))
    return replace(
        survey,
        telemetry=telemetry,
        grounds=(ground,),
        calibration=calibration,
        tape_scale_sigma=TAPE_SCALE if shared else 0.0,
        rolling=None,
    )


def adjusted(repetition: int, *, shared: bool) -> tuple[Survey, Adjustment]:
    drawn = scenario(CAMERA_SIGMA if shared else (1e-9,) * 9)
    inputs = make_inputs(simulate(drawn, repetition=repetition))
    survey = assemble_survey(inputs, pose_frames(inputs)).survey
    survey = known_but_the_pose(survey, shared=shared)
    options = dataclasses.replace(inputs.project.solve, noise="stated", significance=1e-12)
    return survey, refine(survey, options)[0].adjustment


def root_of_plane(adjustment: Adjustment) -> Floats:
    """What height and slopes at the pivot of the program's plane do to a plane's numbers."""
    ground, (east, north) = adjustment.survey.ground, adjustment.problem.ground.pivot_m[0]
    assert ground.height_sigma_m > 0.2
    height, slope = ground.height_sigma_m, ground.slope_sigma_rad
    return np.array([[height, -slope * east, -slope * north], [0, slope, 0], [0, 0, slope]])


def root_of(covariance: Floats) -> Floats:
    return np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)


@pytest.mark.parametrize("shared", [False, True])
def test_the_minimum_is_that_of_the_program(shared: bool) -> None:  # noqa: FBT001
    for repetition in range(3):
        survey, adjustment = adjusted(repetition, shared=shared)
        assert survey.seeds is not None
        assert survey.telemetry is not None
        order, label = np.argsort(survey.pick_label), np.arange(len(survey.label))
        errors = SharedErrors(survey.calibration)
        if shared:
            root = root_of(survey.calibration.covariance)
            plane = root_of_plane(adjustment)
            errors = SharedErrors(survey.calibration, root, plane, survey.tape_scale_sigma)
        photo = Photos(
            pixel_px=survey.pixel_px[order][None],
            pixel_weight=1.0 / survey.pick_sigma_px[order][None],
            height_m=np.zeros((1, len(survey.label))),
            ground=np.array([[survey.ground.height_m, 0.0, 0.0]]),
            center=survey.seeds.center_world_m[:1],
            rotation=survey.seeds.world_from_camera[:1],
            information=np.asarray(np.linalg.inv(survey.telemetry.covariance[:1]), np.float64),
            line=np.column_stack([survey.line_start, survey.line_end])[None],
            toward=np.zeros((1, 0, 2)),
            placed=np.zeros((1, 0), np.int64),
            reading_m=survey.length_m[None],
            reading_weight=1.0 / survey.length_sigma_m[None],
        )
        found = adjust_photos(errors, photo)
        assert found.converged.all()
        # The program stops at steps of 1e-5 sigmas: a few more of its own.
        state = refit(adjustment, {}, at_rest=1e-20)
        assert state is not None
        turned = log_so3(state.rotation[0].T @ found.world_from_camera[0])
        off = np.concatenate([found.center_world_m[0] - state.center[0], turned])
        sigma = np.sqrt(np.diag(found.covariance[0]))
        assert np.abs(off / sigma).max() < 1e-6
        ends = np.abs(found.place_m[0] - adjustment.problem.world_points(state, label)[0])
        assert ends.max() < 1e-6 * 0.01
