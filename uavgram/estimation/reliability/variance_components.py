"""Variance components by marginal likelihood: error sizes estimated from the residuals.

Every group of observations has a stated standard deviation; a component is a factor of the sigmas
of one of them. The factors that maximise the marginal likelihood of all observations, with the
unknowns integrated out, are the restricted maximum-likelihood estimates of the components (Harville
1977, "Maximum likelihood approaches to variance component estimation and to related problems", sec.
4), to which Helmert's method converges too.

The groups' own normal matrices are added up, N = sum of w N_k: the products whose cost grows with
the number of observations are computed once. The trace of a group's part of the hat matrix is the
trace of w N_k N^-1, the sum of products of the entries of both; only entries of the sparse pattern
of N occur.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import binom, chdtrc

from uavgram.estimation.solver.normal_equations import (
    Block,
    Factor,
    NormalEquations,
    Plan,
    compute_gradient,
)
from uavgram.estimation.solver.sparse.block_matrix import BlockMatrix, Structure, add_weighted
from uavgram.model.arrays import Floats, Ints


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
    """Linear observations; a weight applies to all observations of a group.

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


MIN_FACTOR, MAX_FACTOR = 0.02, 50.0
"""Smallest and largest factor considered."""

MAX_ITERATIONS = 25
"""Largest number of iterations of the search; it usually needs fewer than ten."""

MAX_SLOPE, MIN_RELATIVE_GAIN = 1e-3, 1e-7
"""Derivative, and relative gain of a step, below which the search ends."""

MAX_LOG_STEP, STEP_SHARES = 2.0, 0.5 ** np.arange(12)
"""Largest change of a logarithm in one step, and shares of a step that are tried."""

MIN_CURVATURE = 0.5
"""Smallest second derivative that the search begins with."""


class VarianceComponent(NamedTuple):
    """Variance component: a common factor of the sigmas of some observations.

    Attributes
    ----------
    block, rows
        Name of their group, and their rows in it (None: all).
    weight
        Weight of a prior on the factor about 1, as a number of observations; 0: none.
    smallest
        Lower bound of the factor.
    """

    block: str
    rows: Ints | None = None
    weight: float = 0.0
    smallest: float = MIN_FACTOR


class EstimatedComponents(NamedTuple):
    """Estimated components.

    Attributes
    ----------
    factor
        (C,) factors of the stated sigmas.
    log_likelihood
        Marginal log-likelihood (natural), up to terms that depend on no factor.
    """

    factor: Floats
    log_likelihood: float


class SingleEstimate(NamedTuple):
    """Factor of the stated sigma of a single component; standard deviation of its logarithm."""

    factor: float
    sigma: float


def estimate_single(
    squares: float, redundancy: float, component: VarianceComponent
) -> SingleEstimate:
    """Estimate the factor of one component from its residuals in units of the stated sigmas.

    Parameters
    ----------
    squares
        Sum of the squared residuals.
    redundancy
        Redundancy of the group; it hardly changes with the factor, so no iteration is needed.
    component
        Component with the prior on the factor.
    """
    weight = redundancy + component.weight
    # Closed-form maximum: (v^T v + prior weight) / (redundancy + prior weight).
    factor = max(math.sqrt((squares + component.weight) / weight), component.smallest)
    return SingleEstimate(factor, 1.0 / math.sqrt(2.0 * weight))


def compute_boundary_probability(gain: float, variances: int) -> float:
    """Compute the probability that variances gain this log-likelihood if all of them are zero.

    A variance that is zero is estimated larger in only one of two surveys: twice the gain is
    distributed as the mixture of chi-squares of 0 to n degrees of freedom with binomial weights;
    for one variance half and half (Self and Liang 1987, "Asymptotic properties of maximum
    likelihood estimators and likelihood ratio tests under nonstandard conditions", cases 5, 7).
    """
    if gain <= 0.0:
        return 1.0
    degrees = np.arange(1, variances + 1)
    weight = binom(variances, degrees) / 2.0**variances
    return float(weight @ chdtrc(degrees, 2.0 * gain))


@dataclass(frozen=True, eq=False)
class LinearisedObservations:
    """Observations linearised about a state.

    Attributes
    ----------
    blocks
        Whitened residuals and Jacobians by group.
    size, structure
        Number and structure of the unknowns.
    """

    blocks: Mapping[str, Block]
    size: int
    structure: Structure

    def estimate(
        self, components: Sequence[VarianceComponent], first: Floats
    ) -> EstimatedComponents:
        """Estimate the likeliest factors, starting from values (C,)."""
        lower = np.log([max(one.smallest, MIN_FACTOR) for one in components])
        surprise = _NegativeLogLikelihood(self, components)
        found, here = _minimise(surprise, np.log(first), lower, float(np.log(MAX_FACTOR)))
        return EstimatedComponents(np.exp(found), -0.5 * here.value)

    def log_sigmas(self, components: Sequence[VarianceComponent], factor: Floats) -> Floats:
        """Compute the (C,) standard deviations of the logarithms of the likeliest factors.

        They follow from the curvature: each component takes one more solution.
        """
        surprise = _NegativeLogLikelihood(self, components)
        information = surprise.information(np.log(factor))
        return np.asarray(1.0 / np.sqrt(np.maximum(information, 1e-12)))

    def log_likelihood(self, components: Sequence[VarianceComponent], factor: Floats) -> float:
        """Compute the marginal log-likelihood of given factors (C,)."""
        return -0.5 * _NegativeLogLikelihood(self, components).at(np.log(factor)).value


class _Expansion(NamedTuple):
    """Value of a function, its derivatives (C,), and approximate second derivatives (C,)."""

    value: float
    slope: Floats
    curvature: Floats


class _NegativeLogLikelihood:
    """Minus twice the marginal log-likelihood, as a function of the logarithms of the factors."""

    def __init__(
        self, linear: LinearisedObservations, components: Sequence[VarianceComponent]
    ) -> None:
        own, rest = _split_by_component(linear.blocks, components)
        self._weighted = WeightedProblem(own, rest, linear.size, linear.structure)
        self._size = np.array([block.residual.size for block in own])
        self._prior = np.array([one.weight for one in components])

    def at(self, log_factor: Floats) -> _Expansion:
        """Compute its value and its derivatives by the logarithms.

        v^T v + log det N + 2 sum n log s, with the priors. The derivative by log s of a component
        is twice the difference of its redundancy and its sum of squares; the second derivative is
        about four times either.
        """
        stated = np.exp(-2.0 * log_factor)
        fit = self._weighted.fit(stated)
        value = fit.cost + fit.log_determinant
        value += float(2.0 * self._size @ log_factor + self._prior @ (2.0 * log_factor + stated))
        slope = 2.0 * (self._size - fit.leverage - fit.squares) + 2.0 * self._prior * (1.0 - stated)
        return _Expansion(value, slope, 4.0 * (fit.squares + self._prior * stated))

    def information(self, at: Floats) -> Floats:
        """Compute (C,) half the second derivative by each logarithm, by differencing the first."""
        slope = self.at(at).slope
        ahead = [self.at(at + step).slope[k] for k, step in enumerate(0.02 * np.eye(len(at)))]
        return np.asarray(np.array(ahead) - slope) / (2.0 * 0.02)


def _minimise(
    surprise: _NegativeLogLikelihood, first: Floats, lower: Floats, upper: float
) -> tuple[Floats, _Expansion]:
    """Minimise between bounds by BFGS, halving steps that lead uphill; return place and value.

    Nocedal and Wright 2006, "Numerical optimization", sec. 6.1. (scipy's takes as long to load as
    all the adjustments of an ordinary survey.)
    """
    place = np.clip(first, lower, upper)
    here = surprise.at(place)
    inverse = np.diag(1.0 / np.maximum(here.curvature, MIN_CURVATURE))
    for _ in range(MAX_ITERATIONS):
        # Factors at a bound whose slope points outwards are held there.
        is_held = ((place <= lower) & (here.slope > 0)) | ((place >= upper) & (here.slope < 0))
        slope = np.where(is_held, 0.0, here.slope)
        if np.abs(slope).max() < MAX_SLOPE:
            break
        step = np.where(is_held, 0.0, np.clip(-inverse @ slope, -MAX_LOG_STEP, MAX_LOG_STEP))
        for share in STEP_SHARES:
            there_place = np.clip(place + share * step, lower, upper)
            there = surprise.at(there_place)
            # Armijo condition of sufficient decrease.
            if there.value <= here.value + 1e-4 * slope @ (there_place - place):
                break
        else:
            break
        moved, bent = there_place - place, there.slope - here.slope
        # BFGS update of the inverse Hessian, where the curvature is positive.
        if moved @ bent > 0:
            turn = np.eye(len(moved)) - np.outer(moved, bent) / (moved @ bent)
            inverse = turn @ inverse @ turn.T + np.outer(moved, moved) / (moved @ bent)
        gained = here.value - there.value
        place, here = there_place, there
        if gained < MIN_RELATIVE_GAIN * max(abs(here.value), 1.0):
            break
    return place, here


def _split_by_component(
    blocks: Mapping[str, Block], components: Sequence[VarianceComponent]
) -> tuple[list[Block], list[Block]]:
    """Split the observations into those of each component, and all others."""
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


def _all_rows(components: Iterable[VarianceComponent], block: Block, name: str) -> Ints:
    """Return the rows of a group that belong to any component."""
    every = np.arange(len(block.residual))
    found = [every if one.rows is None else one.rows for one in components if one.block == name]
    return np.concatenate(found)


def _rows(block: Block, rows: Ints) -> Block:
    return Block(block.residual[rows], block.columns[rows], block.jacobian[rows])
