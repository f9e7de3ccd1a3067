"""A camera's clock that is far off is found before the adjustment, which could not begin there."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scenes import Scene, make_scene

from uavgram.geometry.motion.camera_motion import (
    LEVER_ARM,
    SHARED_SIZE,
    exposures_by_time,
    predict_pose,
)
from uavgram.model.flight_log import Track
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.pipeline.measure.compute import adjust_survey
from uavgram.stages.seed.clock import STEP_S
from uavgram.stages.seed.common_errors import find_common_error


def late(scene: Scene, off_s: float) -> Survey:
    """The survey with the times, and thus the seeds, of a clock that is fast by that."""
    survey = scene.survey
    prior, track, seeds = survey.telemetry, survey.track, survey.seeds
    assert prior is not None
    assert isinstance(track, Track)
    assert seeds is not None
    # The drone flies on behind the last photo, at 4 m/s.
    after = 0.5 * np.arange(1, 100)
    sampled = np.append(track.position_time_s, track.position_time_s[-1] + after)
    way = track.position_world_m[-1] + after[:, None] * [3.0, -2.5, 0.2]
    longer = replace(
        track,
        position_time_s=sampled,
        attitude_time_s=sampled,
        position_world_m=np.concatenate([track.position_world_m, way]),
        world_from_body_xyzw=np.concatenate(
            [track.world_from_body_xyzw, np.tile(track.world_from_body_xyzw[-1], (len(after), 1))]
        ),
    )
    wrong = replace(prior, time_s=prior.time_s + off_s, middle_s=prior.middle_s + off_s)
    shared = np.zeros(SHARED_SIZE)
    shared[LEVER_ARM] = prior.lever_arm_m
    there = exposures_by_time(longer, survey.frame_id)(wrong.time_s)
    center, rotation, _ = predict_pose(
        there, prior.gimbal_from_camera, shared, wrong.time_s - wrong.middle_s
    )
    moved = replace(seeds, center_world_m=center, world_from_camera=rotation)
    return replace(survey, telemetry=wrong, track=longer, seeds=moved)


@pytest.mark.parametrize("off_s", [9.0, 24.0])
def test_a_clock_that_is_seconds_off_is_found_and_named_alone(off_s: float) -> None:
    scene = make_scene(3, frames=6, labels=20, lines=6)
    survey = late(scene, off_s)
    true_s = off_s + scene.truth.telemetry[10]

    found = find_common_error(survey)
    assert found is not None
    assert found.message is None
    assert found.shift_s == pytest.approx(true_s, abs=2 * STEP_S)

    refined, messages = adjust_survey(survey, SolveOptions())
    assert refined.adjustment.minimum.converged
    wrong = [one for one in messages if one.level == "warning"]
    assert [one.code for one in wrong] == ["clock-off"]
    match = re.search(r"is ([0-9.]+) ± ([0-9.]+) s off", wrong[0].text)
    assert match is not None
    value_s, sigma_s = map(float, match.groups())
    assert abs(value_s - true_s) < 3.0 * sigma_s + 0.05


@pytest.mark.parametrize("seed", range(20))
def test_a_right_clock_is_not_moved(scene_factory: Callable[..., Scene], seed: int) -> None:
    assert find_common_error(late(scene_factory(seed, frames=1 + seed % 6), 0.0)) is None


def test_photos_of_one_place_or_without_a_log_have_no_other_clock() -> None:
    scene = make_scene(3, frames=4)
    assert find_common_error(late(make_scene(3, frames=1), 9.0)) is None
    assert find_common_error(replace(scene.survey, telemetry=None, seeds=None, track=None)) is None


def test_points_above_the_cameras_have_no_other_clock() -> None:
    survey = late(make_scene(3, frames=4), 9.0)
    above_m = np.full(len(survey.label), 500.0)
    assert find_common_error(replace(survey, height_above_m=above_m)) is None
