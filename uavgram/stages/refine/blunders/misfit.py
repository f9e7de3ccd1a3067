"""A frame that does not show what the others do, and takes the whole adjustment with it.

That is no blunder among good picks, which the tests of the residuals find, but a photo of another
place, or labels in disorder. Kept, it bends everything else, often so far that nothing comes to
rest; the residuals then say little of where the fault lies, so each suspect is left out in turn.
"""

from __future__ import annotations

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.survey.adjustment import Adjustment, Refined
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.begin.doubt import cost_with_lost
from uavgram.stages.refine.minima import Participants, best_minima

GROSS = 20.0
"""Median residual of a frame's picks, in their sigmas, beyond which something is out of order."""

MOST_TRIED = 12
"""Frames that are left out in turn: those whose picks fit worst."""

GAIN = 3.0
"""The misfit has to fall by this factor without the frame, and to less than without any other."""


def suspects(adjustment: Adjustment) -> Ints:
    """Frames to leave out in turn, worst first; none where the adjustment is in order."""
    # With two frames nothing tells which is the one.
    few = len(adjustment.survey.frame_id) < 3
    if few or (adjustment.minimum.converged and not gross(adjustment)):
        return np.zeros(0, dtype=np.int64)
    return np.argsort(-_by_frame(adjustment), kind="stable")[:MOST_TRIED]


def gross(adjustment: Adjustment) -> bool:
    """Whether a frame fits so badly that something is out of order."""
    return bool(_by_frame(adjustment).max() >= GROSS)


def _by_frame(adjustment: Adjustment) -> Floats:
    """(F,) median residual of each frame's picks, in their sigmas."""
    size = np.linalg.norm(adjustment.minimum.blocks["pixels"].residual, axis=1)
    return group_medians(size, adjustment.survey.pick_frame, len(adjustment.survey.frame_id))


def culprit(cost: float, without: Floats) -> int | None:
    """Which of the suspects it is, by the cost with all and without each; None if none stands out.

    Parameters
    ----------
    cost
        Weighted sum of squared residuals of the whole.
    without
        (n,) the same without each suspect; infinite where nothing could be adjusted.
    """
    order = np.argsort(without, kind="stable")
    best, second = without[order[0]], without[order[1]]
    if GAIN * best > cost or GAIN * best > second:
        return None
    return int(order[0])


def group_medians(value: Floats, group: Ints, groups: int) -> Floats:
    """Lower median of the values of each group; 0 where it has none.

    Parameters
    ----------
    value
        (n,) values, in any unit.
    group
        (n,) group of each.
    groups
        Number of groups.
    """
    if not len(value):
        return np.zeros(groups)
    order = np.lexsort((value, group))
    number = np.bincount(group, minlength=groups)
    first = np.cumsum(number) - number
    middle = np.minimum(first + np.maximum(number - 1, 0) // 2, len(value) - 1)
    return np.where(number > 0, value[order][middle], 0.0)


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
    return cost_with_lost(refined, int(taking.keep.sum()))
