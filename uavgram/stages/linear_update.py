"""First-order update of an adjusted survey after small changes of its readings."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.unknowns import State, advance_state
from uavgram.model.arrays import Floats


class LinearUpdate(NamedTuple):
    """Survey after one step of the linear model.

    Attributes
    ----------
    state
        State of all unknowns.
    residual_px
        (P, 2) of the picks: projection minus the new pick.
    world_m
        (K, 3) points.
    """

    state: State
    residual_px: Floats
    world_m: Floats


def update_linearly(adjustment: Adjustment, pixel_px: Floats, length_m: Floats) -> LinearUpdate:
    """Update an adjustment to other readings, by its factorised normal equations.

    Parameters
    ----------
    adjustment
        The adjusted survey.
    pixel_px
        (P, 2) its picks after the change.
    length_m
        (n,) its participating lengths after the change.
    """
    survey, blocks, problem = adjustment.survey, adjustment.minimum.blocks, adjustment.problem
    errors = {"pixels": (pixel_px - survey.pixel_px) / survey.pick_sigma_px[:, None]}
    if len(problem.line_index):
        used = problem.line_index
        change = (length_m - survey.length_m[used]) / survey.length_sigma_m[used]
        errors["lengths"] = change[:, None]
    size = problem.layout.size
    # Step = N^-1 J^T e, with the changes e of the whitened readings.
    right = np.zeros(size)
    for name, error in errors.items():
        moved = np.einsum("nr,nrk->nk", error, blocks[name].jacobian)
        right += np.bincount(blocks[name].columns.ravel(), moved.ravel(), size)
    step = adjustment.minimum.factor.solve(right)
    state = advance_state(problem.layout, adjustment.state, step)
    pixels = blocks["pixels"]
    follow = np.einsum("nrk,nk->nr", pixels.jacobian, step[pixels.columns])
    residual = pixels.residual + follow - errors["pixels"]
    world, _, _ = problem.world_points(state, np.arange(problem.layout.points))
    return LinearUpdate(state, residual * survey.pick_sigma_px[:, None], world)
