"""Find frames whose pose may be the wrong one of the two planar solutions."""

from __future__ import annotations

import numpy as np
from scipy.special import chdtri

from uavgram.estimation.reliability.test_statistics import cofactors
from uavgram.estimation.survey.adjustment import LeftOutCause, Refined
from uavgram.model.survey.survey import Survey

BY_CHANCE = 0.001
"""Probability below which the residuals of a frame's picks put its pose in doubt."""

LOST = 400.0
"""Cost of a pick that an adjustment had to leave out: that of a poor fit."""


def doubtful_frames(survey: Survey, refined: Refined) -> frozenset[str]:
    """Find frames that an adjustment fits badly, or at whose picks it sees no ground.

    The sum of squares of a frame's picks is compared with chi-square of their redundancy.
    """
    adjustment = refined.adjustment
    block, names = adjustment.minimum.blocks["pixels"], adjustment.survey.frame_id
    frame = adjustment.survey.pick_frame
    # Redundancy of each pick: trace of its cofactor matrix.
    own = np.einsum("nii->n", cofactors(block, adjustment.covariance))
    redundancy = np.bincount(frame, own, len(names))
    square = np.bincount(frame, np.sum(block.residual**2, axis=1), len(names))
    bad = square > chdtri(np.maximum(redundancy, 1.0), BY_CHANCE)
    unseen = {
        survey.frame_id[survey.pick_frame[pick]]
        for pick, why in refined.pick_reason.items()
        if why.cause is LeftOutCause.NO_GROUND
    }
    return frozenset(unseen | {names[k] for k in np.flatnonzero(bad)})


def cost_with_lost(refined: Refined, picks: int) -> float:
    """Return the cost of an adjustment of so many picks, including the left-out ones."""
    return refined.adjustment.minimum.cost + LOST * (picks - len(refined.pick_index))
