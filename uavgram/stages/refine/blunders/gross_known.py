"""Known things that are wrong beyond doubt: a value in another unit, points that were mixed up.

As a gross length does (see `gross_lengths`), one bends everything, and the tests then accuse
whatever is bent. Where all does not fit, an adjustment without any known thing says which of them
it rules out; these do not take part.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.estimation.survey.adjustment import Refined, Removal
from uavgram.estimation.survey.suspicion import Member, Suspicion
from uavgram.estimation.survey.terms.known_terms import known_rows
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.blunders.gross_lengths import BEYOND


def known_errors(survey: Survey, refined: Refined) -> dict[int, float]:
    """How far each known thing is from what an adjustment says, in sigmas of both, by its number.

    Of several numbers the largest. Those whose points are not all adjusted are left out.

    Parameters
    ----------
    survey
        All observations.
    refined
        An adjustment without the things that are asked for.
    """
    adjustment = refined.adjustment
    things = []
    for thing in survey.known:
        label = np.full(len(survey.label), -1)
        label[list(thing.label)] = adjustment.label_rows(survey.label[k] for k in thing.label)
        if (seen := thing.relabelled(label)) is not None:
            things.append(seen)
    if not things:
        return {}
    rows = known_rows(adjustment.problem, adjustment.state, things)
    variance = adjustment.minimum.factor.variances(rows.columns, rows.gradient)
    error = rows.value / np.sqrt(variance + rows.sigma**2)
    largest: dict[int, float] = {}
    for at, each in zip(rows.thing.tolist(), error.tolist(), strict=True):
        index = things[at].index
        if abs(each) > abs(largest.get(index, 0.0)):
            largest[index] = each
    return largest


def known_beyond_doubt(survey: Survey, refined: Refined) -> frozenset[int]:
    """Numbers of the known things that an adjustment without any of them rules out."""
    errors = known_errors(survey, refined)
    return frozenset(index for index, error in errors.items() if abs(error) > BEYOND)


def with_gross_known(survey: Survey, refined: Refined) -> Refined:
    """The same, with a record of the known things left out before anything was tested."""
    recorded = {removal.index for removal in refined.removals if removal.kind == "known"}
    out = refined.known_removed - recorded
    if not out:
        return refined
    errors = known_errors(survey, refined)
    records = [
        Removal("known", index, Suspicion(Member("known", -1, 0), errors[index], (), ()), None)
        for index in sorted(out)
        if index in errors
    ]
    return replace(refined, removals=(*records, *refined.removals))
