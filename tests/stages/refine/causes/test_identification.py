"""Which hypothesis is told: not a tape where labels do as well, and not noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scenes import Scene, make_scene

from uavgram.estimation.reliability.hypotheses import HypothesisTest, ObservationChange
from uavgram.estimation.survey.adjustment import Refined
from uavgram.model.message import Message
from uavgram.model.survey import Survey, SurveyCorrection
from uavgram.stages.refine.causes import identification as room
from uavgram.stages.refine.causes import trials
from uavgram.stages.refine.causes.correction import readjust_corrected
from uavgram.stages.refine.causes.hypothesis import SURE_LOG_ODDS, Diagnosis, Hypothesis
from uavgram.stages.refine.causes.identification import (
    MAX_TRIED,
    MAX_TRIED_OF_A_KIND,
    identify_causes,
)
from uavgram.stages.refine.causes.trials import JudgedHypothesis, try_hypothesis
from uavgram.stages.refine.minima import Participants, find_best_minima

TAPE, LABELS = SurveyCorrection(length_m={0: 3.0}), SurveyCorrection(label_of_pick={0: 1})


def told_as(code: str) -> Callable[[HypothesisTest | None], Message]:
    return lambda _: Message("warning", code, f"The {code} is wrong: look there. And more.")


def judged(
    code: str, mend: SurveyCorrection | None, *, odds: float = 50.0, cost: float | None = 10.0
) -> JudgedHypothesis:
    """A hypothesis that was tried, with what is left of the misfit; `code` empty: a competitor."""
    after = None if cost is None else cast("Diagnosis", SimpleNamespace(cost=cost))
    tell = told_as(code) if code else None
    return JudgedHypothesis(Hypothesis(message=tell, mend=mend), None, 2.0 * odds, odds, after)


def code_of(one: JudgedHypothesis | None) -> str | None:
    return one.hypothesis.message(None).code if one and one.hypothesis.message else None


def pair(best: JudgedHypothesis, *others: JudgedHypothesis) -> tuple[str | None, str | None]:
    first, rivals = room._choose_with_rivals(best, [best, *others])
    return code_of(first), code_of(rivals[0] if rivals else None)


def test_a_tape_is_not_told_first_where_labels_explain_as_much() -> None:
    tape, labels = judged("tape", TAPE), judged("labels", LABELS, odds=40.0)
    assert pair(tape, labels) == ("labels", "tape")
    assert pair(labels, tape) == ("labels", "tape")
    assert pair(judged("tape", SurveyCorrection(without_lines=frozenset([2]))), labels) == (
        "labels",
        "tape",
    )
    assert pair(tape, judged("other", TAPE), labels) == ("labels", "tape")


@pytest.mark.parametrize("more", [2.0 * SURE_LOG_ODDS - 0.1, 2.0 * SURE_LOG_ODDS + 0.1])
def test_a_rival_leaves_no_larger_misfit(more: float) -> None:
    worse = judged("labels", LABELS, odds=40.0, cost=10.0 + more)
    is_rival = more < 2.0 * SURE_LOG_ODDS
    assert pair(judged("tape", TAPE), worse) == (("labels", "tape") if is_rival else ("tape", None))


def test_of_two_tapes_the_likelier_comes_first() -> None:
    assert pair(judged("tape", TAPE), judged("other", TAPE, odds=45.0)) == ("tape", "other")


def test_a_single_wrong_reading_that_does_as_well_is_told_instead() -> None:
    best = judged("labels", LABELS)
    for odds in (50.0 - SURE_LOG_ODDS + 0.1, 50.0 - SURE_LOG_ODDS - 0.1):
        single = judged("", None, odds=odds)
        first, rivals = room._choose_with_rivals(best, [best, single])
        assert rivals == ()
        assert first is (single if odds > 50.0 - SURE_LOG_ODDS else best)


def test_all_tapes_are_not_blamed_where_another_cause_does_as_well() -> None:
    moved = (ObservationChange("lengths", np.array([0]), np.ones((1, 1, 1))),)
    hook = JudgedHypothesis(Hypothesis(message=told_as("hook"), moved=moved), None, 100.0, 50.0)
    for odds in (50.0 - SURE_LOG_ODDS + 0.1, 50.0 - SURE_LOG_ODDS - 0.1):
        first, _ = room._choose_with_rivals(hook, [hook, judged("zoom", LABELS, odds=odds)])
        assert code_of(first) == ("zoom" if odds > 50.0 - SURE_LOG_ODDS else "hook")


def test_what_was_not_adjusted_has_no_rival() -> None:
    assert pair(judged("clock", None, cost=None), judged("labels", LABELS)) == ("clock", None)
    assert pair(judged("", None), judged("labels", LABELS)) == (None, None)


def test_the_cause_says_that_nothing_tells_which() -> None:
    cause = room._cause(judged("labels", LABELS), judged("tape", TAPE))
    assert cause.message.code == "labels"
    assert " Or, just as likely: The tape is wrong." in cause.message.text
    assert cause.message.equals == ("The tape is wrong.",)
    assert cause.mend is None  # it would be a guess
    assert room._cause(judged("labels", LABELS), None).mend is LABELS
    assert "just as likely" not in room._cause(judged("labels", LABELS), None).message.text


def diagnosis(survey: Survey) -> Diagnosis:
    every = np.ones(len(survey.pick_frame), dtype=np.bool_)
    none = np.zeros(len(survey.line_start), dtype=np.bool_)
    taking = Participants(survey, every, none, {})
    return Diagnosis(taking, find_best_minima(taking))


@pytest.mark.parametrize(
    ("promised", "come", "trials"),
    [
        ([40.0, 39.0, 38.0], [10.0, 10.0, 10.0], 3),
        ([40.0, 30.0, 20.0], [30.0 + SURE_LOG_ODDS + 0.1, 0.0, 0.0], 1),
        ([40.0, 30.0, 20.0], [30.0 + SURE_LOG_ODDS - 0.1, 0.0, 0.0], 2),
        ([40.0, -1.0, -2.0], [0.0, 0.0, 0.0], 1),
        ([40.0 - k / 10 for k in range(MAX_TRIED + 3)], [1.0] * (MAX_TRIED + 3), MAX_TRIED),
    ],
)
def test_trials_end_where_the_rest_promises_less(
    monkeypatch: pytest.MonkeyPatch, promised: list[float], come: list[float], trials: int
) -> None:
    every = [Hypothesis(message=told_as("a"), promise=2.0 * odds) for odds in promised]
    tried: list[float] = []

    def try_one(_: Diagnosis, one: JudgedHypothesis, *__: float) -> JudgedHypothesis:
        tried.append(one.odds)
        return replace(one, odds=come[len(tried) - 1])

    stands = diagnosis(make_scene(3, frames=2, labels=8, lines=2).survey)
    kinds = [lambda _, one=one: [one] for one in reversed(every)]
    monkeypatch.setattr(room, "explain_by_noise", lambda one: one)
    monkeypatch.setattr(room, "try_hypothesis", try_one)
    room._find_likeliest(stands, kinds)
    assert tried == promised[:trials]


def test_of_a_kind_only_the_most_promising_are_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    crowd = [Hypothesis(message=told_as("a"), promise=80.0 + k) for k in range(9)]
    other = Hypothesis(message=told_as("b"), promise=20.0)
    tried: list[Hypothesis] = []

    def try_one(_: Diagnosis, one: JudgedHypothesis, *__: float) -> JudgedHypothesis:
        tried.append(one.hypothesis)
        return replace(one, odds=0.0)

    stands = diagnosis(make_scene(3, frames=2, labels=8, lines=2).survey)
    monkeypatch.setattr(room, "explain_by_noise", lambda one: one)
    monkeypatch.setattr(room, "try_hypothesis", try_one)
    room._find_likeliest(stands, [lambda _: crowd, lambda _: [other]])
    assert tried == [*reversed(crowd[-MAX_TRIED_OF_A_KIND:]), other]


def test_a_hypothesis_that_leaves_more_than_another_explanation_is_not_tried(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stands = diagnosis(make_scene(3, frames=2, labels=8, lines=2).survey)
    every = [Hypothesis(message=told_as("a"), promise=promise) for promise in (40.0, 30.0)]
    tried: list[float] = []

    def try_one(_: Diagnosis, one: JudgedHypothesis, limit: float) -> JudgedHypothesis:
        tried.append(one.gain)
        assert limit == stands.adjustment.minimum.cost - 35.0
        return replace(one, odds=0.0)

    monkeypatch.setattr(room, "try_hypothesis", try_one)
    kinds = [lambda _, one=one: [one] for one in every]
    room._find_likeliest(stands, kinds, stands.adjustment.minimum.cost - 35.0)
    assert tried == [40.0]


@pytest.mark.parametrize(("leaves", "is_bounded"), [(False, True), (True, False)])
def test_rivals_of_what_explains_all_have_to_fit_nearly_as_well(
    monkeypatch: pytest.MonkeyPatch, *, leaves: bool, is_bounded: bool
) -> None:
    stands = diagnosis(make_scene(3, frames=2, labels=8, lines=2).survey)
    every = [Hypothesis(message=told_as("a"), promise=promise, price=2.0) for promise in (40, 39)]
    limits: list[float] = []

    def try_one(_: Diagnosis, one: JudgedHypothesis, limit: float) -> JudgedHypothesis:
        limits.append(limit)
        after = cast("Diagnosis", SimpleNamespace(cost=7.0))
        return replace(one, odds=SURE_LOG_ODDS + 1.0, after=after)

    monkeypatch.setattr(room, "try_hypothesis", try_one)
    monkeypatch.setattr(room, "needs_cause", lambda _: leaves)
    monkeypatch.setattr(room, "explain_by_noise", lambda one: one)
    kinds = [lambda _, one=one: [one] for one in every]
    room._find_likeliest(stands, kinds)
    bound = 7.0 + 2.0 * 2.0 + 4.0 * SURE_LOG_ODDS
    assert limits == [np.inf, bound if is_bounded else np.inf]


def test_of_two_errors_the_first_has_to_explain_half_of_what_both_have_to(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stands = diagnosis(make_scene(3, frames=2, labels=8, lines=2).survey)
    squares, price, limits = stands.adjustment.minimum.cost, 3.0, list[float]()

    def find(_: Diagnosis, __: object, limit: float) -> tuple[JudgedHypothesis, tuple[()]]:
        limits.append(limit)
        return JudgedHypothesis(Hypothesis(message=None, price=price), None, 9.0, 9.0, stands), ()

    monkeypatch.setattr(room, "needs_cause", lambda _: True)
    monkeypatch.setattr(room, "_find_likeliest", find)
    goal = squares - 100.0
    room.identify_common_errors(stands, (), goal)
    np.testing.assert_allclose(limits, [squares - 50.0, goal - 2.0 * price])


@pytest.mark.parametrize("freed", [None, lambda survey: survey])
def test_a_trial_ends_where_its_cost_is_of_no_use(
    monkeypatch: pytest.MonkeyPatch, freed: Callable[[Survey], Survey] | None
) -> None:
    """Two labels that are swapped everywhere: the swap explains it, and still is too dear."""
    survey = make_scene(3, frames=3, labels=8, lines=6).survey
    label = survey.pick_label.copy()
    label[survey.pick_label == 0], label[survey.pick_label == 1] = 1, 0
    bad = diagnosis(replace(survey, pick_label=label))
    back = dict(enumerate(survey.pick_label.tolist()))
    mend = SurveyCorrection(label_of_pick=back)
    swap = Hypothesis(message=told_as("a"), mend=mend, freed=freed)
    judged = JudgedHypothesis(swap, None, 0.0, 0.0)
    least = diagnosis(survey).adjustment.minimum.cost
    goals: list[float] = []

    def record(*of: Any) -> Refined | None:  # noqa: ANN401
        goals.append(of[-1])
        return readjust_corrected(*of)

    monkeypatch.setattr(trials, "readjust_corrected", record)
    assert try_hypothesis(bad, judged, least + 1.0).odds > SURE_LOG_ODDS
    assert try_hypothesis(bad, judged, least - 1.0).odds == -np.inf
    assert goals == [least + 1.0, least - 1.0]


def on_rough_ground(make: Callable[..., Scene], seed: int) -> Survey:
    """Points on ground that is rougher than anybody said."""
    survey = make(seed, frames=5, labels=14, lines=8, roughness=0.15).survey
    (ground,) = survey.grounds
    return replace(survey, grounds=(replace(ground, roughness_sigma_m=0.0),))


def test_on_rough_ground_nothing_is_told(
    scene_factory: Callable[..., Scene],
) -> None:
    """Here the height of a point would be, were the noise not asked."""
    causes = identify_causes(diagnosis(on_rough_ground(scene_factory, 1))).causes
    assert [one.message.code for one in causes] == []
