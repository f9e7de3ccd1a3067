"""Laws of the verdict: what makes it red or amber, and what that means for each measurement."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain
from typing import NamedTuple

import numpy as np
import pytest
from scenes import NO_TIMES, make_scene

from uavgram.estimation.measuring.propagation import propagate
from uavgram.model.message import Message
from uavgram.model.options import SolveOptions
from uavgram.model.remedy import Remedy
from uavgram.model.result.tables import MeasurementResults
from uavgram.model.result.verdict import MeasurementStatus, Verdict
from uavgram.model.survey.observations import MeasurementRequest
from uavgram.stages.judge import Fit, pass_verdict, run_tests, tested_survey
from uavgram.stages.judge.statuses import is_moved
from uavgram.stages.judge.unchecked import FAR, is_unchecked, judge_unchecked
from uavgram.stages.judge.verdict import (
    BENDING,
    LEARNT,
    NOT_FITTING,
    TAKING_PART,
    UNCHECKED,
    first_sentences,
)
from uavgram.stages.measure import measurement_results
from uavgram.stages.refine import refine
from uavgram.stages.refine.minima import Participants, best_minima

REQUESTS = (
    MeasurementRequest(name="near", kind="distance", points=("P0", "P1")),
    MeasurementRequest(name="far", kind="distance", points=("P2", "P3")),
    MeasurementRequest(name="nowhere", kind="distance", points=("P2", "ghost")),
)
"""The last one has no value."""


class Judged(NamedTuple):
    """An adjusted survey under test, and what was measured in it."""

    examined: tested_survey.TestedSurvey
    table: MeasurementResults

    def verdict(
        self, *messages: Message, fit: Fit | None = None
    ) -> tuple[Verdict, tuple[MeasurementStatus, ...]]:
        return pass_verdict(messages, fit or Fit(), self.examined, self.table)


@pytest.fixture(scope="module")
def clean() -> Judged:
    survey = make_scene(9, frames=6).survey
    return _judged(survey.length_m, 2)


def _judged(length_m: np.ndarray, requests: int) -> Judged:
    survey = replace(make_scene(9, frames=6).survey, length_m=length_m)
    refined, _ = refine(survey, SolveOptions(noise="stated"))
    measured = propagate(refined.adjustment, REQUESTS[:requests], NO_TIMES)
    return Judged(run_tests(refined, measured, 0.001), measurement_results(measured)[0])


def of(code: str, *labels: str) -> Message:
    return Message("warning", code, "This is wrong. Look there. Behind it is this.", labels=labels)


def test_what_fits_and_is_checked_is_green(clean: Judged) -> None:
    assert clean.verdict() == (Verdict(level="green"), ("ok", "ok"))
    assert clean.verdict(of("home-missing", "P0"), of("line-unseen")) == clean.verdict()


def test_what_does_not_fit_is_told_before_what_nothing_checks(clean: Judged) -> None:
    """Of picks that were left out, too, for which no message has the cause."""
    verdict, _ = clean.verdict(of("nothing-checks"), of("pick-left-out", "P0"), of("misfit"))

    causes = [reason.cause for reason in verdict.reasons]
    assert causes == ["pick-left-out", "misfit", "nothing-checks"]


def test_a_reason_carries_its_plain_sentence_and_what_would_put_it_right(clean: Judged) -> None:
    mend, rival = (Remedy(action="free", words=words) for words in ("Free it", "Or this"))
    message = replace(of("point-off-ground", "P0"), mend=mend, instead=(rival,))
    (reason,) = clean.verdict(message)[0].reasons

    assert reason.plain == "P0 stands off the ground."
    assert (reason.mend, reason.instead) == (mend, (rival,))


@pytest.mark.parametrize("code", sorted(BENDING))
def test_what_bends_everything_is_red_and_contradicts_every_value(clean: Judged, code: str) -> None:
    verdict, status = clean.verdict(of(code))
    assert verdict.level == "red"
    assert status == ("contradicted", "contradicted")
    assert [reason.cause for reason in verdict.reasons] == [code]


def test_what_was_mended_bends_nothing_any_more(clean: Judged) -> None:
    found = of("lengths-wrong-unit"), of("labels-swapped", "P0")
    mended = {message.code for message in found}
    verdict, status = pass_verdict(found, Fit(), clean.examined, clean.table, mended)
    assert verdict.level == "amber"
    assert status == ("ok", "ok")


@pytest.mark.parametrize("code", sorted(TAKING_PART))
def test_what_takes_part_though_it_does_not_fit_puts_its_labels_in_doubt(
    clean: Judged, code: str
) -> None:
    verdict, status = clean.verdict(of(code, "P0", "P7"))
    assert verdict.level == "amber"
    assert status == ("doubtful", "ok")


@pytest.mark.parametrize("code", sorted(NOT_FITTING | UNCHECKED))
def test_what_does_not_fit_is_amber_and_no_more(clean: Judged, code: str) -> None:
    verdict, status = clean.verdict(of(code, "P0"))
    assert verdict.level == "amber"
    assert status == ("ok", "ok")


def test_noise_that_is_learnt_as_a_precaution_is_no_misfit(clean: Judged) -> None:
    for code in LEARNT:
        assert clean.verdict(of(code), fit=Fit(stated=0.03))[0].level == "green"
        assert clean.verdict(of(code), fit=Fit(stated=0.001))[0].level == "amber"


def test_a_core_that_contradicts_itself_is_red_whatever_is_named(clean: Judged) -> None:
    suspect = of("line-suspect", "P0")
    assert clean.verdict(suspect, fit=Fit(core=1e-4))[0].level == "amber"
    verdict, status = clean.verdict(suspect, of("misfit"), fit=Fit(core=1e-6))
    assert verdict.level == "red"
    assert status == ("contradicted", "contradicted")


def test_a_check_that_is_contradicted_is_red_and_nothing_is_in_order(clean: Judged) -> None:
    fit = Fit(checks=1e-9, check_labels=frozenset({"P3"}))
    verdict, status = clean.verdict(of("line-suspect"), fit=fit)
    assert verdict.level == "red"
    assert status == ("doubtful", "contradicted")


def test_reasons_are_the_messages_in_their_order_two_sentences_each(clean: Judged) -> None:
    codes = "labels-swapped", "line-left-out", "nothing-checks"
    verdict, _ = clean.verdict(*(of(code) for code in codes))
    assert tuple(reason.cause for reason in verdict.reasons) == codes
    assert {reason.text for reason in verdict.reasons} == {"This is wrong. Look there."}
    assert first_sentences("One. Two.") == "One. Two."


def test_no_code_has_two_meanings() -> None:
    groups = BENDING, TAKING_PART, NOT_FITTING, LEARNT, UNCHECKED
    together = list(chain.from_iterable(groups))
    assert len(together) == len(set(together))


def test_what_has_no_value_is_not_checked_whatever_else_is_wrong(clean: Judged) -> None:
    three = _judged(clean.examined.adjustment.survey.length_m, 3)
    assert three.verdict()[1] == ("ok", "ok", "not-checked")
    assert three.verdict(of("not-converged"))[1][2] == "not-checked"


def test_other_values_that_fit_as_well_are_doubtful(clean: Judged) -> None:
    table = replace(clean.table, alternative_values=((), (3.0,)))
    verdict, status = Judged(clean.examined, table).verdict(of("ambiguous-pose"))
    assert verdict.level == "amber"
    assert status == ("ok", "doubtful")


def test_a_wrong_length_puts_what_it_moves_in_doubt_without_any_common_label() -> None:
    """As far as it does: the truth is the same survey adjusted without the length."""
    right = make_scene(9, frames=6).survey
    first = np.arange(len(right.length_m)) == 0
    wrong = replace(right, length_m=right.length_m + 20.0 * right.length_sigma_m * first)
    values = {}
    for out in (False, True):
        refined = best_minima(
            Participants(wrong, np.ones(len(right.pick_label), dtype=bool), first & out, {})
        )
        values[out] = propagate(refined.adjustment, REQUESTS[:2], NO_TIMES)
        if not out:
            examined = run_tests(refined, values[out], 0.001)
    moved = np.abs(values[True].value - values[False].value) / values[False].sigma
    assert examined.suspicions[0].accused.kind == "lengths"
    assert moved.max() > 1.5  # so that the case says something
    assert is_moved(examined)[moved > 1.2].all()


def test_an_error_that_no_test_finds_moves_nothing_of_a_clean_survey_far(clean: Judged) -> None:
    assert not is_unchecked(clean.examined).any()
    assert list(judge_unchecked(clean.examined)) == []


def test_a_point_in_one_photo_is_not_checked_however_small_its_sigma() -> None:
    survey = make_scene(9, frames=6).survey
    once = np.flatnonzero(survey.pick_label == survey.label.index("P0"))[1:]
    keep = np.ones(len(survey.pick_label), dtype=bool)
    keep[once] = False
    few = replace(
        survey,
        pick_label=survey.pick_label[keep],
        pick_frame=survey.pick_frame[keep],
        pixel_px=survey.pixel_px[keep],
        pick_sigma_px=survey.pick_sigma_px[keep],
    )
    lines = (few.line_start == 0) | (few.line_end == 0)
    assert not lines.all()
    few = replace(few, length_sigma_m=np.where(lines, 1e3, few.length_sigma_m))
    refined, _ = refine(few, SolveOptions(noise="stated"))
    measured = propagate(refined.adjustment, REQUESTS[:2], NO_TIMES)
    judged = Judged(run_tests(refined, measured, 0.001), measurement_results(measured)[0])
    (message,) = judge_unchecked(judged.examined)
    assert message.measurements == ("near",)
    assert message.text.startswith("Nothing checks 'near': no error in the pick of 'P0' in ")
    assert "pick 'P0' in another photo" in message.text
    assert judged.verdict(message)[1] == ("not-checked", "ok")
    weakest = judged.examined.weakest[0]
    assert abs(weakest.reading_change) > FAR * measured.sigma[0]
