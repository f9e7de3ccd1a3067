"""Hypotheses on known lengths between other points than stated."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import combinations
from typing import NamedTuple

import numpy as np

from uavgram.estimation.reliability.hypotheses import HypothesisTest
from uavgram.estimation.survey.observations.lengths import describe_ends
from uavgram.model.arrays import Ints
from uavgram.model.message import Message
from uavgram.model.survey import Ends, Survey, SurveyCorrection
from uavgram.stages.refine.causes.hypothesis import Diagnosis, Hypothesis
from uavgram.stages.refine.causes.suspect_lengths import (
    MAX_LENGTHS,
    MAX_SLIP_SIGMAS,
    NONLINEAR_SHARE,
    MessageWords,
    SuspectLengths,
    find_suspect_lengths,
)

MAX_DIFFERENCE_M, MAX_RELATIVE_DIFFERENCE = 0.5, 0.05
"""Largest difference from the predicted length of another pair of labels, in metres and as a share,
at which its sigma is computed."""

MAX_PAIRS = 12
"""Largest number of pairs of labels with computed sigmas, for each length."""

MAX_PROPOSED = 2
"""Largest number of pairs of labels that are proposed for each length."""

RIVAL_DECREASE = 2.0 * float(np.log(20.0))
"""Difference of the decrease of the sum of squares up to which another pair of labels explains as
much."""


class _Pair(NamedTuple):
    """Ends of a length, by label of the survey; its predicted length there; and the gain."""

    ends: Ends
    length_m: float
    sigma_m: float
    fall: float


def propose_other_ends(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose other labels as the ends of lengths that do not fit."""
    found = find_suspect_lengths(diagnosis)
    known = np.flatnonzero(diagnosis.adjustment.label_rows(diagnosis.survey.label) >= 0)
    for k in range(min(MAX_LENGTHS, len(found.line))):
        start, end = _ends(found, k)
        others = known[(known != start) & (known != end)]
        ends = [Ends(int(c), end) for c in others] + [Ends(start, int(c)) for c in others]
        pairs = _find_fitting_pairs(found, k, ends)
        for pair in pairs[:MAX_PROPOSED]:
            price = found.price([k], max(1, len(ends)), found.fall_without([k]) - pair.fall)
            if price is None:
                continue
            rivals = [
                one for one in pairs if one is not pair and one.fall > pair.fall - RIVAL_DECREASE
            ]
            mend = SurveyCorrection(ends={int(found.line[k]): pair.ends})
            yield Hypothesis(
                message=partial(_other_ends_message, found, k, pair, rivals),
                mend=mend,
                equal=_list_exchanges_instead(diagnosis.survey, mend),
                promise=pair.fall,
                price=price,
                settles=found.list_names([k]),
            )
    for i, j in combinations(range(min(MAX_LENGTHS, len(found.line))), 2):
        yield from _propose_exchanged_ends(found, i, j)


def find_label_exchange_instead(survey: Survey, mend: SurveyCorrection) -> SurveyCorrection | None:
    """Return an exchange of two labels in all photos that is as good as other ends of lengths.

    This is the case where each corrected length has one label of the two in place of the other, and
    no further length ends at either: then it is undetermined which of the two mistakes was made.

    Parameters
    ----------
    survey
        All observations as stated.
    mend
        Correction of a cause.
    """
    exchanged = {
        frozenset((int(survey.line_start[line]), int(survey.line_end[line])))
        ^ frozenset((ends.start, ends.end))
        for line, ends in mend.ends.items()
    }
    if len(exchanged) != 1:
        return None
    (pair,) = exchanged
    if len(pair) != 2:
        return None
    start, end = (np.isin(each, list(pair)) for each in (survey.line_start, survey.line_end))
    if not np.isin(np.flatnonzero(start ^ end), list(mend.ends)).all():
        return None
    first, second = sorted(pair)
    right = {int(k): second for k in np.flatnonzero(survey.pick_label == first)}
    right |= {int(k): first for k in np.flatnonzero(survey.pick_label == second)}
    return SurveyCorrection(label_of_pick=right)


def _list_exchanges_instead(survey: Survey, mend: SurveyCorrection) -> tuple[SurveyCorrection, ...]:
    swapped = find_label_exchange_instead(survey, mend)
    return () if swapped is None else (swapped,)


def _ends(found: SuspectLengths, k: int) -> Ends:
    survey, line = found.diagnosis.survey, found.line[k]
    return Ends(int(survey.line_start[line]), int(survey.line_end[line]))


def _find_fitting_pairs(found: SuspectLengths, k: int, ends: Sequence[Ends]) -> list[_Pair]:
    """Find the labels between which a length fits, best first."""
    if not ends:
        return []
    # Preselect pairs by the predicted length alone.
    length = found.lengths_between(_labels(found, ends), k)
    away = np.abs(length - found.reading_m[k])
    near = np.argsort(away, kind="stable")[:MAX_PAIRS]
    near = near[away[near] < MAX_DIFFERENCE_M + MAX_RELATIVE_DIFFERENCE * found.reading_m[k]]
    ends = [ends[n] for n in near]
    if not ends:
        return []
    # Test the others: difference over the sigmas of prediction, reading and linearisation.
    length, sigma = found.between(_labels(found, ends), k, [k])
    missed = NONLINEAR_SHARE * abs(found.error[k]) * found.own_sigma_m[k] * found.takes_part[k]
    variance = sigma**2 + found.own_sigma_m[k] ** 2 + missed**2
    off = (found.reading_m[k] - length) / np.sqrt(variance)
    alone = found.fall_without([k])
    pairs = [
        _Pair(*each)
        for each in zip(ends, length, sigma, alone - off**2, strict=True)
        if each[3] > alone - MAX_SLIP_SIGMAS**2
    ]
    return sorted(pairs, key=lambda pair: -pair.fall)


def _labels(found: SuspectLengths, ends: Sequence[Ends]) -> tuple[Ints, Ints]:
    """Return labels of the adjustment for pairs of labels of the survey."""
    at: Ints = found.diagnosis.adjustment.label_rows(found.diagnosis.survey.label)
    return at[[e.start for e in ends]], at[[e.end for e in ends]]


def _propose_exchanged_ends(found: SuspectLengths, i: int, j: int) -> Iterator[Hypothesis]:
    """Propose that two lengths each have an end of the other."""
    (a, b), (c, d) = _ends(found, i), _ends(found, j)
    pairs = max(1, len(found.diagnosis.survey.line_start) - 1)
    alone = found.fall_without([i, j])
    for first, second in (((c, b), (a, d)), ((a, d), (c, b)), ((d, b), (c, a)), ((a, c), (b, d))):
        if len({*first}) < 2 or len({*second}) < 2 or {*first} == {a, b} or {*second} == {c, d}:
            continue
        off = 0.0
        for k, ends in ((i, first), (j, second)):
            length, sigma = found.between(_labels(found, [Ends(*ends)]), k, [i, j])
            away = found.reading_m[k] - length[0]
            own = found.own_sigma_m[k]
            missed = NONLINEAR_SHARE * abs(found.error[k]) * own * found.takes_part[k]
            off += float(away**2 / (sigma[0] ** 2 + own**2 + missed**2))
        price = found.price([i, j], 4.0 * pairs, off)
        if price is None:
            continue
        mend = SurveyCorrection(
            ends={int(found.line[i]): Ends(*first), int(found.line[j]): Ends(*second)}
        )
        yield Hypothesis(
            message=partial(_exchanged_ends_message, found, (i, j), (Ends(*first), Ends(*second))),
            mend=mend,
            equal=_list_exchanges_instead(found.diagnosis.survey, mend),
            promise=alone - off,
            price=price,
            settles=found.list_names([i, j]),
        )


def _describe_length(found: SuspectLengths, ends: Ends) -> str:
    label = found.diagnosis.survey.label
    return describe_ends("", label[ends.start], label[ends.end])


def _other_ends_message(
    found: SuspectLengths, k: int, pair: _Pair, rivals: Sequence[_Pair], _: HypothesisTest | None
) -> Message:
    """Report a length between other labels."""
    others = ""
    if rivals:
        named = " or ".join(_describe_length(found, each.ends) for each in rivals)
        others = f" It could as well be from {named}."
    own = f"{found.right_m[k]:.2f} ± {max(found.right_sigma_m[k], 0.01):.2f} m"
    there = f"{pair.length_m:.2f} ± {max(pair.sigma_m, 0.01):.2f} m"
    text = (
        f"The length {found.describe_length(k)} seems to be from "
        f"{_describe_length(found, pair.ends)}: look at the "
        f"notes, and correct the label of its end.{others} It reads {found.reading_m[k]:.10g} m; "
        f"by all the rest it is {there} there, and {own} between the labels as written."
    )
    item = f"{found.describe_length(k)} is from {_describe_length(found, pair.ends)}"
    opening = "{count} lengths seem to be between other labels"
    ending = "Look at the notes, and correct the labels of their ends."
    return found.make_message("line-other-ends", [k], MessageWords(text, (opening, item, ending)))


def _exchanged_ends_message(
    found: SuspectLengths, rows: tuple[int, int], ends: tuple[Ends, Ends], _: HypothesisTest | None
) -> Message:
    """Report two lengths with exchanged ends."""
    first, second = (found.describe_length(k) for k in rows)
    right = " and the second from ".join(_describe_length(found, each) for each in ends)
    text = (
        f"Ends of the lengths {first} and {second} seem to be exchanged: the first is from "
        f"{right}. Look at the notes, and correct the labels. As written, the first "
        f"{found.describe_difference(rows[0])}; the second {found.describe_difference(rows[1])}."
    )
    several = (
        "{count} pairs of lengths seem to have exchanged ends",
        f"{first} and {second}: the first is from {right}",
        "Look at the notes, and correct the labels.",
    )
    return found.make_message("line-other-ends", rows, MessageWords(text, several))
