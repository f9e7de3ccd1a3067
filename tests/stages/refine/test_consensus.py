"""A few wrong labels in a frame do not condemn the frame; a frame of another place is one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scenes import Scene

from uavgram.model.arrays import Ints
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.refine import refine

OPTIONS = {"frames": 6, "labels": 10, "lines": 2, "spread": 6.0, "tilt": 0.2}


def permuted(survey: Survey, picks: list[int] | Ints, order: list[int] | Ints) -> Survey:
    label = np.array(survey.pick_label)
    label[picks] = label[picks][order]
    return replace(survey, pick_label=label)


def test_two_swapped_labels_are_left_out_and_the_frame_stays(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = scene_factory(3001, **OPTIONS).survey
    one, other = 24, 27  # 538 px apart, in the same frame
    refined, _ = refine(permuted(survey, [one, other], [1, 0]), SolveOptions())
    assert set(refined.pick_reason) == {one, other}
    assert len(refined.adjustment.survey.frame_id) == 6


def test_labels_in_disorder_leave_the_frame_out(scene_factory: Callable[..., Scene]) -> None:
    survey = scene_factory(3001, **OPTIONS).survey
    picks = np.flatnonzero(survey.pick_frame == 2)
    refined, _ = refine(permuted(survey, picks, np.roll(np.arange(len(picks)), 3)), SolveOptions())
    assert set(refined.pick_reason) == set(picks.tolist())
    assert "f2" not in refined.adjustment.survey.frame_id
