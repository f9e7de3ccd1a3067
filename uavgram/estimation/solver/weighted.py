"""Repeated solution of one linear least-squares problem with different weights of some groups.

The groups' own normal matrices are added up, N = sum of w N_k: the products whose cost grows with
the number of observations are computed once. The trace of a group's part of the hat matrix is that
of w N_k N^-1: the sum of the products of their entries, all of which are on the pattern.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from uavgram.estimation.solver.normal_equations import (
    Block,
    Factor,
    NormalEquations,
    Plan,
    compute_gradient,
)
from uavgram.estimation.solver.sparse.block_matrix import BlockMatrix, add_weighted
from uavgram.estimation.solver.sparse.structure import Structure
from uavgram.model.arrays import Floats


class WeightedFit(NamedTuple):
    """Minimum of a weighted problem.

    Attributes
    ----------
    cost
        Weighted sum of squares there.
    log_determinant
        Natural logarithm of the determinant of the normal matrix.
    squares, leverage
        (C,) by group: the weighted sum of squares there; the trace of its part of the hat matrix.
    """

    cost: float
    log_determinant: float
    squares: Floats
    leverage: Floats


class WeightedProblem:
    """Linear observations, some groups of which have weights.

    Parameters
    ----------
    groups
        Groups with weights.
    rest
        All others.
    size, structure
        Number and structure of the unknowns.
    """

    def __init__(
        self, groups: Sequence[Block], rest: Sequence[Block], size: int, structure: Structure
    ) -> None:
        self._groups = groups
        each = [*([one] for one in groups), list(rest)]
        self._gradient = np.array([compute_gradient(blocks, size) for blocks in each])
        self._rest_cost = NormalEquations(list(rest), size).cost
        every = [*groups, *rest]
        self._plan: Plan | None = None
        self._normal: list[Floats] | list[BlockMatrix]
        if NormalEquations(every, size).is_dense:
            dense = [NormalEquations(blocks, size).normal for blocks in each]
            self._normal = [one for one in dense if isinstance(one, np.ndarray)]
        else:
            self._plan = Plan.of([one.columns for one in every], structure)
            numbers = [*range(len(groups)), *[len(groups)] * len(rest)]
            self._normal = [
                self._plan.assembly.normal(
                    [
                        one.jacobian if number == group else None
                        for number, one in zip(numbers, every, strict=True)
                    ]
                )
                for group in range(len(each))
            ]

    def fit(self, weight: Floats) -> WeightedFit:
        """Solve for the minimum with weights (C,).

        Raises
        ------
        SingularError
            An unknown is not determined.
        """
        every = np.append(weight, 1.0)
        gradient = every @ self._gradient
        normal = _add(every, self._normal)
        factor = Factor(normal, self._plan, normal.diagonal(), 0.0)
        # One Gauss-Newton step: exact, as the problem is linear.
        step = -factor.solve(gradient)
        inverse = factor.inverse_on_pattern()
        leverage = [_inner(one, inverse) for one in self._normal[:-1]]
        cost = [float(np.vdot(one.residual, one.residual)) for one in self._groups]
        squares = [np.sum(_compute_residuals(one, step) ** 2) for one in self._groups]
        return WeightedFit(
            cost=float(weight @ cost + self._rest_cost + gradient @ step),
            log_determinant=factor.log_determinant(),
            squares=weight * squares,
            leverage=weight * leverage,
        )


def _add(weight: Floats, parts: Sequence[Floats] | Sequence[BlockMatrix]) -> Floats | BlockMatrix:
    """Add matrices, each times its weight."""
    blocks = [one for one in parts if isinstance(one, BlockMatrix)]
    if blocks:
        return add_weighted(weight, blocks)
    return np.asarray(sum(w * one for w, one in zip(weight, parts, strict=True)))


def _inner(one: Floats | BlockMatrix, other: Floats | BlockMatrix) -> float:
    """Sum of the products of all entries."""
    if isinstance(one, BlockMatrix) and isinstance(other, BlockMatrix):
        return one.inner(other)
    return float(np.vdot(np.asarray(one), np.asarray(other)))


def _compute_residuals(block: Block, step: Floats) -> Floats:
    """Compute the residuals after a step of the unknowns, in the linear model."""
    return np.asarray(block.residual + np.einsum("nrk,nk->nr", block.jacobian, step[block.columns]))
