"""Laws of the verdict: what makes it red or amber, and what that means for each measurement."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
from scenes import NO_TIMES, make_scene
from whole_surveys import with_all

from uavgram.estimation.measuring.propagation import propagate
from uavgram.estimation.reliability.external import MAX_ERROR_SIGMAS, UNDETECTED_SIGMAS
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.selection import select_control
from uavgram.model.arrays import Ints
from uavgram.model.message import Message, Remedy
from uavgram.model.message_catalogue import Effect, entries_by_code
from uavgram.model.observations import KnownLines, KnownWorldPoints, MeasurementRequest
from uavgram.model.options import SolveOptions
from uavgram.model.result.reliability import MeasurementStatus, Noise, PickNoise, Verdict
from uavgram.model.result.tables import MeasurementResults
from uavgram.model.survey import Survey
from uavgram.stages.judge import Fit, compare_withheld, determine_verdict, run_tests, tested_survey
from uavgram.stages.judge.fit import CONTRADICTION_PROBABILITY, compute_fit
from uavgram.stages.judge.unchecked import is_unchecked, judge_unchecked
from uavgram.stages.judge.verdict import contradicts_result, get_first_sentences, is_moved
from uavgram.stages.measure import measurement_results
from uavgram.stages.messages import order_messages
from uavgram.stages.refine import refine
from uavgram.stages.refine.minima import Participants, find_best_minima

REQUESTS = (
    MeasurementRequest(name="near", kind="distance", points=("P0", "P1")),
    MeasurementRequest(name="far", kind="distance", points=("P2", "P3")),
    MeasurementRequest(name="nowhere", kind="distance", points=("P2", "ghost")),
)
"""The last one has no value."""


def codes_of(effect: Effect) -> list[str]:
    codes = [entry.code for entry in entries_by_code().values() if entry.effect is effect]
    assert len(codes) > 2
    return codes


NO_POINTS = KnownWorldPoints(label=(), world_m=np.zeros((0, 3)), sigma_m=np.zeros((0, 3)))


class Judged(NamedTuple):
    """An adjusted survey under test, and what was measured in it."""

    examined: tested_survey.TestedSurvey
    table: MeasurementResults

    def verdict(
        self, *messages: Message, fit: Fit | None = None
    ) -> tuple[Verdict, tuple[MeasurementStatus, ...]]:
        return determine_verdict(messages, fit or Fit(), self.examined, self.table)


@pytest.fixture(scope="module")
def clean() -> Judged:
    survey = make_scene(9, frames=6).survey
    return _judged(survey.length_m, 2)


def _judged(length_m: np.ndarray, requests: int) -> Judged:
    names = tuple(f"L{k}" for k in range(len(length_m)))
    survey = replace(make_scene(9, frames=6).survey, length_m=length_m, line_name=names)
    refined, _ = refine(survey, SolveOptions(noise="stated"))
    measured = propagate(refined.adjustment, REQUESTS[:requests], NO_TIMES)
    return Judged(run_tests(refined, measured, 0.001), measurement_results(measured)[0])


def of(code: str, *labels: str) -> Message:
    return Message("warning", code, "This is wrong. Look there. Behind it is this.", labels=labels)


def test_what_fits_and_is_checked_is_green(clean: Judged) -> None:
    assert clean.verdict() == (Verdict(level="green"), ("ok", "ok"))
    assert clean.verdict(of("home-missing", "P0"), of("check-unseen")) == clean.verdict()


def test_what_does_not_fit_is_told_before_what_nothing_checks(clean: Judged) -> None:
    """Of picks that were left out, too, for which no message has the cause."""
    table = replace(clean.table, alternative_values=((), (3.0,)))
    found = of("nothing-checks"), of("pick-left-out", "P0"), of("misfit")
    verdict, _ = Judged(clean.examined, table).verdict(*found)

    causes = [reason.cause for reason in verdict.reasons]
    assert causes == ["pick-left-out", "misfit", "nothing-checks"]


def test_a_reason_carries_its_plain_sentence_and_what_would_put_it_right(clean: Judged) -> None:
    mend, rival = (Remedy(action="free", words=words) for words in ("Free it", "Or this"))
    message = replace(of("point-off-ground", "P0"), mend=mend, instead=(rival,))
    (reason,) = clean.verdict(message)[0].reasons

    assert reason.plain == "P0 is off the ground."
    assert (reason.mend, reason.instead) == (mend, (rival,))


@pytest.mark.parametrize("code", codes_of(Effect.RED))
def test_what_bends_everything_is_red_and_contradicts_every_value(clean: Judged, code: str) -> None:
    verdict, status = clean.verdict(of(code))
    assert verdict.level == "red"
    assert status == ("contradicted", "contradicted")
    assert [reason.cause for reason in verdict.reasons] == [code]


def test_what_was_mended_bends_nothing_any_more(clean: Judged) -> None:
    found = of("lengths-wrong-unit"), of("labels-swapped", "P0")
    mended = {message.code for message in found}
    verdict, status = determine_verdict(found, Fit(), clean.examined, clean.table, mended)
    assert verdict.level == "amber"
    assert status == ("ok", "ok")


def test_lengths_that_were_left_out_bend_nothing(clean: Judged) -> None:
    """All others, too, if a cause names them: the log alone gives the scale then."""
    names = clean.examined.adjustment.survey.line_name
    found = replace(of("lengths-wrong-unit"), lengths=names)
    assert clean.verdict(found)[0].level == "red"
    absent = replace(found, lengths=tuple(f"not {name}" for name in names))
    verdict, status = clean.verdict(absent)
    assert verdict.level == "amber"
    assert status == ("ok", "ok")
    # But a label at its end may be wrong instead.
    ends = replace(of("line-other-ends", "P0"), lengths=absent.lengths)
    assert clean.verdict(ends)[1] == ("doubtful", "ok")


def test_a_mistake_that_moves_no_value_by_3_5_sigma_is_doubtful_and_not_red(clean: Judged) -> None:
    found = replace(of("lengths-offset"), lengths=("L0", "L1"))
    assert clean.verdict(found)[0].level == "red"
    verdict, status = determine_verdict(
        (found,), Fit(), clean.examined, clean.table, harmless=("lengths-offset",)
    )
    assert verdict.level == "amber"
    assert verdict.reasons[0].cause == "lengths-offset"
    assert status == ("doubtful", "doubtful")


@pytest.mark.parametrize("sigmas", [3.0, 4.0])
def test_values_and_places_without_a_mistake_contradict_the_result(
    clean: Judged, sigmas: float
) -> None:
    here, table = clean.examined.adjustment, clean.table
    value = table.value + sigmas * table.sigma * np.array([0.0, 1.0])
    assert contradicts_result(table, here, value, here) == (sigmas > 3.5)
    # A common shift changes no distance, but all places.
    (_, covariance), state = here.points(), here.state
    shift_m = sigmas * np.sqrt(covariance[:, 0, 0].min())
    minimum = replace(here.minimum, state=replace(state, point=state.point + shift_m))
    there = Adjustment(here.problem, minimum, here.covariance)
    assert contradicts_result(table, here, table.value, there) == (sigmas > 3.5)


@pytest.mark.parametrize("code", ["photos-mirrored", "control-shifted"])
def test_a_log_that_was_left_out_bends_nothing(clean: Judged, code: str) -> None:
    examined = clean.examined
    some, *others = examined.adjustment.survey.frame_id
    for left_out, level in ((others, "red"), ([some, *others], "amber")):
        refined = replace(examined.refined, pose_widened=dict.fromkeys(left_out, 50.0))
        judged = Judged(replace(examined, refined=refined), clean.table)
        assert judged.verdict(of(code))[0].level == level


def test_a_mount_against_the_recorded_angles_comes_before_what_it_may_spoil(clean: Judged) -> None:
    found = order_messages(of("lengths-offset-possible"), of("mount-stated"))
    verdict = clean.verdict(*found)[0]
    assert verdict.level == "amber"
    assert verdict.reasons[0].cause == "mount-stated"


def test_what_rests_on_a_length_that_is_never_suspected_is_not_in_order() -> None:
    """An error of 0.9 m in a length with a redundancy of 0.003 moves a distance by 6 sigmas."""
    scene = make_scene(0, frames=2, lines=4, labels=10, telemetry=False, gauge="plane")
    length_m = np.array(scene.survey.length_m)
    length_m[3] -= 0.9
    picks_px = 3.0 * scene.survey.pick_sigma_px
    survey = replace(scene.survey, pick_sigma_px=picks_px, length_m=length_m)
    refined, _ = refine(survey, SolveOptions(noise="stated"))
    measured = propagate(refined.adjustment, REQUESTS[:2], NO_TIMES)
    examined = run_tests(refined, measured, 0.001)

    ends = [survey.label.index(name) for name in REQUESTS[1].points]
    true = np.linalg.norm(np.subtract(*scene.world[ends]))
    assert abs(measured.value[1] - true) > 5.0 * measured.sigma[1]
    assert not examined.suspicions
    assert Judged(examined, measurement_results(measured)[0]).verdict()[1][1] == "not-checked"


def test_noise_as_large_as_gross_errors_is_a_contradiction() -> None:
    """With sigmas 39 times as large everything fits, even another zoom in one photo."""
    survey = make_scene(9, frames=6).survey
    pixel = survey.pixel_px + 30.0 * np.random.default_rng(0).standard_normal(survey.pixel_px.shape)
    stated = with_all(replace(survey, pixel_px=pixel))
    learnt = with_all(replace(survey, pixel_px=pixel, pick_sigma_px=39.0 * survey.pick_sigma_px))
    nothing: Any = SimpleNamespace(w=(), status=(), start=(), end=(), points=(), label=())
    nothing.mahalanobis = ()
    measured = propagate(learnt.adjustment, REQUESTS[:2], NO_TIMES)
    table = measurement_results(measured)[0]
    levels = {}
    for source, factor in (("hand", 5.0), ("hand", 39.0), ("tie", 39.0)):
        picks = PickNoise(source=source, stated_px=1.0, factor=factor, sigma=1.0)
        noise = Noise(picks=(picks,), roughness=())
        refined = replace(learnt, noise=noise, stated=stated.adjustment)
        fit = compute_fit(refined, nothing, nothing, nothing, None, given=survey)
        examined = run_tests(refined, measured, 0.001)
        levels[source, factor] = Judged(examined, table).verdict(fit=fit)[0].level

    assert levels == {("hand", 5.0): "green", ("hand", 39.0): "red", ("tie", 39.0): "green"}


@pytest.mark.parametrize("are_left_out", [False, True])
def test_withheld_things_share_the_fault_of_others_that_were_all_left_out(
    *, are_left_out: bool
) -> None:
    """All lengths in feet, or all control at another height, and the withheld ones, too."""
    given = make_scene(9, frames=6, control=3).survey
    rest = select_control(given, np.full(3, not are_left_out))
    refined, _ = refine(rest, SolveOptions(noise="stated"))
    nothing: Any = SimpleNamespace(w=(), status=(), points=(), label=(), mahalanobis=())
    status = ("removed" if are_left_out else "used", "checked")
    lines: Any = SimpleNamespace(w=(0.0, -94.0), status=status, start="AB", end="CD")
    of_lengths = compute_fit(refined, lines, nothing, nothing, None, given=given)
    lines = SimpleNamespace(w=(), status=(), start=(), end=())
    points: Any = SimpleNamespace(mahalanobis=(46.0,), label=("K2",))
    of_points = compute_fit(refined, lines, nothing, points, None, given=given)
    for fit in (of_lengths, of_points):
        assert (fit.checks == 1.0) if are_left_out else (fit.checks < CONTRADICTION_PROBABILITY)


@pytest.mark.parametrize("code", codes_of(Effect.DOUBTFUL))
def test_what_takes_part_though_it_does_not_fit_puts_its_labels_in_doubt(
    clean: Judged, code: str
) -> None:
    verdict, status = clean.verdict(of(code, "P0", "P7"))
    assert verdict.level == "amber"
    assert status == ("doubtful", "ok")


@pytest.mark.parametrize("code", codes_of(Effect.DISPLACED))
def test_where_times_or_places_of_the_log_are_in_doubt_coordinates_are(code: str) -> None:
    """Of several photos; the lengths give distances all the same."""
    refined, _ = refine(make_scene(9, frames=6, control=8).survey, SolveOptions(noise="stated"))
    point = MeasurementRequest(name="where", kind="coordinate", points=("P4",))
    measured = propagate(refined.adjustment, (*REQUESTS[:1], point), NO_TIMES)
    judged = Judged(run_tests(refined, measured, 0.001), measurement_results(measured)[0])
    assert len(judged.table.kind) > 1
    for frames, status in ((("f0",), "ok"), (("f0", "f1"), "doubtful")):
        found = judged.verdict(replace(of(code), frames=frames))[1]
        assert found[0] == "ok"
        assert set(found[1:]) == {status}


@pytest.mark.parametrize("code", codes_of(Effect.AMBER))
def test_what_does_not_fit_is_amber_and_no_more(clean: Judged, code: str) -> None:
    verdict, status = clean.verdict(of(code, "P0"))
    assert verdict.level == "amber"
    assert status == ("ok", "ok")


@pytest.mark.parametrize("code", codes_of(Effect.UNCHECKED))
def test_what_is_not_decided_is_a_reason_only_where_a_measurement_hangs_on_it(
    clean: Judged, code: str
) -> None:
    assert clean.verdict(of(code, "P0"))[0] == Verdict(level="green")
    table = replace(clean.table, alternative_values=((), (3.0,)))
    verdict, _ = Judged(clean.examined, table).verdict(of(code, "P0"))
    assert verdict.level == "amber"
    assert [reason.cause for reason in verdict.reasons] == [code]


@pytest.mark.parametrize(
    "code",
    ["ground-not-plane", "picks-less-exact", "log-gimbal-gap"],
)
def test_what_is_no_misfit_of_a_measurement_is_no_reason(clean: Judged, code: str) -> None:
    assert clean.verdict(of(code)) == (Verdict(level="green"), ("ok", "ok"))


def test_a_value_that_may_as_well_be_zero_is_not_in_order() -> None:
    """However well everything fits: with sigmas that wide, anything does."""
    survey = make_scene(9, frames=6).survey
    wide = replace(
        survey,
        pick_sigma_px=2000.0 * survey.pick_sigma_px,
        length_sigma_m=2000.0 * survey.length_sigma_m,
    )
    refined, _ = refine(wide, SolveOptions(noise="stated"))
    requests = (*REQUESTS[:2], MeasurementRequest(name="at", kind="coordinate", points=("P0",)))
    measured = propagate(refined.adjustment, requests, NO_TIMES)
    judged = Judged(run_tests(refined, measured, 0.001), measurement_results(measured)[0])
    unknown = np.abs(measured.value[:2]) < 1.96 * measured.sigma[:2]
    assert unknown.any()

    messages = [m for m in judge_unchecked(judged.examined) if m.code == "measurement-unknown"]
    verdict, status = judged.verdict(*messages)

    (message,) = messages
    named = tuple(row.name for row, one in zip(measured.rows[:2], unknown, strict=True) if one)
    assert message.measurements == named  # and no coordinate
    # Where another solution moves a value, its interval is larger, and has the status instead.
    rest = judge_unchecked(judged.examined, moved=named)
    assert "measurement-unknown" not in [one.code for one in rest]
    assert verdict.level == "amber"
    assert [reason.cause for reason in verdict.reasons] == ["measurement-unknown"]
    assert all(one == "not-checked" for one, is_so in zip(status, unknown, strict=False) if is_so)


def test_without_a_measurement_there_is_no_verdict(clean: Judged) -> None:
    refined = clean.examined.refined
    nothing = propagate(refined.adjustment, (), NO_TIMES)
    judged = Judged(run_tests(refined, nothing, 0.001), measurement_results(nothing)[0])
    for messages in ((), (of("line-suspect"),), (of("not-converged"),)):
        verdict, status = judged.verdict(*messages)
        assert verdict.level is None
        assert status == ()
        assert len(verdict.reasons) == len(messages)


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
    codes = "labels-swapped", "line-left-out", "misfit"
    verdict, _ = clean.verdict(*(of(code) for code in codes))
    assert tuple(reason.cause for reason in verdict.reasons) == codes
    assert {reason.text for reason in verdict.reasons} == {"This is wrong. Look there."}
    assert get_first_sentences(Message("info", "misfit", "One. Two.")) == "One. Two."


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
        refined = find_best_minima(
            Participants(wrong, np.ones(len(right.pick_label), dtype=bool), first & out, {})
        )
        values[out] = propagate(refined.adjustment, REQUESTS[:2], NO_TIMES)
        if not out:
            examined = run_tests(refined, values[out], 0.001)
    moved = np.abs(values[True].value - values[False].value) / values[False].sigma
    assert examined.suspicions[0].suspect.kind == "lengths"
    assert moved.max() > 1.5  # so that the case says something
    assert is_moved(examined)[moved > 1.2].all()


def test_an_error_that_no_test_finds_moves_nothing_of_a_clean_survey_far(clean: Judged) -> None:
    assert not is_unchecked(clean.examined).any()
    assert list(judge_unchecked(clean.examined)) == []


def _clicks(survey: Survey, rows: Ints) -> Survey:
    """The survey with some rows of its picks, in this order; a row may be there twice."""
    return replace(
        survey,
        pick_label=survey.pick_label[rows],
        pick_frame=survey.pick_frame[rows],
        pixel_px=survey.pixel_px[rows],
        pick_sigma_px=survey.pick_sigma_px[rows],
    )


def _without_check(again: int = 0) -> Survey:
    """P0 in one photo, clicked once and so many times more, at the end of no length."""
    survey = make_scene(9, frames=6).survey
    own = survey.pick_label == survey.label.index("P0")
    first = np.flatnonzero(own)[:1]
    rows = np.concatenate([np.flatnonzero(~own), first, np.repeat(first, again)])
    few = _clicks(survey, np.sort(rows))
    lines = (few.line_start == 0) | (few.line_end == 0)
    assert not lines.all()
    few = replace(few, length_sigma_m=np.where(lines, 1e3, few.length_sigma_m))
    noise = np.random.default_rng(4).normal(0.0, 0.5, few.pixel_px.shape)
    return replace(few, pixel_px=few.pixel_px + (noise if again else 0.0))


def _of_survey(survey: Survey, withheld: KnownLines | None = None) -> Judged:
    refined, _ = refine(survey, SolveOptions(noise="stated"))
    measured = propagate(refined.adjustment, REQUESTS[:2], NO_TIMES)
    found = None
    if withheld is not None:
        found = compare_withheld(refined.adjustment, withheld, NO_POINTS)
    examined = run_tests(refined, measured, 0.001, found)
    return Judged(examined, measurement_results(measured)[0])


def test_a_point_in_one_photo_is_not_checked_however_small_its_sigma() -> None:
    judged = _of_survey(_without_check())
    (message,) = judge_unchecked(judged.examined)
    assert message.measurements == ("near",)
    assert message.labels == ("P0",)
    assert message.text.startswith(
        "'near' is not checked: a wrong click on P0 would not be noticed"
    )
    action = (
        "Click it yourself in one more photo, or again; a place that the program found from your "
        "click does not count."
    )
    assert message.text.endswith(f". {action}")
    assert message.plain == f"A wrong click on P0 would not be noticed. {action}"
    assert judged.verdict(message)[1] == ("not-checked", "ok")
    worst = judged.examined.weakest[0].unseen[0]
    assert worst.member.kind == "pixels"
    assert worst.sigmas == pytest.approx(MAX_ERROR_SIGMAS, rel=0.1)


def test_it_is_not_checked_however_large_the_sigma_of_the_value_is() -> None:
    """Here the scale is poor: 40 px in the click are little beside that, and 1000 px are much."""
    survey = _without_check()
    judged = _of_survey(replace(survey, length_sigma_m=np.full(len(survey.length_m), 20.0)))
    (worst,) = judged.examined.weakest[0].unseen[:1]
    per_sigma = worst.change / worst.sigmas / judged.examined.measured.sigma[0]
    assert 41.0 * per_sigma < 5.0 < UNDETECTED_SIGMAS < 1000.0 * per_sigma
    assert is_unchecked(judged.examined)[0]


def test_a_second_click_in_the_same_photo_checks_the_first() -> None:
    assert not is_unchecked(_of_survey(_without_check(1)).examined).any()


def test_a_coded_target_checks_itself() -> None:
    survey = _without_check()
    sure = np.flatnonzero(survey.pick_label == survey.label.index("P0"))
    assert not is_unchecked(_of_survey(replace(survey, target_pick=sure)).examined).any()


@pytest.mark.parametrize("wrong_m", [0.0, 3.0])
def test_a_withheld_length_that_fits_checks_the_measurement_between_its_points(
    wrong_m: float,
) -> None:
    once = _of_survey(_without_check())
    taped = float(once.table.value[0]) + wrong_m
    withheld = KnownLines(
        name=("check",),
        start=("P0",),
        end=("P1",),
        length_m=np.array([taped]),
        sigma_m=np.array([0.01]),
        adjust=np.array([False]),
    )
    found = is_unchecked(_of_survey(_without_check(), withheld).examined)
    assert found[0] == (wrong_m > 0)
