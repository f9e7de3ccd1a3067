"""Hypotheses on wrong readings of known lengths, by the kind of slip."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np

from uavgram.estimation.reliability.hypotheses import HypothesisTest
from uavgram.estimation.reliability.redundancy import compute_reductions
from uavgram.estimation.reliability.stated_values import CONVERSIONS, DECIMALS, UNITS
from uavgram.estimation.survey.adjustment import Refined
from uavgram.estimation.survey.observations.lengths import describe_ends
from uavgram.estimation.survey.observations.observation import Subjects
from uavgram.model.arrays import Floats
from uavgram.model.message import Message, MessagePlural
from uavgram.model.naming import join_names
from uavgram.model.survey import Survey, SurveyCorrection
from uavgram.stages.refine.causes.correction import adjust_with_all
from uavgram.stages.refine.causes.flight_log import scale_by_heights
from uavgram.stages.refine.causes.hypothesis import (
    GROSS_ERROR_LOG_ODDS,
    SURE_LOG_ODDS,
    Diagnosis,
    Hypothesis,
)
from uavgram.stages.refine.causes.other_poses import (
    compute_decreases,
    find_picks_of_photo,
    needs_other_poses,
)
from uavgram.stages.refine.causes.suspect_lengths import (
    MAX_SLIP_SIGMAS,
    MessageWords,
    SuspectLengths,
    find_suspect_lengths,
    find_unchecked_lengths,
    rate_aimless,
)
from uavgram.stages.refine.left_out import predict_readings
from uavgram.stages.refine.minima import Patience

MAX_WRONG_LENGTHS = 4
"""Largest number of single wrong lengths that are proposed."""

MAX_EXCHANGED = 12
"""Largest number of lengths up to which exchanges of any two readings are tried."""

MOST_ADJUSTED = 15
"""Largest number of exchanges that are adjusted one by one."""

MIN_LENGTHS_FOR_ALL = 3
"""Number of lengths above which a mistake in every one of them is reported for all together."""

MISREAD_STEPS = ((10.0, "ten metres"), (1.0, "one metre"), (0.1, "one decimetre"))
"""Errors of miscounted or misheard readings [m]."""


class WrongUnit(NamedTuple):
    """Unit of the readings: its number in a metre, a description, and the remedy."""

    size: float
    words: str
    undo: str


WRONG_UNITS = (
    *(WrongUnit(n, f"in {unit}, not in metres", "write them in metres") for n, unit in UNITS),
    *(WrongUnit(n, words, "write them as they were before") for n, words in CONVERSIONS),
)


class Slip(NamedTuple):
    """Correct reading [m], and a description of the mistake."""

    right_m: float
    words: str


def propose_wrong_lengths(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose a reading error of any amount for the participating lengths of largest misfit."""
    adjustment = diagnosis.adjustment
    block = adjustment.minimum.blocks.get("lengths")
    if block is None:
        return
    lines = diagnosis.refined.line_index[adjustment.problem.line_index]
    price = GROSS_ERROR_LOG_ODDS + float(np.log(len(lines)))
    fall = compute_reductions(block, adjustment.covariance)
    for row in np.argsort(-fall, kind="stable")[:MAX_WRONG_LENGTHS].tolist():
        yield Hypothesis(
            message=None,
            mend=_leave_out(int(lines[row])),
            promise=float(fall[row]),
            price=price,
        )
    unchecked = find_unchecked_lengths(adjustment)
    if len(unchecked):
        yield from _propose_unchecked_lengths(diagnosis, lines[unchecked].tolist(), price)


def _propose_unchecked_lengths(
    diagnosis: Diagnosis, lines: Sequence[int], price: float
) -> Iterator[Hypothesis]:
    """Propose the length without which a survey fits best; all of those that do nearly as well.

    Parameters
    ----------
    diagnosis
        The survey under diagnosis.
    lines
        Lengths that no other observation checks.
    price
        Price of each.
    """
    near = _adjust_each(diagnosis, [_leave_out(line) for line in lines], price)
    if not near:
        return
    which, refined = near[0]
    named = [lines[k] for k, _ in near]
    names = diagnosis.survey.line_name
    gain = diagnosis.cost - refined.adjustment.minimum.cost
    is_sure = len(named) == 1 and gain / 2.0 - price > SURE_LOG_ODDS  # it is left out
    message = partial(_unchecked_message, diagnosis.survey, named, refined)
    yield Hypothesis(
        message=None if is_sure else message,
        mend=_leave_out(lines[which]),
        equal=tuple(_leave_out(other) for other in named[1:]),
        is_clear=False,
        is_of_all=True,
        adjusted=refined,
        promise=gain,
        price=price,
        settles=frozenset(names[k] for k in named if names),
    )


def _adjust_each(
    diagnosis: Diagnosis, corrections: Sequence[SurveyCorrection], price: float
) -> list[tuple[int, Refined]]:
    """Adjust the survey from first values with each of some corrections of one price.

    Returns
    -------
    Rows and adjustments of the best one, and of those that fit nearly as well, best first; empty
    where none is likely.
    """
    goal = diagnosis.adjustment.minimum.cost - 2.0 * (price - SURE_LOG_ODDS)
    found: list[tuple[float, int, Refined]] = []
    for k, mend in enumerate(corrections):
        after = adjust_with_all(diagnosis, mend, Patience(goal=goal))
        if after is not None and after.adjustment.minimum.converged:
            cost = after.adjustment.minimum.cost
            goal = min(goal, cost + 2.0 * SURE_LOG_ODDS)
            found.append((cost, k, after.refined))
    near = sorted((one for one in found if one[0] <= goal), key=lambda one: one[:2])
    return [(k, refined) for _, k, refined in near]


def _leave_out(line: int) -> SurveyCorrection:
    return SurveyCorrection(without_lines=frozenset([line]))


def _unchecked_message(
    survey: Survey, lines: Sequence[int], refined: Refined, _: HypothesisTest | None
) -> Message:
    """Report that a length, or one of several, may be wrong.

    Parameters
    ----------
    survey, lines
        The survey, and its lengths that may be wrong.
    refined
        Its adjustment without the first of them.
    """
    names = [survey.line_name[k] if survey.line_name else "" for k in lines]
    ends = [(survey.label[survey.line_start[k]], survey.label[survey.line_end[k]]) for k in lines]
    each = join_names(describe_ends(name, *two) for name, two in zip(names, ends, strict=True))
    about: Subjects = {
        "lengths": tuple(filter(None, names)),
        "labels": tuple(dict.fromkeys(label for two in ends for label in two)),
    }
    action = "Look at the reading, the unit and the ends, or tape another line."
    if len(lines) > 1:
        return Message(
            "warning",
            "blunder-not-located",
            f"One of these lengths may be wrong, and no test shows which: {each}. Without any one "
            f"of them, all the rest fits much better. {action}",
            **about,
        )
    (seen,), (sigma,) = predict_readings(survey, refined, np.array(lines))
    return Message(
        "warning",
        "line-suspect",
        f"The length {each} may be wrong: {survey.length_m[lines[0]]:.10g} m taped, but without "
        f"it all the rest fits much better, and shows {seen:.2f} ± {sigma:.2f} m. {action}",
        **about,
    )


def propose_other_units(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose that lengths are in another unit: single ones, those that do not fit, or all."""
    yield from _propose_units(find_suspect_lengths(diagnosis))
    yield from _propose_unit_of_all(diagnosis)


def propose_slips(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose slips: lengths with a wrong digit, or with exchanged readings."""
    found = find_suspect_lengths(diagnosis)
    yield from _propose_digits(found)
    if needs_other_poses(diagnosis):
        yield from _propose_exchanged_by_other_poses(diagnosis)
    else:
        yield from _propose_exchanged(found)


def _propose_units(found: SuspectLengths) -> Iterator[Hypothesis]:
    for unit in WRONG_UNITS:
        right = found.reading_m / unit.size
        error = found.reading_m - right
        rows = [k for k in range(len(error)) if found.off([k], error[[k]]) < MAX_SLIP_SIGMAS**2]
        survey = found.diagnosis.survey
        if MIN_LENGTHS_FOR_ALL <= len(rows) == len(survey.line_start):  # one mistake, not many
            yield _make_unit_of_all(survey, unit, found.fall(rows, error[rows]))
            continue
        together = [tuple(rows)] if len(rows) > 1 else []
        for some in (*((k,) for k in rows), *together):
            tell = partial(_unit_message, found, some, unit)
            yield from _propose_slip(found, some, right[list(some)], len(WRONG_UNITS), tell)


def _propose_unit_of_all(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose that all lengths are in another unit, where the log's heights show its scale.

    Then no single length has a misfit, as all other observations may have followed them.
    """
    scale = scale_by_heights(diagnosis.adjustment)
    if scale is None:
        return
    survey = diagnosis.survey
    for unit in WRONG_UNITS:
        off = float(np.log(scale.ratio / unit.size)) / scale.relative_sigma
        if abs(off) <= MAX_SLIP_SIGMAS:
            yield _make_unit_of_all(survey, unit, scale.gain - off**2)


def _make_unit_of_all(survey: Survey, unit: WrongUnit, promise: float) -> Hypothesis:
    """Make the hypothesis that all lengths are in another unit."""
    right_m = survey.length_m / unit.size
    return Hypothesis(
        message=partial(_unit_of_all_message, survey, unit),
        mend=SurveyCorrection(length_m=dict(enumerate(right_m.tolist()))),
        is_of_all=True,
        promise=promise,
        price=float(np.log(len(WRONG_UNITS))),
        settles=frozenset(survey.line_name),
    )


def _propose_digits(found: SuspectLengths) -> Iterator[Hypothesis]:
    for k in range(len(found.line)):
        least = MAX_SLIP_SIGMAS * found.sigma_m[k]
        reading = float(found.reading_m[k])
        slips = [one for one in list_slips(reading) if abs(one.right_m - reading) > least]
        for slip in slips:
            tell = partial(_digit_message, found, k, slip)
            yield from _propose_slip(found, (k,), np.array([slip.right_m]), len(slips), tell)


def _propose_exchanged(found: SuspectLengths) -> Iterator[Hypothesis]:
    others = max(1, len(found.diagnosis.survey.line_start) - 1)
    for i, j in combinations(range(len(found.line)), 2):
        detail = (
            f"The first {found.describe_difference(i)}; the second {found.describe_difference(j)}."
        )
        lines = int(found.line[i]), int(found.line[j])
        tell = partial(_exchanged_message, found.diagnosis.survey, lines, detail)
        yield from _propose_slip(found, (i, j), found.reading_m[[j, i]], others, tell)


def _propose_exchanged_by_other_poses(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    survey = diagnosis.survey
    pairs = [
        (i, j)
        for i, j in combinations(range(len(survey.length_m)), 2)
        if survey.length_m[i] != survey.length_m[j]
    ]
    if not pairs or len(survey.length_m) > MAX_EXCHANGED:
        return
    every = [
        SurveyCorrection(length_m={i: float(survey.length_m[j]), j: float(survey.length_m[i])})
        for i, j in pairs
    ]
    adjusted: dict[int, Refined] = {}
    if len(find_unchecked_lengths(diagnosis.adjustment)) and len(pairs) <= MOST_ADJUSTED:
        # One photo fits with any of them: the photos are adjusted together.
        least = min(_price_exchange(survey, pair) for pair in pairs) + float(np.log(len(pairs)))
        adjusted = dict(_adjust_each(diagnosis, every, least))
        decrease = np.zeros(len(pairs))
        for k, refined in adjusted.items():
            decrease[k] = diagnosis.cost - refined.adjustment.minimum.cost
    else:
        decrease = compute_decreases(diagnosis, find_picks_of_photo(diagnosis), every)
    for k in np.argsort(-decrease, kind="stable")[:MAX_WRONG_LENGTHS].tolist():
        one, other = (f"{survey.length_m[i]:.10g} m" for i in pairs[k])
        detail = (
            f"The first is written as {one}, the second as {other}; the other way round, they fit "
            "with all others."
        )
        if decrease[k] > 0.0:
            yield Hypothesis(
                message=partial(_exchanged_message, survey, pairs[k], detail),
                mend=every[k],
                is_of_all=True,
                adjusted=adjusted.get(k),
                promise=float(decrease[k]),
                price=_price_exchange(survey, pairs[k]) + float(np.log(len(pairs))),
                settles=frozenset(survey.line_name[i] for i in pairs[k] if survey.line_name),
            )


def _price_exchange(survey: Survey, pair: tuple[int, int]) -> float:
    """Compute the price of two errors of the size of an exchange (see `SuspectLengths.price`)."""
    i, j = pair
    size = abs(survey.length_m[i] - survey.length_m[j]) / survey.length_sigma_m[list(pair)]
    return float(np.sum(np.maximum(GROSS_ERROR_LOG_ODDS - rate_aimless(size), 0.0)))


def _propose_slip(
    found: SuspectLengths,
    rows: tuple[int, ...],
    right_m: Floats,
    alternatives: int,
    tell: Callable[[HypothesisTest | None], Message],
) -> Iterator[Hypothesis]:
    """Propose that some lengths have other readings, if that is likely enough.

    Parameters
    ----------
    found, rows
        The lengths that do not fit, and rows among them.
    right_m
        (m,) correct readings.
    alternatives
        Number of possible slips of that kind.
    tell
        Function that makes the message.
    """
    error = found.reading_m[list(rows)] - right_m
    price = found.price(rows, alternatives, found.off(rows, error))
    if price is not None:
        lines = found.line[list(rows)].tolist()
        yield Hypothesis(
            message=tell,
            mend=SurveyCorrection(length_m=dict(zip(lines, right_m.tolist(), strict=True))),
            promise=found.fall(rows, error),
            price=price,
            settles=found.list_names(rows),
        )


def list_slips(reading_m: float) -> tuple[Slip, ...]:
    """Return correct readings for a missed digit, a misplaced point, or transposed digits."""
    slips = [Slip(reading_m / size, words) for size, words in DECIMALS]
    for step, words in MISREAD_STEPS:
        slips.append(Slip(reading_m - step, f"it is {words} too long"))
        slips.append(Slip(reading_m + step, f"it is {words} too short"))
    text = max(f"{reading_m:.10g}", f"{reading_m:.2f}", key=len)
    digits = [k for k, each in enumerate(text) if each.isdigit()]
    for first, second in pairwise(digits):
        if text[first] != text[second]:
            other = list(text)
            other[first], other[second] = text[second], text[first]
            written = "".join(other)
            slips.append(Slip(float(written), f"two digits are transposed, {text} for {written}"))
    return tuple(slip for slip in slips if slip.right_m > 0)


def _unit_message(
    found: SuspectLengths, rows: Sequence[int], unit: WrongUnit, _: HypothesisTest | None
) -> Message:
    """Report lengths in another unit."""
    right = [f"{found.reading_m[k] / unit.size:.2f} m" for k in rows]
    each = [f"{found.describe_length(k)} would be {m}" for k, m in zip(rows, right, strict=True)]
    seem = f"seem to be {unit.words}"
    if len(rows) > 1:
        text = f"{len(rows)} lengths {seem}: {unit.undo}. {'; '.join(each)}."
        told = MessageWords(text, ("", "", ""), f"{join_names(map(found.short, rows))} {seem}.")
        return found.make_message("line-wrong-unit", rows, told)
    text = (
        f"The length {found.describe_length(rows[0])} seems to be {unit.words}: write {right[0]}. "
        f"It "
        f"{found.describe_difference(rows[0])}."
    )
    several = (f"{{count}} lengths {seem}", each[0], f"{unit.undo.capitalize()}.")
    plain = f"{found.short(rows[0])} seems to be {unit.words}."
    return found.make_message("line-wrong-unit", rows, MessageWords(text, several, plain))


def _unit_of_all_message(
    survey: Survey, unit: WrongUnit, _: HypothesisTest | None = None
) -> Message:
    """Report that all lengths are in another unit."""
    ends = zip(survey.line_start.tolist(), survey.line_end.tolist(), strict=True)
    names = survey.line_name or ("",) * len(survey.line_start)
    each = [
        f"{describe_ends(name, survey.label[start], survey.label[end])} "
        f"would be {m / unit.size:.2f} m"
        for name, (start, end), m in zip(names, ends, survey.length_m.tolist(), strict=True)
    ]
    what = f"All lengths seem to be {unit.words}"
    text = f"{what}: {unit.undo}. {'; '.join(each[:2])}, and so on."
    labels = dict.fromkeys(survey.label[k] for k in (*survey.line_start, *survey.line_end))
    return Message(
        "warning",
        "lengths-wrong-unit",
        text,
        lengths=survey.line_name,
        labels=tuple(labels),
        plain=f"{what}.",
    )


def _digit_message(found: SuspectLengths, k: int, slip: Slip, _: HypothesisTest | None) -> Message:
    """Report a length with a wrong digit."""
    text = (
        f"The length {found.describe_length(k)} seems to be misread or miswritten: {slip.words}. "
        f"Look at "
        f"the notes, and write {slip.right_m:.10g} m if they confirm it; else look at the picks "
        f"of its ends. It {found.describe_difference(k)}."
    )
    item = (
        f"{found.describe_length(k)} reads {found.reading_m[k]:.10g} m instead of "
        f"{slip.right_m:.10g} m"
    )
    opening = "{count} lengths seem to be misread or miswritten"
    ending = "Look at the notes, and at the picks of their ends."
    plain = (
        f"{found.short(k)} seems misread: it is written as {found.reading_m[k]:.10g} m, and should "
        f"be {slip.right_m:.10g} m."
    )
    return found.make_message(
        "line-wrong-digit", [k], MessageWords(text, (opening, item, ending), plain)
    )


def _exchanged_message(
    survey: Survey, pair: tuple[int, int], detail: str, _: HypothesisTest | None
) -> Message:
    """Report two lengths with exchanged readings.

    Parameters
    ----------
    survey, pair
        The survey, and two of its lengths.
    detail
        Sentence on how well they fit.
    """
    ends = [(survey.label[survey.line_start[k]], survey.label[survey.line_end[k]]) for k in pair]
    names = [survey.line_name[k] if survey.line_name else "" for k in pair]
    first, second = (describe_ends(name, *two) for name, two in zip(names, ends, strict=True))
    return Message(
        "warning",
        "lines-exchanged",
        f"The readings of the lengths {first} and {second} seem to be exchanged: look at the "
        f"notes, and swap them. {detail}",
        lengths=tuple(filter(None, names)),
        labels=tuple(dict.fromkeys(label for two in ends for label in two)),
        several=MessagePlural(
            "{count} pairs of lengths seem to have each other's readings",
            f"{first} and {second}",
            ending="Swap them.",
        ),
    )
