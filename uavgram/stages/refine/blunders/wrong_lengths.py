"""Lengths that take everything with them, found by leaving each of them out in turn."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.survey.adjustment import Refined
from uavgram.model.arrays import Bools
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.blunders.gross_lengths import fits, wrong_beyond_doubt
from uavgram.stages.refine.blunders.misfit import culprit, gross
from uavgram.stages.refine.blunders.trial_adjustment import ends_among, misfit, trial_adjustment

MOST_TRIED = 36
"""Sets of lengths that are left out in turn, of one size: pairs of up to nine lengths."""

REST = 3
"""Lengths that have to stay: fewer say nothing of each other."""


def without_wrong_lengths(
    survey: Survey,
    keep: Bools,
    line_removed: Bools,
    reason: dict[int, str],
    refined: Refined | None,
    number: int,
) -> Refined | None:
    """The result without the lengths that all else rules out; None where there are none.

    Parameters
    ----------
    survey, keep, line_removed, reason
        As for `adjust`.
    refined
        With all lengths; None where nothing could be adjusted.
    number
        Of lengths that are left out together.

    Notes
    -----
    Only where nothing but lengths gives the scale: what a log says of them is known beforehand.
    """
    if survey.telemetry is not None or (refined is not None and not _led_astray(refined)):
        return None
    lines = np.flatnonzero(~line_removed & ends_among(survey, survey.pick_label[keep]))
    sets = list(combinations(lines.tolist(), number))
    if len(lines) - number < REST or len(sets) > MOST_TRIED:
        return None
    picks = int(keep.sum())
    tried: list[Refined | None] = []
    for left_out in sets:
        removed = line_removed.copy()
        removed[list(left_out)] = True
        try:
            tried.append(trial_adjustment(survey, keep, removed, reason))
        except GeometryError:  # without these lengths nothing is left to hold on to
            tried.append(None)
    costs = np.array([np.inf if each is None else misfit(each, picks) for each in tried])
    found = culprit(np.inf if refined is None else misfit(refined, picks), costs)
    rest = None if found is None else tried[found]
    if found is None or rest is None or _led_astray(rest) or not fits(rest):
        return None
    return rest if wrong_beyond_doubt(survey, rest, np.array(sets[found])).all() else None


def _led_astray(refined: Refined) -> bool:
    """Whether an adjustment did not come to rest, or came to rest where something is far off."""
    lost = bool(refined.undetermined)
    return lost or not refined.adjustment.minimum.converged or gross(refined.adjustment)
