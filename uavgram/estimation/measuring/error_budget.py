"""Error budget of measured values, and their shifts by causes that no observation shows.

The estimates are linear in the observations, to first order: with S the covariance of the unknowns,
A the whitened Jacobian and g the gradient of a measured value, a whitened observation moves the
value by A S g. Its variance is the sum of the squares over all observations, for g' S A' A S g = g'
S g (law of propagation, JCGM 100:2008, 5.1.2).

A point off the surface that was assumed for it, and a tape that is wrong beyond its prior, move a
value through the whole adjustment: with a change e of the whitened residuals, the unknowns move by
-S J^T e (as in pipeline/pick/live_survey.py), the value by -(S g)^T J^T e. S g is known for every
value.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from uavgram.estimation.measuring.propagation import BELOW_PREFIX, MeasuredValues
from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.observations.kinds import KINDS, get_kind
from uavgram.estimation.survey.observations.observation import ErrorSource
from uavgram.model.arrays import Floats, Ints
from uavgram.model.result.reliability import ErrorBudget

FRICTION_AND_TIMES = ErrorSource(
    "friction and times",
    "the stated friction, and the times of the exposures",
    "A drag test on the spot, or exposure times that are known better, would help there.",
)
"""Source of the contributions of no observation of the survey."""

OTHER_EXPLANATIONS = ErrorSource(
    "other explanations",
    "other poses or mistakes that explain the observations as well",
    "The reading that a message asks for would decide between them.",
)
"""Source of the difference between a value and its values under other explanations."""

_SOURCE_OF_PART = {"other": FRICTION_AND_TIMES, "explanations": OTHER_EXPLANATIONS}
"""Sources of the parts of a variance that no group of observations contributes."""

SOURCES = {
    one.name: one for one in (*(kind.source for kind in KINDS.values()), *_SOURCE_OF_PART.values())
}
"""Sources by name."""

MIN_SHARE = 1e-12
"""Share of a variance that is rounding error: the conditions that fix a free gauge contribute
nothing."""

ENTRIES_AT_ONCE = 2_000_000
"""Largest number of array entries in memory at a time."""


def compute_error_budget(
    blocks: Mapping[str, Block], measured: MeasuredValues, sigma: Floats
) -> dict[str, Floats]:
    """Compute the variances that the groups of observations contribute.

    Parameters
    ----------
    blocks
        Whitened Jacobians of all groups of the adjustment, priors included.
    measured
        Measured values.
    sigma
        (M,) their stated sigmas, which include other explanations of the observations.

    Returns
    -------
    dict
        For each group (M,) variances in the squared unit of each value; with ``other`` (friction,
        times) and ``explanations`` they add up to the stated variance. ``roughness`` includes that
        of the ground below points off it. NaN if there is no value.
    """
    parts = {name: _contribution(block, measured.solved) for name, block in blocks.items()}
    first_order = (measured.gradient * measured.solved).sum(axis=0)
    below = np.array([_below(row.others) for row in measured.rows])
    if below.any():
        parts["roughness"] = parts.get("roughness", 0.0) + below
    rest = np.diag(measured.covariance) - first_order - below
    parts["other"] = np.maximum(rest, 0.0)
    parts["explanations"] = np.maximum(sigma**2 - np.diag(measured.covariance), 0.0)
    computed = np.isfinite(np.diag(measured.covariance))
    return {name: np.where(computed, variance, np.nan) for name, variance in parts.items()}


def _below(others: Mapping[str, float]) -> float:
    return sum(effect**2 for source, effect in others.items() if source.startswith(BELOW_PREFIX))


def _contribution(block: Block, solved: Floats) -> Floats:
    """Compute (M,) sums over the observations of the squared changes A S g of the values."""
    count = solved.shape[1]
    n, _, width = block.jacobian.shape
    total = np.zeros(count)
    step = max(1, ENTRIES_AT_ONCE // max(1, count * width))
    for first in range(0, n, step):
        rows = slice(first, first + step)
        response = block.times(rows, solved)
        total += np.einsum("nrm,nrm->m", response, response)
    return total


def compute_shares(variances: Mapping[str, Floats]) -> ErrorBudget:
    """Sum the groups by their source names, as shares of the total variance."""
    total = np.sum(list(variances.values()), axis=0)
    by_source: dict[str, Floats] = {}
    for group, variance in variances.items():
        source = _SOURCE_OF_PART.get(group) or get_kind(group).source
        by_source[source.name] = by_source.get(source.name, np.zeros_like(variance)) + variance
    felt = {
        name: v for name, v in by_source.items() if (np.nan_to_num(v) > MIN_SHARE * total).any()
    }
    share = np.stack(list(felt.values()), axis=1) if felt else np.zeros((len(total), 0))
    with np.errstate(invalid="ignore"):
        return ErrorBudget(source=tuple(felt), share=share / share.sum(axis=1, keepdims=True))


ASSUMED_RELIEF_M = 0.10
ASSUMED_TAPE_ERROR = 0.01


class Shifts(NamedTuple):
    """Changes of M values, in the unit of each; NaN where they are meaningless.

    Attributes
    ----------
    relief
        (M,) by points that are `ASSUMED_RELIEF_M` above or below the surface, each on the side of
        its largest effect: the sum of the sizes.
    tape
        (M,) by readings that are all `ASSUMED_TAPE_ERROR` longer.
    """

    relief: Floats
    tape: Floats


def compute_shifts(adjustment: Adjustment, measured: MeasuredValues) -> Shifts:
    """Compute the effects of relief and of a wrong tape on each measured value."""
    none = np.array([row.gradient is None for row in measured.rows], dtype=bool)
    place = adjustment.survey.row_of_label
    points = [sorted({place[p] for p in row.request.points if p in place}) for row in measured.rows]
    touched = np.array(sorted({k for own in points for k in own}), dtype=np.int64)
    moved = np.abs(compute_height_derivatives(adjustment, measured, touched))
    own = [np.searchsorted(touched, np.array(some, dtype=np.int64)) for some in points]
    relief = ASSUMED_RELIEF_M * np.array([moved[rows, m].sum() for m, rows in enumerate(own)])
    tape = np.full(len(none), np.nan)
    if (line := adjustment.problem.line_index).size:
        survey, block = adjustment.survey, adjustment.minimum.blocks["lengths"]
        longer = ASSUMED_TAPE_ERROR * survey.length_m[line] / survey.length_sigma_m[line]
        tape = np.einsum(
            "n,nk,nkm->m", longer, block.jacobian[:, 0], measured.solved[block.columns]
        )
    return Shifts(np.where(none, np.nan, relief), np.where(none, np.nan, tape))


def compute_height_derivatives(
    adjustment: Adjustment, measured: MeasuredValues, label: Ints
) -> Floats:
    """Compute (n, M) derivatives of each value by the heights of points above their surface.

    Picks and readings do not change; only the assumed height of the point does.

    Parameters
    ----------
    adjustment, measured
        Adjusted survey, and M values measured in it.
    label
        (n,) labels of the points.
    """
    names, size = adjustment.survey.label, adjustment.problem.layout.size
    row_of = np.full(len(names), -1)
    row_of[label] = np.arange(len(label))
    place = {names[k]: row for row, k in enumerate(label.tolist())}
    total = np.zeros((len(label), len(measured.rows)))
    # Direct effect: derivative of the value by the heights of its points.
    for m, row in enumerate(measured.rows):
        if row.gradient is not None:  # the ground below rises with the surface
            up = row.gradient[:, 2] + (0.0 if row.by_feet is None else row.by_feet[:, 2])
            for name, by_up in zip(row.request.points, up.tolist(), strict=True):
                if name in place:
                    total[place[name], m] += by_up
    # Effect through the adjustment: -(S g)^T J^T e, e the derivative of the residuals.
    for name, observation in adjustment.problem.observations.items():
        block = adjustment.minimum.blocks[name]
        for point, by_height in observation.heights(adjustment.minimum):
            own = np.flatnonzero(row_of[point] >= 0)
            force = np.einsum("nr,nrk->nk", by_height[own], block.jacobian[own])
            at = (np.repeat(row_of[point[own]], force.shape[1]), block.columns[own].ravel())
            total -= csr_array((force.ravel(), at), shape=(len(label), size)) @ measured.solved
    return total
