"""Whether one wrong pick explains better what looks like a point off the ground."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import chdtrc

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.arrays import Bools, Floats, Ints

UNLIKELY = 0.001
"""Probability of a label's sum of squares below which its picks fit at no height."""

HEIGHT, WRONG_PICK = 8.0, 18.0
"""What a free height, and a pick left out, have to bring: fall of the weighted sum of squares."""

STEPS = 4
"""Towards the place that fits best; each takes the error down by a hundred times and more."""


def one_wrong_pick_explains(adjustment: Adjustment, off: Bools, sigma_px: Floats) -> Bools:
    """(K,) labels, of those off the ground, that are better explained by a wrong pick on it.

    Those that fit at their height are not asked: two of three photos and more agree then. Nor can
    it be told from two photos, but that they agree at no height at all.

    Parameters
    ----------
    adjustment
        With the departures of these labels as unknowns.
    off
        (K,) which these are.
    sigma_px
        (P,) of the picks, those that stray with no less weight than others.
    """
    survey = adjustment.survey
    explained = np.zeros(len(off), dtype=np.bool_)
    for label in np.flatnonzero(off).tolist():
        picks = np.flatnonzero(survey.pick_label == label)
        whole = least_squares(adjustment, picks, sigma_px[picks], free=True)
        degrees = 2 * len(picks) - 3
        if degrees < 1 or chdtrc(degrees, whole) > UNLIKELY:
            continue
        explained[label] = len(picks) < 3 or not _stands(adjustment, picks, whole, sigma_px)
    return explained


def _stands(adjustment: Adjustment, picks: Ints, whole: float, sigma_px: Floats) -> bool:
    """Whether some height explains three picks and more best, be one of them wrong or not."""
    each = [np.delete(picks, k) for k in range(len(picks))]
    on_it = [least_squares(adjustment, rest, sigma_px[rest], free=False) for rest in each]
    free = [least_squares(adjustment, rest, sigma_px[rest], free=True) for rest in each]
    standing = min(whole + HEIGHT, min(free) + HEIGHT + WRONG_PICK)
    return standing < min(on_it) + WRONG_PICK


def least_squares(adjustment: Adjustment, picks: Ints, sigma_px: Floats, *, free: bool) -> float:
    """Least sum of squares of some picks of one label, the cameras as they are.

    Parameters
    ----------
    adjustment
        Where the cameras are; the search begins at its point.
    picks
        (n,) of the label.
    sigma_px
        (n,) of them.
    free
        Whether its height is free, or that of the ground.
    """
    survey, state = adjustment.survey, adjustment.state
    label = int(survey.pick_label[picks[0]])
    size = 3 if free else 2
    block = adjustment.minimum.blocks["pixels"]
    weight = survey.pick_sigma_px[picks] / sigma_px
    jacobian = block.jacobian[picks, :, :size] * weight[:, None, None]
    solve = np.linalg.pinv(jacobian.reshape(-1, size))
    point = np.array(state.point)
    if not free:
        point[label, 2] = 0.0
    residual = np.zeros(0)
    for step in range(STEPS + 1):
        moved = replace(adjustment.minimum, state=replace(state, point=point.copy()))
        there = replace(adjustment, minimum=moved).pixels(
            survey.pick_frame[picks], survey.pick_label[picks]
        )
        residual = ((there - survey.pixel_px[picks]) / sigma_px[:, None]).ravel()
        if step < STEPS:
            point[label, :size] -= solve @ residual
    return float(residual @ residual)
