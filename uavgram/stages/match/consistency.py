"""Which finds the adjustment contradicts: moved cars, repeated markings, look-alikes."""

from __future__ import annotations

import numpy as np
from scipy.special import chdtri

from uavgram.model.arrays import Bools, Floats, Ints

CONTRADICTED = float(chdtri(2, 1e-5))
"""Squared sigmas of a place's misfit in the adjustment beyond which it is another thing."""

MEDIAN = float(chdtri(2, 0.5))
"""What half of such misfits stay below where sigmas are right."""


def contradicted(misfit: Floats, frame: Ints, label: Ints) -> Bools:
    """Which finds are to be taken back before the rest is adjusted anew.

    A wrong find pulls at others: only the worst of its photo and of its label goes at a time.
    Where all fit less well than promised, the promise is what is wrong: limits grow with it.

    Parameters
    ----------
    misfit
        (n,) by which the sum of squares would fall without each find.
    frame, label
        (n,) photo and label of each.
    """
    if not misfit.size:
        return np.zeros(0, dtype=np.bool_)
    scale = max(1.0, float(np.median(misfit)) / MEDIAN)
    wrong = misfit > scale * CONTRADICTED
    for group in (frame, label):
        worst = np.zeros(int(group.max()) + 1)
        np.maximum.at(worst, group, misfit)
        wrong &= misfit >= worst[group]
    return wrong
