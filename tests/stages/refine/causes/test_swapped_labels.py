"""Swapped labels of a photo that was left out, or spoilt everything, beside one other photo."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest
from scenes import Scene, make_scene

from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.refine import refine
from uavgram.stages.refine.causes.hypothesis import Diagnosis, correct_survey
from uavgram.stages.refine.causes.identification import identify_causes
from uavgram.stages.refine.causes.swapped_labels import (
    _misfit,
    propose_swapped_by_two_views,
    propose_swapped_everywhere,
)
from uavgram.stages.refine.minima import Participants, find_best_minima

OPTIONS = {"frames": 2, "labels": 10, "lines": 8, "spread": 6.0, "tilt": 0.2}


def without_the_second_photo(survey: Survey) -> Diagnosis:
    """The survey as it stands where its second photo was left out."""
    first = survey.pick_frame == 0
    taking = Participants(survey, first, np.zeros(len(survey.line_start), dtype=np.bool_), {})
    return Diagnosis(taking, find_best_minima(taking))


@pytest.mark.parametrize("seed", [11, 12, 13])
def test_two_labels_that_changed_places_in_one_of_two_photos_are_told_and_put_back(
    scene_factory: Callable[..., Scene], seed: int
) -> None:
    survey = scene_factory(seed, **OPTIONS).survey
    survey = replace(survey, line_name=tuple(f"L{k}" for k in range(len(survey.line_start))))
    second = np.flatnonzero(survey.pick_frame == 1)
    picks = np.random.default_rng(seed).permutation(second)[:2]
    label = survey.pick_label.copy()
    label[picks] = label[picks[::-1]]
    wrong = replace(survey, pick_label=label)

    assert list(propose_swapped_by_two_views(without_the_second_photo(survey))) == []
    (cause,) = identify_causes(without_the_second_photo(wrong)).causes
    assert (cause.message.code, cause.message.frames) == ("labels-swapped", ("f1",))
    assert set(cause.message.labels) == {survey.label[k] for k in label[picks]}
    assert cause.message.mend is not None
    assert cause.message.mend.words.startswith("Swap ")
    assert cause.mend is not None
    assert correct_survey(wrong, cause.mend).pick_label.tolist() == survey.pick_label.tolist()


@pytest.mark.parametrize(
    ("photos", "converges", "seed"), [(1, True, 21), (1, True, 22), (1, True, 23), (4, False, 24)]
)
def test_two_labels_swapped_in_all_photos_are_found_where_the_places_of_points_are_of_no_use(
    scene_factory: Callable[..., Scene], photos: int, seed: int, *, converges: bool
) -> None:
    """Lengths between wrong labels distort the pose of one photo, or there is no minimum."""
    options = {"frames": photos, "labels": 10, "lines": 7, "spread": 6.0, "tilt": 0.5}
    survey = scene_factory(seed, telemetry=False, gauge="plane", **options).survey
    survey = replace(survey, line_name=tuple(f"L{k}" for k in range(len(survey.line_start))))
    number = np.bincount(np.append(survey.line_start, survey.line_end), minlength=10)
    first, second = np.argsort(-number, kind="stable")[[0, 2]]
    label = survey.pick_label.copy()
    is_first, is_second = label == first, label == second
    label[is_first], label[is_second] = second, first
    wrong = replace(survey, pick_label=label)

    taking = Participants(
        wrong, np.ones(len(label), dtype=np.bool_), np.zeros(7, dtype=np.bool_), {}
    )
    refined = find_best_minima(taking)
    minimum = replace(refined.adjustment.minimum, converged=converges)
    refined = replace(refined, adjustment=replace(refined.adjustment, minimum=minimum))
    diagnosis = Diagnosis(taking, refined)
    best = max(propose_swapped_everywhere(diagnosis), key=lambda one: one.promise)
    assert best.mend is not None
    assert correct_survey(wrong, best.mend).pick_label.tolist() == survey.pick_label.tolist()


def test_a_homography_fits_where_opencv_finds_one() -> None:
    """Points of a plane seen twice; with two of them exchanged there is none."""
    rng = np.random.default_rng(5)
    turn = np.array([[1.1, 0.2, 0.3], [-0.1, 0.9, -0.2], [0.05, -0.04, 1.0]])
    x = rng.uniform(-1, 1, (8, 2))
    y = cv2.perspectiveTransform(x[None], turn)[0]
    order = np.arange(8)
    order[[2, 5]] = 5, 2

    fits, exchanged = _misfit(np.stack([x, x[order]]), y)

    assert fits < 1e-20
    matrix, _ = cv2.findHomography(x[order], y)
    away = cv2.perspectiveTransform(x[order][None], matrix)[0] - y
    assert exchanged > 1e-4
    assert np.abs(away).max() > 0.05


@pytest.mark.parametrize("telemetry", [True, False])
def test_the_label_of_a_control_point_swapped_with_one_at_its_coordinates_is_named(
    *, telemetry: bool
) -> None:
    """The control point is left out; but what is measured at either label is wrong, too."""
    survey = make_scene(7, frames=5, labels=12, control=5, lines=2, telemetry=telemetry).survey
    swapped = {0: 9, 9: 0}  # 0 is a control point
    label = np.array([swapped.get(k, k) for k in survey.pick_label.tolist()])
    _, messages = refine(replace(survey, pick_label=label), SolveOptions(noise="stated"))
    assert messages[0].code == "labels-swapped-everywhere"
    assert set(messages[0].labels) == {survey.label[0], survey.label[9]}


@pytest.mark.parametrize("telemetry", [True, False])
def test_a_control_point_with_the_label_of_another_point_is_named(*, telemetry: bool) -> None:
    """No length ends at either point: their labels may as well be swapped in all photos."""
    survey = make_scene(7, frames=5, labels=12, control=5, lines=2, telemetry=telemetry).survey
    control, right = survey.control_label.copy(), survey.control_label[3]
    control[3] = wrong = 10
    ends = (survey.line_start, survey.line_end)
    assert not np.isin(ends, (wrong, right)).any()

    refined, messages = refine(replace(survey, control_label=control), SolveOptions(noise="stated"))

    assert messages[0].code == "control-label-wrong"
    assert messages[0].labels[:2] == (survey.label[wrong], survey.label[right])
    assert "swapped in all photos" in messages[0].text
    assert "control-left-out" not in {one.code for one in messages}
    assert wrong not in refined.adjustment.survey.control_label
