"""How large errors are, learnt from the residuals: variance components by marginal likelihood.

Every group of observations has a stated standard deviation; a component is a factor of the sigmas
of one of them. The factors that make all observations together likeliest, the unknowns integrated
out, are the restricted maximum-likelihood estimates of the components (Harville 1977, "Maximum
likelihood approaches to variance component estimation and to related problems", sec. 4), to which
Helmert's method converges too.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize
from scipy.special import binom, chdtrc

from uavgram.estimation.solver.normal_equations import Block, NormalEquations
from uavgram.estimation.solver.sparse.structure import Structure
from uavgram.model.arrays import Floats, Ints

SMALLEST, LARGEST = 0.02, 50.0
"""Factors that are considered."""

ITERATIONS = 25
"""Of the search; it usually needs fewer than ten."""


class Component(NamedTuple):
    """A variance component: a common factor of the sigmas of some observations.

    Attributes
    ----------
    block, rows
        Name of their group, and which of its rows they are (None: all).
    weight
        Of a prior on the factor about 1, as so many observations; 0: none.
    smallest
        Factor that it never falls below.
    """

    block: str
    rows: Ints | None = None
    weight: float = 0.0
    smallest: float = SMALLEST


class Estimated(NamedTuple):
    """Estimated components.

    Attributes
    ----------
    factor, sigma
        (C,) of the stated sigmas; standard deviation of its logarithm (from the curvature).
    log_likelihood
        Marginal, natural logarithm, up to what depends on no factor.
    """

    factor: Floats
    sigma: Floats
    log_likelihood: float


def of_one_group(squares: float, redundancy: float, component: Component) -> Estimated:
    """The factor of one component, from its residuals in units of the stated sigmas.

    Parameters
    ----------
    squares
        Sum of their squares.
    redundancy
        Of the group: the factor changes it so little that nothing else is needed.
    component
        The prior on the factor.
    """
    weight = redundancy + component.weight
    factor = max(np.sqrt((squares + component.weight) / weight), component.smallest)
    return Estimated(np.array([factor]), np.array([1.0 / np.sqrt(2.0 * weight)]), float("nan"))


def probability_at_boundary(gain: float, variances: int) -> float:
    """Probability that so many variances bring so much log-likelihood where all are zero.

    A variance that is zero is found larger in one of two surveys only: twice the gain is
    distributed as the mixture of chi-squares of 0 to n degrees of freedom with binomial weights;
    of one variance half and half (Self and Liang 1987, "Asymptotic properties of maximum
    likelihood estimators and likelihood ratio tests under nonstandard conditions", cases 5, 7).
    """
    if gain <= 0.0:
        return 1.0
    degrees = np.arange(1, variances + 1)
    weight = binom(variances, degrees) / 2.0**variances
    return float(weight @ chdtrc(degrees, 2.0 * gain))


@dataclass(frozen=True, eq=False)
class Linearised:
    """Observations about a state, in the linear model.

    Attributes
    ----------
    blocks
        Whitened residuals and Jacobians by group.
    size, structure
        Number of unknowns, and what they are.
    """

    blocks: Mapping[str, Block]
    size: int
    structure: Structure

    def estimate(self, components: Sequence[Component], first: Floats) -> Estimated:
        """The likeliest factors, from first values (C,)."""
        lower = np.log([max(one.smallest, SMALLEST) for one in components])
        bounds = list(zip(lower, np.full(len(lower), np.log(LARGEST)), strict=True))
        found = minimize(
            self._surprise,
            np.clip(np.log(first), lower, np.log(LARGEST)),
            args=(components,),
            method="L-BFGS-B",
            jac=True,
            bounds=bounds,
            options={"maxiter": ITERATIONS, "ftol": 1e-7, "gtol": 1e-3},
        )
        information = np.array(
            [self._information(found.x, components, k) for k in range(len(first))]
        )
        sigma = 1.0 / np.sqrt(np.maximum(information, 1e-12))
        return Estimated(np.exp(found.x), sigma, -0.5 * float(found.fun))

    def log_likelihood(self, components: Sequence[Component], factor: Floats) -> float:
        """Marginal log-likelihood of given factors (C,)."""
        return -0.5 * self._surprise(np.log(factor), components)[0]

    def _surprise(
        self, log_factor: Floats, components: Sequence[Component]
    ) -> tuple[float, Floats]:
        """Minus twice the marginal log-likelihood, and its derivatives by the logarithms.

        v^T v + log det N + 2 sum n log s, with the priors; the derivative by log s of a component
        is twice its redundancy less its sum of squares.
        """
        own, rest = _scaled(self.blocks, components, np.exp(log_factor))
        normal = NormalEquations([*own, *rest], self.size, self.structure)
        factor = normal.factor()
        step = -factor.solve(normal.gradient)
        covariance = factor.covariance()
        size = np.array([block.residual.size for block in own])
        left = np.array([np.sum(_after(block, step) ** 2) for block in own])
        leverage = np.array([covariance.leverage(block).sum() for block in own])
        weight = np.array([one.weight for one in components])
        stated = np.exp(-2.0 * log_factor)
        value = normal.cost + float(normal.gradient @ step) + factor.log_determinant()
        value += float(2.0 * size @ log_factor + weight @ (2.0 * log_factor + stated))
        return value, 2.0 * (size - leverage - left) + 2.0 * weight * (1.0 - stated)

    def _information(self, at: Floats, components: Sequence[Component], k: int) -> float:
        """Half the second derivative of `_surprise` by one logarithm, by differencing the first."""
        step = np.zeros(len(at))
        step[k] = 0.02
        above, below = (self._surprise(at + s * step, components)[1][k] for s in (1.0, -1.0))
        return (float(above) - float(below)) / (4.0 * 0.02)


def _scaled(
    blocks: Mapping[str, Block], components: Sequence[Component], factor: Floats
) -> tuple[list[Block], list[Block]]:
    """The components' observations with their sigmas times the factors, and all others."""
    own = []
    rest = dict(blocks)
    for one, scale in zip(components, factor.tolist(), strict=True):
        block = blocks[one.block]
        rows = np.arange(len(block.residual)) if one.rows is None else one.rows
        own.append(_rows(block, rows, 1.0 / scale))
        others = np.setdiff1d(
            np.arange(len(block.residual)), _all_rows(components, block, one.block)
        )
        rest[one.block] = _rows(block, others, 1.0)
    return own, [block for block in rest.values() if len(block.residual)]


def _all_rows(components: Iterable[Component], block: Block, name: str) -> Ints:
    """Rows of a group that belong to any component."""
    every = np.arange(len(block.residual))
    found = [every if one.rows is None else one.rows for one in components if one.block == name]
    return np.concatenate(found)


def _rows(block: Block, rows: Ints, weight: float) -> Block:
    return Block(block.residual[rows] * weight, block.columns[rows], block.jacobian[rows] * weight)


def _after(block: Block, step: Floats) -> Floats:
    """Residuals after a step of the unknowns, in the linear model."""
    return np.asarray(block.residual + np.einsum("nrk,nk->nr", block.jacobian, step[block.columns]))
