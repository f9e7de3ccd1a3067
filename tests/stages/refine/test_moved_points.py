"""Points that stand elsewhere in some photos, and photos that were left out by mistake."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scenes import INTRINSICS, Motion, cv_pixels, make_scene, show_moved
from whole_surveys import all_of

from uavgram.estimation.reliability.hypotheses import (
    HypothesisTest,
    ObservationChange,
    compare_hypotheses,
    derive_picks_by_place,
)
from uavgram.model.message import Message
from uavgram.model.options import SolveOptions
from uavgram.model.result.reliability import Noise, PickNoise
from uavgram.model.survey import SurveyCorrection
from uavgram.stages.refine import at_stated_noise, refine
from uavgram.stages.refine.at_stated_noise import find_participants
from uavgram.stages.refine.causes.hypothesis import Diagnosis, Hypothesis
from uavgram.stages.refine.causes.moved_points import begin_search
from uavgram.stages.refine.causes.trials import JudgedHypothesis, try_hypothesis
from uavgram.stages.refine.cleaned_adjustment import Robust
from uavgram.stages.refine.gross_errors import adjust_robustly
from uavgram.stages.refine.minima import Participants, find_best_minima
from uavgram.stages.refine.noise import report_noise
from uavgram.stages.refine.robust_candidate import MISPLACED


@pytest.mark.parametrize("telemetry", [True, False])
@pytest.mark.parametrize(
    ("labels", "frames", "motion"),
    [
        ((12, 13, 14, 15), (3, 4, 5), (1.2, -0.4, 0.0)),
        ((12, 13, 14, 15), (1, 4), (0.5, 0.6, 0.5)),
        ((11, 13, 15), (5,), (-0.7, 0.3, -0.2)),
    ],
)
def test_points_that_were_moved_together_are_named(
    labels: tuple[int, ...], frames: tuple[int, ...], motion: Motion, *, telemetry: bool
) -> None:
    gauge = {} if telemetry else {"gauge": "plane"}
    scene = make_scene(2, frames=6, labels=16, lines=8, telemetry=telemetry, **gauge)  # type: ignore[arg-type]
    survey = show_moved(scene, labels, frames, motion)
    refined, messages = refine(survey, SolveOptions())
    (moved,) = (one for one in messages if one.code == "points-moved")
    assert set(moved.labels) == {survey.label[k] for k in labels}
    elsewhere = set(survey.frame_id) - {survey.frame_id[k] for k in frames}
    assert set(moved.frames) in ({survey.frame_id[k] for k in frames}, elsewhere)
    size, sigma = map(float, re.findall(r"by ([\d.]+) ± ([\d.]+) m", moved.text)[0])
    assert size == pytest.approx(float(np.hypot(*motion[:2])), abs=3.0 * sigma + 0.01)
    # One of the two places remains, and all other points are right.
    used = refined.pick_index[np.isin(survey.pick_label[refined.pick_index], labels)]
    shown = {survey.frame_id[k] for k in survey.pick_frame[used]}
    assert shown.isdisjoint(moved.frames)
    assert refined.adjustment.variance_factor < 1.6
    assert not [one for one in messages if one.code in ("photo-elsewhere", "frame-left-out")]


def test_the_joint_tests_of_motions_are_those_of_each_hypothesis() -> None:
    scene = make_scene(3, frames=4, labels=12, lines=6)
    survey = show_moved(scene, (9, 10, 11), (2, 3), (0.8, 0.4, 0.1))
    adjustment = find_best_minima(all_of(survey)).adjustment
    is_apart = np.array([False, False, True, True])
    parts = begin_search(adjustment).divide(is_apart)
    for labels in ([9], [9, 10], [10, 9, 11, 3]):
        rows = np.flatnonzero(is_apart[survey.pick_frame] & np.isin(survey.pick_label, labels))
        shifted = np.zeros((len(rows), 2, len(labels), 2))
        column = [labels.index(k) for k in survey.pick_label[rows]]
        along = derive_picks_by_place(adjustment, rows, np.eye(3)[:2])
        shifted[np.arange(len(rows)), :, column] = along
        change = ObservationChange("pixels", rows, shifted.reshape(len(rows), 2, -1))
        (alone,) = compare_hypotheses(adjustment, [(change,)])
        place = [int(np.flatnonzero(parts.label == k)[0]) for k in labels]
        assert parts.compute_gains(np.array([place]))[0] == pytest.approx(alone.gain, rel=1e-5)


def test_points_that_did_not_move_alike_were_not_moved_together() -> None:
    scene = make_scene(2, frames=6, labels=16, lines=8)
    survey = scene.survey
    for label, motion in ((12, (1.0, 0.0, 0.0)), (13, (-0.6, 0.8, 0.0)), (14, (0.1, -1.1, 0.0))):
        alone = show_moved(scene, (label,), (5,), motion)
        own = survey.pick_label == label
        survey = replace(survey, pixel_px=np.where(own[:, None], alone.pixel_px, survey.pixel_px))
    for one in (survey, scene.survey, show_moved(scene, (15,), (5,), (1.0, 0.5, 0.0))):
        assert "points-moved" not in [message.code for message in refine(one, SolveOptions())[1]]


def test_moved_points_of_free_height_in_one_photo_are_named() -> None:
    scene = make_scene(4, frames=5, labels=16, lines=8, heights={13: 0.7, 14: 0.9, 15: 0.8})
    survey = show_moved(scene, (13, 14, 15), (4,), (1.5, 0.6, 0.3))
    free = np.isin(np.arange(16), (13, 14, 15))
    survey = replace(survey, is_free=free, height_above_m=np.zeros(16))
    _, messages = refine(survey, SolveOptions())
    (moved,) = (one for one in messages if one.code == "points-moved")
    assert set(moved.labels) == {"P13", "P14", "P15"}
    assert moved.frames == ("f4",)


def test_a_photo_whose_recorded_direction_is_off_keeps_its_picks() -> None:
    scene = make_scene(5, frames=5, labels=14, lines=6)
    survey, pixel = scene.survey, np.array(scene.survey.pixel_px)
    # The camera was pitched by 12 degrees more than the log has it.
    pitch = np.radians(12.0)
    tilted = np.array(
        [[1, 0, 0], [0, np.cos(pitch), -np.sin(pitch)], [0, np.sin(pitch), np.cos(pitch)]]
    )
    center, rotation = scene.truth.center[2], scene.truth.rotation[2]
    before, after = (
        cv_pixels(INTRINSICS, center, turned, scene.world)[0]
        for turned in (rotation, rotation @ tilted)
    )
    rows = np.flatnonzero(survey.pick_frame == 2)
    pixel[rows] += (after - before)[survey.pick_label[rows]]
    refined, messages = refine(replace(survey, pixel_px=pixel), SolveOptions())
    assert not refined.pick_reason
    strained = [one for one in messages if one.level == "warning"]
    assert [(one.code, one.frames) for one in strained] == [("telemetry-strained", ("f2",))]


def test_photos_at_each_other_s_recorded_places_are_named() -> None:
    scene = make_scene(6, frames=5, labels=14, lines=6, along=30.0)
    survey = scene.survey
    frame = np.choose(survey.pick_frame, [0, 3, 2, 1, 4])
    _, messages = refine(replace(survey, pick_frame=frame), SolveOptions())
    (exchanged,) = (one for one in messages if one.code == "photos-exchanged")
    assert set(exchanged.frames) == {"f1", "f3"}
    assert "telemetry-strained" not in [one.code for one in messages]


def test_clicks_that_scatter_far_more_than_stated_do_not_fit() -> None:
    for factor, code in ((2.0, "picks-less-exact"), (4.2, "picks-misfit")):
        picks = PickNoise(source="hand", stated_px=1.5, factor=factor, sigma=0.05)
        (message,) = report_noise(Noise(picks=(picks,), roughness=()))
        assert message.code == code


def test_a_photo_that_fits_the_others_takes_part_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if the robust adjustment had ended with a right photo left out."""
    survey = make_scene(3, frames=4, labels=14, lines=6, telemetry=False, gauge="plane").survey

    def without_last(taking: Participants) -> Robust:
        return adjust_robustly(taking.leave_out_frame(3, MISPLACED))

    monkeypatch.setattr(at_stated_noise, "adjust_robustly", without_last)
    refined, messages = refine(survey, SolveOptions())
    assert survey.frame_id[3] in refined.adjustment.survey.frame_id
    assert "photo-elsewhere" not in [one.code for one in messages]


@pytest.mark.parametrize(("sigma", "is_found"), [(0.1, True), (1.0, False)])
def test_an_amount_that_may_be_zero_explains_nothing(sigma: float, *, is_found: bool) -> None:
    survey = make_scene(4, frames=3, labels=12).survey
    refined, _ = refine(survey, SolveOptions(noise="stated"))
    hypothesis = Hypothesis(
        message=lambda _: Message("warning", "heights-off", "Some amount is off."),
        mend=SurveyCorrection(),
        settled=lambda _: (np.array([0.8]), np.array([[sigma**2]])),
    )
    diagnosis = Diagnosis(find_participants(survey, refined), refined)
    found = HypothesisTest(50.0, 1, np.array([0.8]), np.array([[sigma**2]]))
    judged = try_hypothesis(diagnosis, JudgedHypothesis(hypothesis, found, 50.0, 25.0))
    assert np.isfinite(judged.odds) == is_found
