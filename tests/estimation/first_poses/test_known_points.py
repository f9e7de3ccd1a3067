"""First poses from known points: true on exact data, both that a plane allows, none in line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scenes import Scene

from uavgram.errors import GeometryError
from uavgram.estimation.first_poses.known_points import (
    find_candidate_poses,
    find_known_point_poses,
    find_poses_from_points,
)
from uavgram.model.options import SolveOptions
from uavgram.stages.refine import refine

ALONE = {"lines": 0, "telemetry": False}
OFF_THE_PLANE = {0: 3.0, 1: 1.0, 2: -2.0}
# A target three metres wide from 27 m: which way it leans is a matter of the picks' noise.
FAR_AWAY = {"frames": 1, "labels": 8, "control": 5, "spread": 1.5, **ALONE}


@pytest.fixture
def without_poses_by_control(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("uavgram.stages.refine.first_values.find_candidate_poses", lambda _: ())


def test_exact_picks_of_a_plane_give_the_true_pose_and_its_rival(
    scene_factory: Callable[..., Scene],
) -> None:
    scene = scene_factory(1, frames=3, labels=9, control=6, noise=0.0, **ALONE)
    candidates = find_known_point_poses(scene.survey)

    assert [one.frame_id for one in candidates] == ["f0", "f1", "f2"]
    for f, one in enumerate(candidates):
        assert len(one.misfit) == 2
        np.testing.assert_allclose(one.center_world_m[0], scene.truth.center[f], atol=1e-6)
        np.testing.assert_allclose(one.world_from_camera[0], scene.truth.rotation[f], atol=1e-7)
        assert one.misfit[0] < 1e-6
        assert one.misfit[1] > 1e-3
        assert np.linalg.norm(one.center_world_m[1] - scene.truth.center[f]) > 1.0


def test_points_of_different_heights_have_one_pose(scene_factory: Callable[..., Scene]) -> None:
    scene = scene_factory(1, frames=1, control=6, noise=0.0, heights=OFF_THE_PLANE, **ALONE)
    (one,) = find_known_point_poses(scene.survey)

    assert len(one.misfit) == 1
    np.testing.assert_allclose(one.center_world_m[0], scene.truth.center[0], atol=1e-6)
    np.testing.assert_allclose(one.world_from_camera[0], scene.truth.rotation[0], atol=1e-7)


def test_a_frame_with_fewer_than_four_known_points_has_none(
    scene_factory: Callable[..., Scene],
) -> None:
    assert find_known_point_poses(scene_factory(1, control=3, **ALONE).survey) == ()


def test_a_pose_from_ties_of_a_frame_that_takes_no_part_is_not_used(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = scene_factory(1, frames=2, labels=9, control=6, **ALONE).survey
    (one, _) = find_known_point_poses(survey)
    absent = replace(one, frame_id="another")
    found = find_candidate_poses(replace(survey, candidate_poses=(absent,)))

    assert [each.frame_id for each in found] == ["f0", "f1"]
    refined, _ = refine(replace(survey, candidate_poses=(absent,)), SolveOptions())
    assert refined.adjustment.minimum.converged


def test_clicks_of_one_point_count_once(scene_factory: Callable[..., Scene]) -> None:
    survey = scene_factory(1, frames=1, control=3, **ALONE).survey
    twice = replace(
        survey,
        pick_frame=np.tile(survey.pick_frame, 2),
        pick_label=np.tile(survey.pick_label, 2),
        pixel_px=np.tile(survey.pixel_px, (2, 1)),
        pick_sigma_px=np.tile(survey.pick_sigma_px, 2),
    )
    assert find_known_point_poses(twice) == ()


def test_points_on_one_line_have_no_pose() -> None:
    along = np.array([-6.0, -2.0, 1.0, 5.0])
    world = np.stack([along, 0.5 * along, np.zeros(4)], axis=1)
    ray = np.stack([along / 30, along / 60, np.ones(4)], axis=1)
    assert find_poses_from_points(world, ray) is None


@pytest.mark.parametrize("heights", [None, OFF_THE_PLANE], ids=["plane", "heights"])
def test_known_points_alone_carry_a_survey_without_a_log(
    scene_factory: Callable[..., Scene], heights: dict[int, float] | None
) -> None:
    scene = scene_factory(4, frames=3, labels=9, control=5, heights=heights, **ALONE)
    refined, messages = refine(scene.survey, SolveOptions())
    adjustment = refined.adjustment

    assert adjustment.minimum.converged
    assert refined.alternatives == ()
    assert "ambiguous-pose" not in [message.code for message in messages]
    error = adjustment.state.center - scene.truth.center
    covariance = adjustment.frame_covariance()[:, :3, :3]
    squared = np.einsum("ni,ni->n", error, np.linalg.solve(covariance, error[..., None])[..., 0])
    assert squared.max() < 21  # 1e-4 with three degrees of freedom


def test_the_adjustment_from_a_candidate_is_the_one_from_any_other_start(
    scene_factory: Callable[..., Scene], request: pytest.FixtureRequest
) -> None:
    scene = scene_factory(4, frames=2, labels=9, control=5, **ALONE)
    ours = refine(scene.survey, SolveOptions())[0].adjustment
    request.getfixturevalue("without_poses_by_control")
    plain = refine(scene.survey, SolveOptions())[0].adjustment  # starts from a homography

    np.testing.assert_allclose(ours.state.center, plain.state.center, atol=1e-4)
    np.testing.assert_allclose(
        ours.frame_covariance(), plain.frame_covariance(), rtol=1e-3, atol=1e-9
    )


def test_a_rival_pose_that_fits_as_well_is_reported(scene_factory: Callable[..., Scene]) -> None:
    scene = scene_factory(3, **FAR_AWAY)
    refined, messages = refine(scene.survey, SolveOptions())

    assert len(refined.alternatives) == 1
    (said,) = [message for message in messages if message.code == "ambiguous-pose"]
    assert "2 camera positions" in said.text
    poses = [refined.adjustment, *refined.alternatives]
    tilts = [one.state.rotation[0, :2, 2] for one in poses]  # which way each looks
    assert np.linalg.norm(tilts[0] - tilts[1]) > 0.1


@pytest.mark.usefixtures("without_poses_by_control")
def test_without_candidates_the_rival_goes_unseen(scene_factory: Callable[..., Scene]) -> None:
    assert refine(scene_factory(3, **FAR_AWAY).survey, SolveOptions())[0].alternatives == ()


def test_known_points_on_one_line_are_told(scene_factory: Callable[..., Scene]) -> None:
    scene = scene_factory(2, frames=1, labels=8, control=4, noise=0.0, **ALONE)
    survey = scene.survey
    on_line = np.flatnonzero(survey.pick_label < 4)
    pixel = np.array(survey.pixel_px)
    pixel[on_line] = [[600.0 + 250 * k, 700.0] for k in range(len(on_line))]
    world = np.array([[2.0 * k, 0.0, 0.0] for k in range(4)])
    survey = replace(survey, pixel_px=pixel, control_world_m=world)

    assert find_known_point_poses(survey) == ()
    with pytest.raises(GeometryError):
        refine(survey, SolveOptions())
