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
from scipy.special import binom, chdtrc

from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.solver.sparse.structure import Structure
from uavgram.estimation.solver.weighted import Weighted
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
        from scipy.optimize import minimize  # noqa: PLC0415 - slow to load, and rarely needed

        lower = np.log([max(one.smallest, SMALLEST) for one in components])
        bounds = list(zip(lower, np.full(len(lower), np.log(LARGEST)), strict=True))
        surprise = _Surprise(self, components)
        found = minimize(
            surprise.at,
            np.clip(np.log(first), lower, np.log(LARGEST)),
            method="L-BFGS-B",
            jac=True,
            bounds=bounds,
            options={"maxiter": ITERATIONS, "ftol": 1e-7, "gtol": 1e-3},
        )
        information = np.array([surprise.information(found.x, k) for k in range(len(first))])
        sigma = 1.0 / np.sqrt(np.maximum(information, 1e-12))
        return Estimated(np.exp(found.x), sigma, -0.5 * float(found.fun))

    def log_likelihood(self, components: Sequence[Component], factor: Floats) -> float:
        """Marginal log-likelihood of given factors (C,)."""
        return -0.5 * _Surprise(self, components).at(np.log(factor))[0]


class _Surprise:
    """Minus twice the marginal log-likelihood, as a function of the logarithms of the factors."""

    def __init__(self, linear: Linearised, components: Sequence[Component]) -> None:
        own, rest = _parted(linear.blocks, components)
        self._weighted = Weighted(own, rest, linear.size, linear.structure)
        self._size = np.array([block.residual.size for block in own])
        self._prior = np.array([one.weight for one in components])

    def at(self, log_factor: Floats) -> tuple[float, Floats]:
        """Its value, and its derivatives by the logarithms.

        v^T v + log det N + 2 sum n log s, with the priors; the derivative by log s of a component
        is twice its redundancy less its sum of squares.
        """
        stated = np.exp(-2.0 * log_factor)
        fit = self._weighted.fit(stated)
        value = fit.cost + fit.log_determinant
        value += float(2.0 * self._size @ log_factor + self._prior @ (2.0 * log_factor + stated))
        slope = 2.0 * (self._size - fit.leverage - fit.squares) + 2.0 * self._prior * (1.0 - stated)
        return value, slope

    def information(self, at: Floats, k: int) -> float:
        """Half the second derivative by one logarithm, by differencing the first."""
        step = np.zeros(len(at))
        step[k] = 0.02
        above, below = (self.at(at + s * step)[1][k] for s in (1.0, -1.0))
        return (float(above) - float(below)) / (4.0 * 0.02)


def _parted(
    blocks: Mapping[str, Block], components: Sequence[Component]
) -> tuple[list[Block], list[Block]]:
    """The components' observations, and all others."""
    own = [
        blocks[one.block] if one.rows is None else _rows(blocks[one.block], one.rows)
        for one in components
    ]
    rest = dict(blocks)
    for name in {one.block for one in components}:
        every = np.arange(len(blocks[name].residual))
        others = np.setdiff1d(every, _all_rows(components, blocks[name], name))
        rest[name] = _rows(blocks[name], others)
    return own, [block for block in rest.values() if len(block.residual)]


def _all_rows(components: Iterable[Component], block: Block, name: str) -> Ints:
    """Rows of a group that belong to any component."""
    every = np.arange(len(block.residual))
    found = [every if one.rows is None else one.rows for one in components if one.block == name]
    return np.concatenate(found)


def _rows(block: Block, rows: Ints) -> Block:
    return Block(block.residual[rows], block.columns[rows], block.jacobian[rows])
