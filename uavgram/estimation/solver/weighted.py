"""Repeated solution of one linear least-squares problem with different weights of some groups.

In a small system the groups' own normal matrices are added up, N = sum of w N_k: the products whose
cost grows with the number of observations are computed once.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from uavgram.estimation.solver.normal_equations import (
    Block,
    DenseStack,
    Factor,
    NormalEquations,
    Plan,
)
from uavgram.estimation.solver.sparse.structure import Structure
from uavgram.model.arrays import Floats


class Fit(NamedTuple):
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


class Weighted:
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
        self._groups, self._rest = list(groups), list(rest)
        self._size, self._structure = size, structure
        self._plan: Plan | DenseStack | None = None
        is_small = NormalEquations([*groups, *rest], size).is_dense
        self._parts = _Parts(groups, rest, size) if is_small else None

    def fit(self, weight: Floats) -> Fit:
        """Solve for the minimum with weights (C,).

        Raises
        ------
        SingularError
            An unknown is not determined.
        """
        if self._parts is not None:
            return self._parts.fit(weight)
        own = [_scaled(*pair) for pair in zip(self._groups, np.sqrt(weight).tolist(), strict=True)]
        normal = NormalEquations([*own, *self._rest], self._size, self._structure, self._plan)
        factor = normal.factor()
        self._plan = normal.plan
        # One Gauss-Newton step: exact, as the problem is linear.
        step = -factor.solve(normal.gradient)
        covariance = factor.covariance()
        return Fit(
            cost=normal.cost + float(normal.gradient @ step),
            log_determinant=factor.log_determinant(),
            squares=np.array([np.sum(_after(block, step) ** 2) for block in own]),
            leverage=np.array([covariance.leverage(block).sum() for block in own]),
        )


class _Parts:
    """Normal matrix, gradient and sum of squares of each group of a small system; `rest` last."""

    def __init__(self, groups: Sequence[Block], rest: Sequence[Block], size: int) -> None:
        parts = [NormalEquations([one], size) for one in groups] + [
            NormalEquations(list(rest), size)
        ]
        self._normal = np.array([part.normal for part in parts])
        self._gradient = np.array([part.gradient for part in parts])
        self._cost = np.array([part.cost for part in parts])

    def fit(self, weight: Floats) -> Fit:
        """Solve as `Weighted.fit`."""
        every = np.append(weight, 1.0)
        normal = np.tensordot(every, self._normal, 1)
        gradient = every @ self._gradient
        factor = Factor(normal, None, normal.diagonal(), 0.0)
        step = -factor.solve(gradient)
        inverse = factor.inverse_on_pattern()
        assert isinstance(inverse, np.ndarray)  # noqa: S101  (as the normal matrix is)
        own = self._normal[:-1]
        # |r + J s|^2 = r^T r + 2 g^T s + s^T N s of each group.
        squares = self._cost[:-1] + 2.0 * self._gradient[:-1] @ step + (own @ step) @ step
        # Leverage: trace of N_k N^-1, times the weight.
        return Fit(
            cost=float(every @ self._cost + gradient @ step),
            log_determinant=factor.log_determinant(),
            squares=weight * squares,
            leverage=weight * np.tensordot(own, inverse, 2),
        )


def _scaled(block: Block, scale: float) -> Block:
    return Block(block.residual * scale, block.columns, block.jacobian * scale)


def _after(block: Block, step: Floats) -> Floats:
    """Compute the residuals after a step of the unknowns, in the linear model."""
    return np.asarray(block.residual + np.einsum("nrk,nk->nr", block.jacobian, step[block.columns]))
