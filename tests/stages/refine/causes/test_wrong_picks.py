"""Labels that changed places, told as such, with the mend that brings the true labels back."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from scenes import Scene

from uavgram.estimation.reliability.hypotheses import compare_hypotheses
from uavgram.model.arrays import Ints
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Cause, Survey
from uavgram.stages.refine.at_stated_noise import adjust_at_stated_noise
from uavgram.stages.refine.causes.hypothesis import Diagnosis, correct_survey
from uavgram.stages.refine.causes.wrong_heights import propose_heights
from uavgram.stages.refine.minima import Participants, find_best_minima

OPTIONS = {"frames": 6, "labels": 10, "lines": 8, "spread": 6.0, "tilt": 0.2}


def clean(scene_factory: Callable[..., Scene], seed: int = 3001) -> Survey:
    survey = scene_factory(seed, **OPTIONS).survey
    names = tuple(f"L{k}" for k in range(len(survey.line_start)))
    return replace(survey, line_name=names)


def relabelled(survey: Survey, picks: Sequence[int] | Ints, labels: Sequence[int] | Ints) -> Survey:
    label = np.array(survey.pick_label)
    label[np.asarray(picks)] = labels
    return replace(survey, pick_label=label)


def picks_of(survey: Survey, frame: int) -> Ints:
    return np.flatnonzero(survey.pick_frame == frame)


def causes_of(survey: Survey) -> tuple[Cause, ...]:
    none = np.zeros(len(survey.pick_frame), dtype=np.bool_)
    return adjust_at_stated_noise(survey, none, SolveOptions(noise="stated")).causes


def test_labels_that_changed_places_in_a_photo_are_told_and_put_back(
    scene_factory: Callable[..., Scene],
) -> None:
    survey, order = clean(scene_factory), [1, 2, 0]
    picks = picks_of(survey, 2)[1 : 1 + 2 * len(order) : 2]
    wrong = relabelled(survey, picks, survey.pick_label[picks][order])
    (cause,) = causes_of(wrong)
    assert (cause.message.code, cause.message.frames) == ("labels-swapped", ("f2",))
    assert set(cause.message.labels) == {survey.label[k] for k in survey.pick_label[picks]}
    assert cause.mend is not None
    assert correct_survey(wrong, cause.mend).pick_label.tolist() == survey.pick_label.tolist()


def test_a_swap_is_found_where_a_point_is_seen_in_that_photo_only(
    scene_factory: Callable[..., Scene],
) -> None:
    whole = clean(scene_factory)
    one, other = picks_of(whole, 2)[[0, 3]]
    keep = (whole.pick_label != whole.pick_label[one]) | (whole.pick_frame == 2)
    rows = np.flatnonzero(keep)
    survey = replace(
        whole,
        pick_frame=whole.pick_frame[rows],
        pick_label=whole.pick_label[rows],
        pixel_px=whole.pixel_px[rows],
        pick_sigma_px=whole.pick_sigma_px[rows],
    )
    picks = np.searchsorted(rows, [one, other])
    wrong = relabelled(survey, picks, survey.pick_label[picks][::-1])
    (cause,) = causes_of(wrong)
    assert cause.message.code == "labels-swapped"
    assert cause.mend is not None
    assert correct_survey(wrong, cause.mend).pick_label.tolist() == survey.pick_label.tolist()


@pytest.mark.parametrize("both", [False, True])
def test_a_pick_where_another_label_belongs_is_told(
    scene_factory: Callable[..., Scene], *, both: bool
) -> None:
    survey = clean(scene_factory)
    one, other = picks_of(survey, 3)[[2, 4]]
    pixel = np.array(survey.pixel_px)
    pixel[one] = pixel[other] + (0.5 if both else 0.0)
    rows = np.arange(len(pixel)) if both else np.delete(np.arange(len(pixel)), other)
    wrong = replace(
        survey,
        pick_frame=survey.pick_frame[rows],
        pick_label=survey.pick_label[rows],
        pixel_px=pixel[rows],
        pick_sigma_px=survey.pick_sigma_px[rows],
    )
    at = int(np.searchsorted(rows, one))
    (cause,) = causes_of(wrong)
    assert (cause.message.code, cause.message.frames) == ("label-elsewhere", ("f3",))
    right = int(survey.pick_label[other])
    assert cause.message.labels == (survey.label[survey.pick_label[one]], survey.label[right])
    assert cause.mend is not None
    assert dict(cause.mend.label_of_pick) == ({} if both else {at: right})
    assert cause.mend.without_picks == (frozenset([at]) if both else frozenset())


def test_labels_swapped_in_all_photos_are_told_by_the_lengths_that_end_at_them(
    scene_factory: Callable[..., Scene],
) -> None:
    survey = clean(scene_factory)
    ends = np.concatenate([survey.line_start, survey.line_end])
    first, second = np.argsort(-np.bincount(ends), kind="stable")[:2].tolist()
    exchanged = {first: second, second: first}
    label = np.array([exchanged.get(k, k) for k in survey.pick_label.tolist()])
    wrong = replace(survey, pick_label=label)
    cause = causes_of(wrong)[0]
    assert cause.message.code == "labels-swapped-everywhere"
    assert set(cause.message.labels) == {survey.label[first], survey.label[second]}
    assert cause.mend is not None
    assert correct_survey(wrong, cause.mend).pick_label.tolist() == survey.pick_label.tolist()
    touch = np.isin(survey.line_start, (first, second)) ^ np.isin(survey.line_end, (first, second))
    assert cause.settles
    assert cause.settles <= {survey.line_name[k] for k in np.flatnonzero(touch)}


def test_a_point_off_the_ground_is_no_wrong_pick(scene_factory: Callable[..., Scene]) -> None:
    """Its height changes where the point appears in every photo alike."""
    survey = clean(scene_factory)
    none = np.zeros(len(survey.line_start), dtype=np.bool_)
    label = int(survey.pick_label[picks_of(survey, 1)[3]])
    raised = scene_factory(3001, **OPTIONS)
    center, rotation = raised.truth.center, raised.truth.rotation
    frame = survey.pick_frame
    rows = np.flatnonzero(survey.pick_label == label)
    up = np.einsum("nji,j->ni", rotation[frame[rows]], [0.0, 0.0, 1.5])
    point = raised.world[label] - center[frame[rows]]
    camera = np.einsum("nji,nj->ni", rotation[frame[rows]], point)
    focal = survey.calibration.parameters[:2]
    shift = focal * ((camera + up)[:, :2] / (camera + up)[:, 2:] - camera[:, :2] / camera[:, 2:])
    pixel = np.array(survey.pixel_px)
    pixel[rows] += shift
    taking = Participants(
        replace(survey, pixel_px=pixel), np.ones(len(pixel), dtype=np.bool_), none, {}
    )
    diagnosis = Diagnosis(taking, find_best_minima(taking))
    found = list(propose_heights(diagnosis))
    tests = compare_hypotheses(diagnosis.adjustment, [one.moved for one in found])
    test, best = max(zip(tests, found, strict=True), key=lambda one: one[0].gain)
    assert best.mend is not None
    assert best.message is not None
    assert dict(best.mend.free) == {label: True}
    assert best.message(test).heights_m[0] == pytest.approx(1.5, rel=0.2)
