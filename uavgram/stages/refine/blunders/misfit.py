"""A frame that does not show what the others do, and takes the whole adjustment with it.

That is no blunder among good picks, which the tests of the residuals find, but a photo of another
place, or labels in disorder. Kept, it bends everything else, often so far that nothing comes to
rest; the residuals then say little of where the fault lies, so each suspect is left out in turn.
"""

from __future__ import annotations

import numpy as np

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.arrays import Floats, Ints

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
    """Lower median of the values of each group; 0 where it has none."""
    if not len(value):
        return np.zeros(groups)
    order = np.lexsort((value, group))
    number = np.bincount(group, minlength=groups)
    first = np.cumsum(number) - number
    middle = np.minimum(first + np.maximum(number - 1, 0) // 2, len(value) - 1)
    return np.where(number > 0, value[order][middle], 0.0)
