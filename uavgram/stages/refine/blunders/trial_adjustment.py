"""Short adjustments that only have to show what leaving something out does."""

from __future__ import annotations

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.survey.adjustment import Refined
from uavgram.model.arrays import Bools, Ints
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.blunders.misfit import GROSS, suspects
from uavgram.stages.refine.minima import Participants, best_minima

TRIAL = 20
"""Iterations of an adjustment that only has to show whether what was left out was the trouble:
where it was, few are needed."""


def trial_adjustment(taking: Participants) -> Refined | None:
    """`best_minima` cut short: to see what leaving something out does; None where nothing is left.

    In order (see `is_settled`), it is the result of `adjust_survey`.
    """
    try:
        return best_minima(taking, TRIAL)
    except GeometryError:
        return None


def is_settled(refined: Refined) -> bool:
    """Whether an adjustment came to rest, and no frame spoils it."""
    return refined.adjustment.minimum.converged and not len(suspects(refined.adjustment))


def ends_among(survey: Survey, labels: Ints) -> Bools:
    """(L,) whether both ends of a line are among some labels."""
    return np.asarray(np.isin(survey.line_start, labels) & np.isin(survey.line_end, labels))


def misfit(refined: Refined | None, taking: Participants) -> float:
    """Cost of an adjustment; a pick that it had to leave out counts as one that fits badly.

    Infinite where nothing could be adjusted.
    """
    if refined is None:
        return np.inf
    picks = int(taking.keep.sum())
    return refined.adjustment.minimum.cost + GROSS**2 * (picks - len(refined.pick_index))
