"""Points that stand elsewhere in some photos, and photos that were left out by mistake."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import Scene, make_scene

from uavgram.estimation.reliability.hypotheses import HypothesisTest
from uavgram.model.message import Message
from uavgram.model.options import SolveOptions
from uavgram.model.result.reliability import Noise, PickNoise
from uavgram.model.survey import Survey, SurveyCorrection
from uavgram.stages.refine import at_stated_noise, refine
from uavgram.stages.refine.at_stated_noise import find_participants
from uavgram.stages.refine.causes.hypothesis import Diagnosis, Hypothesis
from uavgram.stages.refine.causes.trials import JudgedHypothesis, try_hypothesis
from uavgram.stages.refine.cleaned_adjustment import Robust
from uavgram.stages.refine.gross_errors import adjust_robustly
from uavgram.stages.refine.minima import Participants
from uavgram.stages.refine.noise import report_noise
from uavgram.stages.refine.robust_candidate import MISPLACED


def moved_in(scene: Scene, labels: tuple[int, ...], frames: tuple[int, ...]) -> Survey:
    """Move the picks of some labels in some photos alike."""
    survey = scene.survey
    pixel = np.array(survey.pixel_px)
    pixel[np.isin(survey.pick_label, labels) & np.isin(survey.pick_frame, frames)] += [110.0, 70.0]
    return replace(survey, pixel_px=pixel)


@pytest.mark.parametrize("telemetry", [True, False])
def test_points_that_moved_together_are_asked_about(*, telemetry: bool) -> None:
    gauge = {} if telemetry else {"gauge": "plane"}
    scene = make_scene(2, frames=6, labels=16, lines=8, telemetry=telemetry, **gauge)  # type: ignore[arg-type]
    _, messages = refine(moved_in(scene, (14, 15), (5,)), SolveOptions())
    (asked,) = (one for one in messages if one.code == "points-moved")
    assert set(asked.labels) == {scene.survey.label[14], scene.survey.label[15]}
    assert asked.frames == (scene.survey.frame_id[5],)
    for sound in (scene.survey, moved_in(scene, (15,), (5,))):
        assert "points-moved" not in [one.code for one in refine(sound, SolveOptions())[1]]


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


def test_a_height_above_the_camera_is_named() -> None:
    scene = make_scene(1, frames=3, labels=12)
    height = np.zeros(12)
    height[5] = 500.0
    survey = replace(scene.survey, height_above_m=height)
    refined, _ = refine(survey, SolveOptions())
    own = np.flatnonzero(survey.pick_label == 5)
    assert {refined.pick_reason[k].text for k in own.tolist()} == {
        "its stated height is above the camera: correct the height"
    }


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
