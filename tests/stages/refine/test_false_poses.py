"""Without a log, frames that begin in a false pose end in the true one."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scenes import Scene

from uavgram.estimation.first_poses.first_values import FirstValues
from uavgram.estimation.first_poses.resection import find_second_pose
from uavgram.estimation.survey.adjustment import Refined
from uavgram.model.survey import Survey
from uavgram.stages.refine import minima
from uavgram.stages.refine.first_values import find_doubtful_frames, find_first_values
from uavgram.stages.refine.minima import Participants, find_best_minima

SceneFactory = Callable[..., Scene]
UPSIDE_DOWN = np.diag([1.0, -1.0, -1.0])


def made_up(scene_factory: SceneFactory, seed: int) -> Survey:
    """Six frames of points that lie close together: either tilt shows them nearly alike."""
    return scene_factory(
        seed, frames=6, telemetry=False, gauge="plane", spread=3.0, tilt=0.5
    ).survey


def adjusted(survey: Survey) -> Refined:
    every, no_line = np.ones(len(survey.pick_frame), bool), np.zeros(len(survey.line_start), bool)
    return find_best_minima(Participants(survey, every, no_line, {}))


def begun_falsely(survey: Survey, false: tuple[int, ...]) -> FirstValues:
    """Frames in the pose of the other tilt, and their points where the others see them."""
    true = find_first_values(survey)[0]
    center, rotation = true.center.copy(), true.rotation.copy()
    for frame in false:
        seen = true.point_m[survey.pick_label[survey.pick_frame == frame]]
        center[frame], rotation[frame] = find_second_pose((center[frame], rotation[frame]), seen)
    return true._replace(center=center, rotation=rotation)


def begin_falsely(monkeypatch: pytest.MonkeyPatch, false: tuple[int, ...]) -> None:
    """Frames begin in the pose of the other tilt."""
    monkeypatch.setattr(minima, "find_first_values", lambda survey: [begun_falsely(survey, false)])


@pytest.mark.parametrize("false", [(0,), (1, 4), (1, 2, 3, 4, 5)])
@pytest.mark.parametrize("seed", [0, 2])
def test_frames_that_begin_with_the_other_tilt_end_where_they_are(
    seed: int,
    false: tuple[int, ...],
    scene_factory: SceneFactory,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    survey = made_up(scene_factory, seed)
    right = adjusted(survey)
    begin_falsely(monkeypatch, false)
    found = adjusted(survey)
    assert right.adjustment.variance_factor < 1.5
    assert found.adjustment.minimum.cost == pytest.approx(right.adjustment.minimum.cost, rel=1e-4)
    monkeypatch.setattr(minima, "MAX_RETRIES", 0)
    lost = adjusted(survey)  # else the test would say nothing
    assert lost.adjustment.minimum.cost > right.adjustment.minimum.cost + 80
    named = {int(name[1:]) for name in find_doubtful_frames(survey, lost)}
    assert named & set(false)


def test_a_round_that_begins_with_other_values_than_the_last_is_made(
    scene_factory: SceneFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    survey = made_up(scene_factory, 0)
    right = adjusted(survey)
    rounds = iter([(4,), ()])
    begin_falsely(monkeypatch, (1, 4))
    monkeypatch.setattr(
        minima, "find_other_first_values", lambda s, *_: [begun_falsely(s, next(rounds))]
    )
    found = adjusted(survey)
    assert next(rounds, None) is None
    assert found.adjustment.minimum.cost == pytest.approx(right.adjustment.minimum.cost, rel=1e-4)


def test_picks_that_meet_no_ground_in_a_false_pose_come_back(
    scene_factory: SceneFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    survey = made_up(scene_factory, 0)

    def values(survey: Survey) -> list[FirstValues]:
        true = find_first_values(survey)[0]
        if "f2" not in survey.frame_id:
            return [true]
        rotation = true.rotation.copy()
        rotation[survey.frame_id.index("f2")] @= UPSIDE_DOWN
        return [true._replace(rotation=rotation)]

    monkeypatch.setattr(minima, "find_first_values", values)
    found = adjusted(survey)
    assert len(found.pick_index) == len(survey.pick_frame)
    assert not found.pick_reason
    monkeypatch.setattr(minima, "MAX_RETRIES", 0)
    lost = adjusted(survey)
    assert {survey.pick_frame[k] for k in lost.pick_reason} == {2}
    assert find_doubtful_frames(survey, lost) == {"f2"}


def test_a_frame_in_order_is_not_in_doubt(scene_factory: SceneFactory) -> None:
    doubted = [
        find_doubtful_frames(s, adjusted(s)) for s in (made_up(scene_factory, k) for k in (5, 6))
    ]
    assert doubted == [frozenset(), frozenset()]
