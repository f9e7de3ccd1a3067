"""Fit the picks of one label at a free height, or on the ground."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.arrays import Floats, Ints

STEPS = 4
"""Towards the place that fits best; each takes the error down by a hundred times and more."""


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
