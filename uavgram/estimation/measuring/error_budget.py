"""Error budget: how much each group of observations contributes to a measurement's variance.

The estimates are linear in the observations, to first order: with S the covariance of the
unknowns, A the whitened Jacobian and g the gradient of a measured value, a whitened observation
moves the value by A S g. Its variance is the sum of the squares over all observations, for
g' S A' A S g = g' S g (law of propagation, JCGM 100:2008, 5.1.2).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from uavgram.estimation.measuring.kinds import BELOW
from uavgram.estimation.measuring.propagation import MeasuredValues
from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.observations.kinds import kind_of
from uavgram.model.arrays import Floats
from uavgram.model.result.error_budget import ErrorBudget

OTHER = "friction and times"
"""Source of what no observation of the survey contributes."""

LEAST = 1e-12
"""Share of a variance that is rounding: the conditions that fix a free gauge contribute none."""

ENTRIES_AT_ONCE = 2_000_000
"""Bound of the arrays that are held at a time."""


def error_budget(blocks: Mapping[str, Block], measured: MeasuredValues) -> dict[str, Floats]:
    """Variances that the groups of observations contribute.

    Parameters
    ----------
    blocks
        Whitened Jacobians of all groups of the adjustment, priors included.
    measured
        The values.

    Returns
    -------
    dict
        Of each group (M,) variances in the squared unit of each value; with ``other`` (friction,
        times) they add up to the value's variance. ``roughness`` holds that of the ground below
        points off it as well. NaN where there is no value.
    """
    parts = {name: _contribution(block, measured.solved) for name, block in blocks.items()}
    first_order = (measured.gradient * measured.solved).sum(axis=0)
    below = np.array([_below(row.others) for row in measured.rows])
    if below.any():
        parts["roughness"] = parts.get("roughness", 0.0) + below
    rest = np.diag(measured.covariance) - first_order - below
    parts["other"] = np.maximum(rest, 0.0)
    computed = np.isfinite(np.diag(measured.covariance))
    return {name: np.where(computed, variance, np.nan) for name, variance in parts.items()}


def _below(others: Mapping[str, float]) -> float:
    return sum(effect**2 for source, effect in others.items() if source.startswith(BELOW))


def _contribution(block: Block, solved: Floats) -> Floats:
    """(M,) sum over the observations of the squares of what each moves the values by."""
    count = solved.shape[1]
    n, _, width = block.jacobian.shape
    total = np.zeros(count)
    step = max(1, ENTRIES_AT_ONCE // max(1, count * width))
    for first in range(0, n, step):
        rows = slice(first, first + step)
        response = block.times(rows, solved)
        total += np.einsum("nrm,nrm->m", response, response)
    return total


def shares(variances: Mapping[str, Floats]) -> ErrorBudget:
    """Sum the groups under their names for people, as parts of the whole."""
    total = np.sum(list(variances.values()), axis=0)
    by_source: dict[str, Floats] = {}
    for group, variance in variances.items():
        source = OTHER if group == "other" else kind_of(group).source
        by_source[source] = by_source.get(source, np.zeros_like(variance)) + variance
    felt = {name: v for name, v in by_source.items() if (np.nan_to_num(v) > LEAST * total).any()}
    share = np.stack(list(felt.values()), axis=1) if felt else np.zeros((len(total), 0))
    with np.errstate(invalid="ignore"):
        return ErrorBudget(source=tuple(felt), share=share / share.sum(axis=1, keepdims=True))
