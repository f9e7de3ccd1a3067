"""Poses of single frames from lengths: the joint adjustment's numbers, many frames at once."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scenes import make_scene
from scipy.spatial.transform import Rotation

from uavgram.estimation.first_poses.first_values import estimate_length_poses, find_seen_lines
from uavgram.estimation.first_poses.length_poses import (
    LengthFrames,
    LengthPoses,
    compare_with_seed,
    find_allowed,
    move_seed_to_plane,
    resect_from_lengths,
)
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.geometry.motion.rotation import hat
from uavgram.model.arrays import Floats
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Ground, Survey
from uavgram.stages.refine import refine

NO_LOG: dict[str, Any] = {"telemetry": False, "gauge": "plane", "frames": 1}
UNCONNECTED = tuple((k, k + 6) for k in range(6))
SHARED = ((0, 1), (1, 2), (2, 0), (2, 3), (3, 4), (4, 0), (5, 6))


def frames_of(surveys: list[Survey]) -> LengthFrames:
    """Surveys of one frame as one batch, filled up to the largest."""
    picks = max(len(s.pick_frame) for s in surveys)
    lines = max(len(s.line_start) for s in surveys)
    count = len(surveys)
    pixel, sigma = np.full((count, picks, 2), 700.0), np.ones((count, picks))
    ends = np.tile(np.array([[[0]], [[1]]]), (1, count, lines))
    length, length_sigma = np.ones((count, lines)), np.full((count, lines), np.inf)
    for k, s in enumerate(surveys):
        at = np.full(len(s.label), -1)
        at[s.pick_label] = np.arange(len(s.pick_label))
        pixel[k, : len(at)], sigma[k, : len(at)] = s.pixel_px, s.pick_sigma_px
        n = len(s.line_start)
        ends[:, k, :n] = at[s.line_start], at[s.line_end]
        length[k, :n], length_sigma[k, :n] = s.length_m, s.length_sigma_m
    return LengthFrames(pixel, sigma, ends[0], ends[1], length, length_sigma)


def plane_of(adjustment: Adjustment) -> tuple[Floats, Floats]:
    """m of the adjusted frame, and its covariance."""
    up, height = adjustment.state.rotation[0, 2], adjustment.state.center[0, 2]
    jacobian = np.zeros((3, 6))
    jacobian[:, 2] = up / height**2
    jacobian[:, 3:] = -hat(up[None])[0] / height
    columns = adjustment.problem.layout.frame_columns(np.array([0]))[0]
    return -up / height, jacobian @ adjustment.minimum.factor.joint(columns) @ jacobian.T


def test_optimum_and_covariance_are_those_of_the_joint_adjustment() -> None:
    surveys = [
        make_scene(seed, ends=SHARED if seed % 2 else UNCONNECTED, **NO_LOG).survey
        for seed in range(6)
    ]
    found = resect_from_lengths(surveys[0].calibration, frames_of(surveys))
    assert found.converged.all()
    for k, survey in enumerate(surveys):
        adjustment = refine(survey, SolveOptions(noise="stated"))[0].adjustment
        plane, covariance = plane_of(adjustment)
        sigma = np.sqrt(np.diag(covariance))
        assert np.abs((found.plane[k] - plane) / sigma).max() < 1e-4
        own = np.sqrt(np.diag(found.covariance[k]))
        np.testing.assert_allclose(own, sigma, rtol=1e-5)
        ours, theirs = (c / np.outer(sigma, sigma) for c in (found.covariance[k], covariance))
        np.testing.assert_allclose(ours, theirs, atol=2e-5)
        assert found.cost[k] == pytest.approx(adjustment.minimum.cost, abs=1e-6)


def test_a_shared_end_taken_as_two_points_would_be_noticed() -> None:
    survey = make_scene(1, ends=SHARED, **NO_LOG).survey
    frames = frames_of([survey])
    right = resect_from_lengths(survey.calibration, frames)
    rows = np.concatenate([frames.start[0], frames.end[0]])
    lines = np.arange(len(SHARED))[None]
    apart = frames._replace(
        pixel_px=frames.pixel_px[:, rows],
        pixel_sigma_px=frames.pixel_sigma_px[:, rows],
        start=lines,
        end=lines + len(SHARED),
    )
    wrong = resect_from_lengths(survey.calibration, apart)
    sigma = np.sqrt(np.diag(right.covariance[0]))
    assert np.abs((wrong.plane - right.plane)[0] / sigma).max() > 1e-2


def test_many_frames_give_what_each_gives_alone() -> None:
    surveys = [
        make_scene(seed, ends=UNCONNECTED[: 4 + seed % 3], **NO_LOG).survey for seed in range(8)
    ]
    calibration = surveys[0].calibration
    together = resect_from_lengths(calibration, frames_of(surveys * 20))
    assert together.converged.all()
    for k, survey in enumerate(surveys):
        (alone,) = resect_from_lengths(calibration, frames_of([survey])).plane
        sigma = np.sqrt(np.diag(together.covariance[k]))
        for copy in range(20):
            row = together.plane[k + len(surveys) * copy]
            assert np.abs((row - alone) / sigma).max() < 1e-4


def test_a_poor_start_leads_to_the_same_poses_and_a_lost_frame_takes_none_along() -> None:
    survey = make_scene(2, ends=UNCONNECTED, **NO_LOG).survey
    frames = frames_of([survey] * 3)
    good = resect_from_lengths(survey.calibration, frames)
    start = good.plane * np.array([[1.1], [0.93], [np.nan]])
    start[1, 0] += 0.05 * np.linalg.norm(start[1])
    found = resect_from_lengths(survey.calibration, frames, start)
    assert found.converged.tolist() == [True, True, False]
    sigma = np.sqrt(np.diag(good.covariance[0]))
    assert np.abs((found.plane - good.plane)[:2] / sigma).max() < 1e-4


def test_a_frame_whose_conditions_are_singular_takes_none_along() -> None:
    """The factorisation of many matrices at once gives up at the first singular one."""
    survey = make_scene(2, ends=UNCONNECTED, **NO_LOG).survey
    frames = frames_of([survey] * 2)
    good = resect_from_lengths(survey.calibration, frames)
    one_line_only = frames.take(np.arange(2))
    for column in one_line_only[2:]:
        column[1] = column[1, 0]
    one_line_only[5][1] = 0.0  # and without an error of its own, so equal to the last digit
    found = resect_from_lengths(survey.calibration, one_line_only, good.plane)
    assert found.converged.tolist() == [True, False]
    sigma = np.sqrt(np.diag(good.covariance[0]))
    assert np.abs((found.plane[0] - good.plane[0]) / sigma).max() < 1e-4


@pytest.mark.statistical
def test_truth_lies_inside_the_stated_covariance() -> None:
    """Mean squared Mahalanobis distance of 400 planes within the bounds of chi-square (99.9 %)."""
    scenes = [make_scene(seed, ends=UNCONNECTED, **NO_LOG) for seed in range(400)]
    found = resect_from_lengths(scenes[0].survey.calibration, frames_of([s.survey for s in scenes]))
    truth = np.array([-s.truth.rotation[0, 2] / s.truth.center[0, 2] for s in scenes])
    apart = found.plane - truth
    good = found.converged
    assert good.sum() >= 396
    squared = np.einsum(
        "bi,bij,bj->b", apart[good], np.linalg.inv(found.covariance[good]), apart[good]
    )
    assert 2.66 < squared.mean() < 3.36  # chi-square of 1200 over 400, second order left room


def test_lines_are_seen_where_both_ends_are_picked() -> None:
    survey = make_scene(6, frames=5, labels=14, along=25.0, telemetry=False, gauge="plane").survey
    seen = find_seen_lines(survey)
    expected = {
        (f, line)
        for f in range(5)
        for line in range(len(survey.line_start))
        if {survey.line_start[line], survey.line_end[line]}
        <= set(survey.pick_label[survey.pick_frame == f].tolist())
    }
    assert set(zip(seen.frame.tolist(), seen.line.tolist(), strict=True)) == expected
    assert len(seen.frame) == len(expected)
    assert (np.diff(seen.frame) >= 0).all()
    for picks, labels in ((seen.start, survey.line_start), (seen.end, survey.line_end)):
        assert (survey.pick_label[picks] == labels[seen.line]).all()
        assert (survey.pick_frame[picks] == seen.frame).all()


def test_lines_between_heights_or_areas_start_no_plane() -> None:
    survey = make_scene(4, ends=UNCONNECTED, heights={0: 1.0}, **NO_LOG).survey
    assert 0 not in find_seen_lines(survey).line
    area = np.zeros(12, dtype=int)
    area[7] = 1
    survey = replace(survey, grounds=survey.grounds * 2, area=area)
    assert set(find_seen_lines(survey).line.tolist()) == {2, 3, 4, 5}


def test_frames_with_different_lines_are_posed_together() -> None:
    scene = make_scene(
        6, frames=5, labels=14, along=25.0, lines=9, telemetry=False, gauge="plane", noise=0.0
    )
    poses = estimate_length_poses(scene.survey)
    counts = np.bincount(find_seen_lines(scene.survey).frame, minlength=5)
    assert set(poses) == set(np.flatnonzero(counts >= 3).tolist())
    for frame, found in poses.items():
        up, height = scene.truth.rotation[frame, 2], scene.truth.center[frame, 2]
        nearest = np.abs(found.plane + up / height).max(axis=1).min()
        assert nearest < 1e-6 / height


def test_a_plane_that_the_lengths_leave_open_is_not_called_found() -> None:
    # One line taped both ways, and another: any sigma is small against one without bounds.
    survey = make_scene(4, labels=5, ends=((0, 1), (1, 0), (2, 3)), noise=0.0, **NO_LOG).survey
    up, height = np.array([0.0, 0.0, 1.0]), 20.0
    start = np.array([up / height, [0.01, 0.0, 0.05]])
    frames = frames_of([survey, survey])
    assert not resect_from_lengths(survey.calibration, frames, start).converged.any()
    assert estimate_length_poses(survey) == {}


def test_lengths_that_no_pose_explains_give_none() -> None:
    survey = make_scene(4, **NO_LOG).survey
    assert estimate_length_poses(replace(survey, length_m=-survey.length_m)) == {}


def test_candidates_that_end_in_one_maximum_count_once() -> None:
    for seed in range(4):
        survey = make_scene(seed, ends=((0, 1), (1, 2), (2, 0)), labels=6, **NO_LOG).survey
        for poses in estimate_length_poses(survey).values():
            found = poses.plane[poses.converged]
            apart = np.linalg.norm(found[:, None] - found, axis=2)
            apart[np.diag_indices(len(found))] = np.inf
            assert apart.min(initial=np.inf) > 1e-6 * np.linalg.norm(found, axis=1).max()


def test_what_is_remembered_is_of_the_same_numbers() -> None:
    survey = make_scene(5, ends=UNCONNECTED, **NO_LOG).survey
    found = estimate_length_poses(survey)[0]

    assert estimate_length_poses(replace(survey, gauge="world"))[0] is found
    assert not found.plane.flags.writeable
    tapes = {"length_sigma_m": survey.length_sigma_m, "length_m": survey.length_m}
    tapes |= {"pixel_px": survey.pixel_px, "pick_sigma_px": survey.pick_sigma_px}
    for name, value in tapes.items():
        other = estimate_length_poses(replace(survey, **{name: value * 1.01}))[0]  # type: ignore[arg-type]
        assert other.cost[0] != found.cost[0], name
    lens = replace(survey.calibration, parameters=survey.calibration.parameters * 1.001)
    assert estimate_length_poses(replace(survey, calibration=lens))[0].cost[0] != found.cost[0]
    lens = replace(survey.calibration, covariance=survey.calibration.covariance * 4.0)
    other = estimate_length_poses(replace(survey, calibration=lens))[0]
    assert (other.covariance[0] != found.covariance[0]).any()


# Gate for poses from lengths by the poses of a log.


SEED = np.diag([1.0, -1.0, -1.0]) @ Rotation.from_rotvec([0.3, -0.2, 0.5]).as_matrix()
CENTER = np.array([3.0, 4.0, 50.0])


def ground(height_sigma: float = 0.0, slope_sigma: float = 0.0) -> Ground:
    return Ground(
        height_m=1.5,
        height_sigma_m=height_sigma,
        slope_sigma_rad=slope_sigma,
        roughness_sigma_m=0.0,
    )


def poses(plane: Floats, covariance: Floats | None = None) -> LengthPoses:
    count = len(plane)
    joint = np.zeros((count, 3, 3)) if covariance is None else covariance
    return LengthPoses(plane, joint, np.zeros(count), np.ones(count, bool))


def prior() -> Floats:
    root = np.random.default_rng(1).normal(size=(6, 6))
    root *= np.array([1.0, 1, 1, 0.02, 0.02, 0.02])[:, None]
    return root @ root.T


@pytest.mark.statistical
@pytest.mark.parametrize("own", [False, True])
def test_true_poses_lie_in_the_gate_as_often_as_it_states(*, own: bool) -> None:
    """Squared distances of 4000 true poses are chi-square of three: mean 3, variance 6."""
    rng = np.random.default_rng(2)
    error = rng.multivariate_normal(np.zeros(6), prior(), 4000)
    rotation = SEED @ Rotation.from_rotvec(error[:, 3:]).as_matrix()
    tilted = rng.normal(0, 0.01, (4000, 2))
    up = np.column_stack([-tilted, np.ones(4000)])
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    height = CENTER[2] + error[:, 2] - 1.5 + rng.normal(0, 0.4, 4000)
    plane = -np.einsum("nji,nj->ni", rotation, up) / height[:, None]
    joint = None
    if own:
        root = rng.normal(size=(3, 3)) * 4e-4
        joint = np.tile(root @ root.T, (4000, 1, 1))
        plane = plane + rng.normal(size=(4000, 3)) @ root.T
    squared = compare_with_seed(
        CENTER, SEED, prior(), ground(0.4, 0.01), poses(plane, joint)
    ).squared_distance
    assert squared.mean() == pytest.approx(3, abs=3.3 * np.sqrt(6 / 4000))
    assert np.mean(~find_allowed(squared)) < 0.004
    if own:  # without the candidates' own covariances they would lie too far out
        bare = compare_with_seed(
            CENTER, SEED, prior(), ground(0.4, 0.01), poses(plane)
        ).squared_distance
        assert bare.mean() > 3.3


def test_a_pose_far_from_the_log_is_not_allowed() -> None:
    turned = SEED @ Rotation.from_rotvec([0.5, 0, 0]).as_matrix()
    plane = -turned[2] / 48.5
    squared = compare_with_seed(
        CENTER, SEED, prior(), ground(), poses(plane[None])
    ).squared_distance
    assert not find_allowed(squared).any()


def test_a_seed_takes_height_and_level_of_a_plane_and_keeps_its_heading() -> None:
    turned = SEED @ Rotation.from_rotvec([0.2, -0.1, 0.0]).as_matrix()
    plane = -turned[2] / 40.0
    center, rotation = move_seed_to_plane(CENTER, SEED, ground(), plane)
    np.testing.assert_allclose(center, [3.0, 4.0, 41.5])
    np.testing.assert_allclose(-rotation[2] / (center[2] - 1.5), plane, atol=1e-15)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
    # The short way: no turn about the vertical comes with it.
    relative = Rotation.from_matrix(rotation @ SEED.T).as_rotvec()
    assert relative[2] == pytest.approx(0, abs=1e-12)


def test_a_pose_pulls_the_seed_as_far_as_its_weight_says() -> None:
    turned = SEED @ Rotation.from_rotvec([0.02, 0, 0]).as_matrix()
    plane = -turned[2][None] / 50.5
    sharp = poses(plane, 1e-16 * np.eye(3)[None])
    vague = poses(plane, 1e-2 * np.eye(3)[None])
    (whole,) = compare_with_seed(CENTER, SEED, prior(), ground(), sharp).shift
    assert whole[0] == pytest.approx(50.5 - 48.5, abs=1e-6)
    tilt = np.arccos(turned[2] @ SEED[2])
    assert np.hypot(*whole[1:]) == pytest.approx(tilt, rel=1e-6)
    (none,) = compare_with_seed(CENTER, SEED, prior(), ground(), vague).shift
    assert np.abs(none).max() < 0.02
    # Between the two: the mean of two estimates by their weights, here in height alone.
    known = np.diag([1e-12, 1e-12, 0.25, 1e-12, 1e-12, 1e-12])
    own = 0.75 / 50.5**4 * np.eye(3)[None]
    level = poses(-SEED[2][None] / 50.5, own)
    (shift,) = compare_with_seed(CENTER, SEED, known, ground(), level).shift
    np.testing.assert_allclose(shift, [2.0 * 0.25, 0, 0], atol=1e-6)
