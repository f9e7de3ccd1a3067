"""Mends applied on request: the survey is as it should be, and the record says what changed."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import replace
from typing import cast

import numpy as np
import pytest
from scenes import Scene, make_scene

from uavgram.estimation.survey.adjustment import Refined
from uavgram.model.message import Message
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Cause, Ends, Survey, SurveyCorrection
from uavgram.stages.refine import refine
from uavgram.stages.refine.causes.correction import MAX_LISTED, apply_corrections
from uavgram.stages.refine.causes.identification import IdentifiedCauses

BEFORE = cast("Refined", object())
"""It is handed on, and not looked at."""

OPTIONS = {"frames": 6, "labels": 10, "lines": 8, "spread": 6.0, "tilt": 0.2}
REMOVE = SolveOptions(outliers="remove", noise="stated")
stage = importlib.import_module("uavgram.stages.refine.at_stated_noise")
whole = importlib.import_module("uavgram.stages.refine.refine")


def cause(mend: SurveyCorrection | None, gain: float = 100.0) -> Cause:
    message = Message("warning", "labels-swapped", "It is wrong: mend it.")
    return Cause(message=message, mend=mend, gain=gain)


@pytest.fixture(scope="module")
def survey() -> Survey:
    found = make_scene(3, frames=3, labels=8, lines=3).survey
    return replace(found, line_name=("north", "", "south"))


def words_of_pick(survey: Survey, k: int, label: str) -> str:
    column, row = survey.pixel_px[k]
    frame = survey.frame_id[survey.pick_frame[k]]
    return f"'{label}' in '{frame}' at ({column:.1f}, {row:.1f}) px"


def test_labels_are_put_back_and_told_before_and_after(survey: Survey) -> None:
    one, other = survey.pick_label[:2].tolist()
    found = apply_corrections(
        survey, [cause(SurveyCorrection(label_of_pick={0: other, 1: one}))], BEFORE
    )
    assert found.survey.pick_label[:2].tolist() == [other, one]
    assert found.survey.pick_label[2:].tolist() == survey.pick_label[2:].tolist()
    assert not found.without.any()
    (removal,) = found.removals
    assert (removal.kind, removal.before) == ("mend", BEFORE)
    assert removal.suspicion.w == pytest.approx(10.0)  # the root of what it brings
    names = [survey.label[one], survey.label[other]]
    assert removal.mended == tuple(
        "; ".join(words_of_pick(survey, k, label) for k, label in enumerate(order))
        for order in (names, names[::-1])
    )


def test_lengths_and_heights_are_told_before_and_after(survey: Survey) -> None:
    ends = Ends(*(int(survey.line_start[2]), 5))
    mend = SurveyCorrection(length_m={0: 4.5}, ends={2: ends}, free={3: True})
    found = apply_corrections(survey, [cause(mend)], BEFORE)
    assert found.survey.length_m[0] == 4.5
    assert found.survey.line_end[2] == 5
    assert found.survey.is_free.tolist() == [k == 3 for k in range(len(survey.label))]
    (removal,) = found.removals
    before, after = removal.mended
    assert before.startswith("length 'north' (")
    assert f" {survey.length_m[0]:.3f} m; length 'south' (" in before
    assert before.endswith("'P3' on the ground")
    assert " 4.500 m; length 'south' (" in after
    assert f"to 'P5') {survey.length_m[2]:.3f} m; " in after
    assert after.endswith("'P3' at a height to be found")


def test_each_mend_goes_on_from_the_one_before(survey: Survey) -> None:
    causes = [
        cause(SurveyCorrection(length_m={1: 2.0})),
        cause(None),
        cause(SurveyCorrection(length_m={1: 3.0})),
    ]
    found = apply_corrections(survey, causes, BEFORE)
    assert found.survey.length_m[1] == 3.0
    first, second = (removal.mended for removal in found.removals)
    assert first[1] == second[0]
    assert [removal.cause for removal in found.removals] == [causes[0], causes[2]]


def test_picks_taken_out_are_those_of_all_mends_and_a_long_list_is_cut(survey: Survey) -> None:
    many = frozenset(range(MAX_LISTED + 2))
    causes = [
        cause(SurveyCorrection(without_picks=many)),
        cause(SurveyCorrection(without_picks=frozenset([9]))),
    ]
    found = apply_corrections(survey, causes, BEFORE)
    assert np.flatnonzero(found.without).tolist() == [*sorted(many), 9]
    words = found.removals[0].mended[0]
    assert words.count(" px") == MAX_LISTED
    assert words.endswith("; and 2 more")
    assert apply_corrections(survey, [], BEFORE).survey is survey


def swapped(scene_factory: Callable[..., Scene]) -> tuple[Survey, Survey]:
    """A sound survey, and the same with two labels swapped in f2."""
    sound = scene_factory(3001, **OPTIONS).survey
    sound = replace(sound, line_name=tuple(f"L{k}" for k in range(len(sound.line_start))))
    label = np.array(sound.pick_label)
    picks = np.flatnonzero(sound.pick_frame == 2)[[1, 4]]
    label[picks] = label[picks[::-1]]
    return sound, replace(sound, pick_label=label)


def test_a_mended_survey_is_adjusted_as_if_nothing_had_been_wrong(
    scene_factory: Callable[..., Scene],
) -> None:
    sound, wrong = swapped(scene_factory)
    refined, messages = refine(wrong, REMOVE)
    right, _ = refine(sound, REMOVE)
    np.testing.assert_allclose(
        refined.adjustment.state.point, right.adjustment.state.point, atol=1e-6
    )
    assert not refined.pick_removed.any()
    assert [removal.kind for removal in refined.removals] == ["mend"]
    (told,) = [one for one in messages if one.code == "labels-swapped"]
    before, after = refined.removals[0].mended
    assert f". The program corrected it, check this: {before}; now {after}." in told.text
    assert [one.message.code for one in refined.causes] == ["labels-swapped"]


@pytest.mark.parametrize("most", [0, 1])
def test_mends_without_end_end(monkeypatch: pytest.MonkeyPatch, survey: Survey, most: int) -> None:
    """Each adjustment finds something: one that changes nothing."""
    idle = cause(SurveyCorrection(length_m={1: float(survey.length_m[1])}))
    monkeypatch.setattr(whole, "MAX_CORRECTIONS", most)
    monkeypatch.setattr(
        stage, "identify_causes", lambda _: IdentifiedCauses((idle,), (None,), ((),))
    )
    refined, _ = refine(survey, REMOVE)
    assert [removal.kind for removal in refined.removals] == ["mend"] * most
    assert len(refined.causes) == most + 1


def test_with_report_nothing_is_mended(monkeypatch: pytest.MonkeyPatch, survey: Survey) -> None:
    found = cause(SurveyCorrection(length_m={1: 7.0}, without_picks=frozenset([0])))
    monkeypatch.setattr(
        stage, "identify_causes", lambda _: IdentifiedCauses((found,), (None,), ((),))
    )
    refined, (first, *_) = refine(survey, replace(REMOVE, outliers="report"))
    assert refined.removals == ()
    assert first == found.message
    assert not refined.pick_removed.any()
    assert refined.adjustment.survey.length_m.tolist() == survey.length_m.tolist()
