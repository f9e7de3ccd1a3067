"""Lengths that take everything with them, found by leaving each of them out in turn."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from uavgram.estimation.survey.adjustment import Refined
from uavgram.stages.refine.blunders.gross_lengths import fits, wrong_beyond_doubt
from uavgram.stages.refine.blunders.misfit import (
    culprit,
    ends_among,
    gross,
    misfit,
    trial_adjustment,
)
from uavgram.stages.refine.minima import Participants

MOST_TRIED = 36
"""Sets of lengths that are left out in turn, of one size: pairs of up to nine lengths."""

REST = 3
"""Lengths that have to stay: fewer say nothing of each other."""


def without_wrong_lengths(
    taking: Participants, refined: Refined | None, number: int
) -> Refined | None:
    """The result without the lengths that all else rules out; None where there are none.

    Parameters
    ----------
    taking
        What takes part.
    refined
        With all lengths; None where nothing could be adjusted.
    number
        Of lengths that are left out together.

    Notes
    -----
    Only where nothing but lengths gives the scale: what a log says of them is known beforehand.
    """
    survey = taking.survey
    if survey.telemetry is not None or (refined is not None and not _led_astray(refined)):
        return None
    both_picked = ends_among(survey, survey.pick_label[taking.keep])
    lines = np.flatnonzero(~taking.line_removed & both_picked)
    sets = list(combinations(lines.tolist(), number))
    if len(lines) - number < REST or len(sets) > MOST_TRIED:
        return None
    tried = [trial_adjustment(taking.without_lines(left_out)) for left_out in sets]
    costs = np.array([misfit(each, taking) for each in tried])
    found = culprit(misfit(refined, taking), costs)
    rest = None if found is None else tried[found]
    if found is None or rest is None or _led_astray(rest) or not fits(rest):
        return None
    return rest if wrong_beyond_doubt(survey, rest, np.array(sets[found])).all() else None


def _led_astray(refined: Refined) -> bool:
    """Whether an adjustment did not come to rest, or came to rest where something is far off."""
    lost = bool(refined.undetermined)
    return lost or not refined.adjustment.minimum.converged or gross(refined.adjustment)
