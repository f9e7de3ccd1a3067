"""Redundancy, standardised residuals, minimal detectable bias and variance factors.

After Baarda 1968, "A testing procedure for use in geodetic networks". All inputs are whitened:
residuals and Jacobian rows in units of the observation's own standard deviation.

A robust estimate follows the majority (Hampel 1971, "A general qualitative definition of
robustness"): with about half of the readings wrong, it may follow the wrong ones.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc, ndtri

from uavgram.estimation.solver.normal_equations import MAX_RIGHT_SIDES, Block, Covariance, Factor
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.observations.kinds import get_kind
from uavgram.model.arrays import Floats

TEST_POWER = 0.80
"""Probability with which a bias of the minimal detectable size is found."""

MIN_REDUNDANCY = 1e-6
"""Redundancy number below which an observation is not checked by any other."""


FAMILY_SIZE = 10
"""Number of tests of one kind that each have the stated significance; more tests share it."""


class Reliability(NamedTuple):
    """Reliability of each whitened observation of one group; all (n, r).

    Attributes
    ----------
    redundancy
        Number in [0, 1]: share of an error in the observation that shows in its residual.
    w
        Residual over its own standard deviation; 0 where the observation is not checked.
    """

    redundancy: Floats
    w: Floats


def compute_reliability(block: Block, covariance: Covariance) -> Reliability:
    """Compute redundancy numbers and standardised residuals of one group of observations."""
    redundancy = np.clip(1.0 - covariance.leverage(block), 0.0, 1.0)
    checked = redundancy > MIN_REDUNDANCY
    w = np.where(checked, block.residual / np.sqrt(np.where(checked, redundancy, 1.0)), 0.0)
    return Reliability(redundancy, w)


def compute_critical_value(significance: float) -> float:
    """Return the two-sided critical value of a standardised residual."""
    return float(ndtri(1.0 - significance / 2.0))


def compute_level(significance: float, tests: int) -> float:
    """Return the significance of each test in a family of tests.

    Up to `FAMILY_SIZE` tests have the stated level; more tests share the level of that number
    (Bonferroni), so that in a survey without errors hardly any of hundreds of picks is suspected by
    chance.
    """
    return significance * min(1.0, FAMILY_SIZE / max(tests, 1))


def compute_noncentrality(significance: float) -> float:
    """Return the mean of |w| at which a bias is found with probability ``POWER``; 4.13 at 0.001."""
    return compute_critical_value(significance) + float(ndtri(TEST_POWER))


def compute_minimal_detectable_bias(
    redundancy: Floats, sigma: Floats, significance: float
) -> Floats:
    """Compute the smallest error found with probability ``POWER``, in units of `sigma`, or NaN.

    Baarda 1968: sigma * delta0 / sqrt(r), delta0 = z(1 - alpha / 2) + z(power).

    Parameters
    ----------
    redundancy, sigma
        (...) redundancy numbers and standard deviations of the observations.
    significance
        Significance of the test.
    """
    checked = redundancy > MIN_REDUNDANCY
    root = np.sqrt(np.where(checked, redundancy, np.nan))
    return np.asarray(sigma * compute_noncentrality(significance) / root)


class GroupFit(NamedTuple):
    """Fit of one group of observations as a whole.

    `redundancy` is the group's share of the degrees of freedom, `variance_factor` its sum of
    squares over that share (NaN without redundancy), `probability` that of a factor at least as
    large by chance.
    """

    redundancy: float
    variance_factor: float
    probability: float


MAX_EXACT_SIZE = 100
"""Number of observations up to which a group's full cofactor matrix is computed."""

MIN_SIGN_COUNT = 4000
"""Smallest number of random signs drawn for a larger group: at worst 2 % error of its degrees of
freedom."""


def compute_group_fit(block: Block, factor: Factor, covariance: Covariance) -> GroupFit:
    """Compute the variance factor of a group and its chi-square test.

    The residuals of one group have the cofactor matrix Q = I - A S A^T, which is no projector.
    Their sum of squares is approximated by a chi-square with Satterthwaite's degrees of freedom
    tr(Q)^2 / tr(Q^2) and scale tr(Q^2) / tr(Q) (Satterthwaite 1946, eq. 9); for one observation
    that is its w-test.

    Parameters
    ----------
    block
        Whitened residuals and Jacobians of the group.
    factor, covariance
        Factor and covariance of the adjustment.
    """
    squares = float(np.sum(block.residual**2))
    if block.residual.size <= MAX_EXACT_SIZE:
        cofactor = _cofactor(block, covariance)
        trace, trace_of_square = float(np.trace(cofactor)), float(np.sum(cofactor**2))
    else:
        trace = float(compute_reliability(block, covariance).redundancy.sum())
        trace_of_square = _trace_of_square(block, factor)
    if trace <= MIN_REDUNDANCY:
        return GroupFit(max(trace, 0.0), np.nan, 1.0)
    scale = trace_of_square / trace
    return GroupFit(trace, squares / trace, compute_upper_tail(squares / scale, trace / scale))


def _trace_of_square(block: Block, factor: Factor) -> float:
    """Estimate tr(Q^2) from random signs z: the mean of |Q z|^2 (Hutchinson 1990, eq. 2.6).

    Exact where Q is diagonal; else its relative variance is at most 2 / (signs drawn).
    """
    n, r, _ = block.jacobian.shape
    rng = np.random.default_rng(0)  # fixed seed: reproducible
    total, draws = 0.0, -(-MIN_SIGN_COUNT // (n * r))
    for first in range(0, draws, MAX_RIGHT_SIDES):
        some = min(MAX_RIGHT_SIDES, draws - first)
        signs = np.moveaxis(rng.choice([-1.0, 1.0], (some, n, r)), 0, 2)
        weights = np.swapaxes(block.jacobian, 1, 2) @ signs
        place = block.columns[:, :, None] * some + np.arange(some)
        right: Floats = np.zeros(factor.size * some)
        right += np.bincount(place.ravel(), weights.ravel(), minlength=len(right))
        seen = factor.solve(right.reshape(factor.size, some))[block.columns]
        # Q z = z - A S A^T z
        total += float(np.sum((signs - block.jacobian @ seen) ** 2))
    return float(total / draws)


def _cofactor(block: Block, covariance: Covariance) -> Floats:
    """Compute I - A S A^T of all the block's rows."""
    n, r, k = block.jacobian.shape
    columns = np.repeat(block.columns, r, axis=0)
    return np.asarray(np.eye(n * r) - covariance.joint(columns, block.jacobian.reshape(n * r, k)))


def compute_upper_tail(squares: float, degrees: float) -> float:
    """Return the probability that chi-square with `degrees` exceeds `squares`; 1 without any."""
    return float(chdtrc(degrees, squares)) if degrees > MIN_REDUNDANCY else 1.0


def compute_redundancy(adjustment: Adjustment, name: str) -> float:
    """Compute the share of the degrees of freedom of a group of observations."""
    block = adjustment.minimum.blocks[name]
    return block.residual.size - float(adjustment.covariance.leverage(block).sum())


class CoreFit(NamedTuple):
    """Fit of picks, lengths, ground and camera together, without telemetry.

    Attributes
    ----------
    squares, degrees
        Weighted sum of squares, and redundancy, of these groups.
    probability
        Probability of so large a sum by chance. The degrees of freedom of a part of the
        observations are spread over more directions, none of larger variance: a chi-square with as
        many is conservative.
    """

    squares: float
    degrees: float
    probability: float


def compute_core_fit(adjustment: Adjustment) -> CoreFit:
    """Compute the sum of squares of the groups that show whether the model holds.

    These are the groups of picks and ground: priors of the telemetry are meant to be generous, and
    ties are independent of the ground.
    """
    blocks = adjustment.minimum.blocks
    core = [name for name in blocks if get_kind(name).is_core]
    squares = sum(float(np.sum(blocks[name].residual ** 2)) for name in core)
    degrees = sum(compute_redundancy(adjustment, name) for name in core)
    return CoreFit(squares, degrees, compute_upper_tail(squares, degrees))


GROSS_SIGMAS = 6.0
"""Standardised misfit, in units of the noise of its kind, beyond which an observation is a gross
error."""

MAX_GROSS_SHARE = 0.4
"""Largest share of a kind's observations, or of the frames, that may be gross errors: with more,
the kind would be less precise than stated, or the right ones could not be identified."""


def limit_gross_errors(count: int) -> int:
    """Return the largest number of gross errors among `count` observations, at least one."""
    return max(1, int(MAX_GROSS_SHARE * count))
