"""Redundancy, test statistics, minimal detectable bias and variance factors.

After Baarda 1968, "A testing procedure for use in geodetic networks"; with priors as observations
as in Foerstner & Wrobel 2016, "Photogrammetric computer vision", ch. 4.6. All inputs are whitened:
residuals and Jacobian rows in units of the observation's own standard deviation.

A robust estimate follows the majority (Hampel 1971, "A general qualitative definition of
robustness"): with about half of the readings wrong, it may follow the wrong ones.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc, ndtri

from uavgram.estimation.solver.normal_equations import MAX_RIGHT_SIDES, Block, Covariance, Factor
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.observations.kinds import READINGS, get_kind
from uavgram.model.arrays import Bools, Floats, Ints

TEST_POWER = 0.80
"""Probability with which a bias of the minimal detectable size is found."""

MIN_REDUNDANCY = 1e-6
"""Redundancy number below which an observation is not checked by any other."""

MIN_SUSPECT_REDUNDANCY = 0.02
"""Redundancy number of a reading below which it is not suspected: its error would have to be many
times its sigma, and any small error of the model looks like that through so small a redundancy."""

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


@dataclass(frozen=True, eq=False)
class TestedGroup:
    """Group of n observations of r correlated numbers each, with possible errors along a axes.

    Attributes
    ----------
    kind
        Name of the group in the likelihood.
    block
        Whitened residuals and Jacobians.
    direction
        (n, r, a) unit vectors in the space of the whitened residuals: the direction of an error
        along each axis. Identity if the numbers are independent.
    scale
        (n, a) standard deviation of each axis given the others, in SI units or pixels; NaN where
        the number is known exactly.
    redundancy
        (n, a) in [0, 1]: share of an error along that axis that shows in the residuals.
    w
        (n, a) standardised test statistic; 0 where the axis is not checked.
    tests
        Number of axes of this group and of those that are tested along with it.
    thing
        (n,) numbers: rows of one observation share one; None: each row is one.
    """

    kind: str
    block: Block
    direction: Floats
    scale: Floats
    redundancy: Floats
    w: Floats
    tests: int
    thing: Ints | None = None

    @property
    def checked(self) -> Bools:
        """(n, a) mask of the axes that are checked by other observations."""
        return np.asarray(self.redundancy > MIN_REDUNDANCY)

    def bias(self, significance: float) -> Floats:
        """Compute (n, a) minimal detectable biases in the units of `scale`; NaN where unchecked."""
        level = compute_level(significance, self.tests)
        return compute_minimal_detectable_bias(self.redundancy, self.scale, level)

    def limit(self, significance: float) -> float:
        """Return the size of the test statistic beyond which an observation is suspected."""
        return compute_critical_value(compute_level(significance, self.tests))

    def response(self, step: Floats) -> Floats:
        """Compute (n, r, ...) changes of whitened residuals by a step (size, ...)."""
        moved = np.einsum("nrk,nk...->nr...", self.block.jacobian, step[self.block.columns])
        return np.asarray(moved, dtype=np.float64)


def compute_test_statistics(adjustment: Adjustment) -> dict[str, TestedGroup]:
    """Compute the test statistics of all groups that are tested, by the names of the groups."""
    covariance, groups = adjustment.covariance, {}
    for kind, observation in adjustment.problem.observations.items():
        if observation.kind.role not in ("reading", "prior"):
            continue
        rows = observation.arrange_for_tests(adjustment.minimum.blocks[kind])
        whitening = observation.whitening()
        if whitening is not None:
            group = _test_correlated(kind, rows, covariance, whitening)
        else:
            sigma = observation.sigma(adjustment.minimum)
            group = _test_independent(kind, rows, covariance, sigma)
        groups[kind] = replace(group, thing=observation.things())
    return _set_families(groups)


def _set_families(groups: dict[str, TestedGroup]) -> dict[str, TestedGroup]:
    """Set the number of tests of each group; all priors together are one family."""
    prior = sum(group.w.size for kind, group in groups.items() if kind not in READINGS)
    return {
        kind: replace(group, tests=group.w.size if kind in READINGS else prior)
        for kind, group in groups.items()
    }


def _test_independent(
    kind: str, block: Block, covariance: Covariance, sigma: Floats
) -> TestedGroup:
    n, r = block.residual.shape
    numbers = compute_reliability(block, covariance)
    direction = np.broadcast_to(np.eye(r), (n, r, r))
    scale = np.broadcast_to(sigma, (n, r))
    return TestedGroup(kind, block, direction, scale, numbers.redundancy, numbers.w, 0)


def _test_correlated(
    kind: str, block: Block, covariance: Covariance, whitening: Floats
) -> TestedGroup:
    """Compute a group of correlated numbers; `whitening` (n, r, a) whitens their errors.

    Notes
    -----
    Baarda 1968 for correlated observations: w_j = e_j^T P v / sqrt(e_j^T P Q_vv P e_j); with P =
    W^T W and whitened residuals that is (W^T v)_j / sqrt((W^T Q W)_jj), Q = I - A S A^T.
    """
    length = np.linalg.norm(whitening, axis=1)
    known = np.isfinite(length) & (length > 0)
    size = np.where(known, length, np.inf)
    direction = whitening / size[:, None, :]
    cofactor = compute_cofactors(block, covariance)
    # Redundancy along each axis: d^T Q d.
    redundancy = np.einsum("nra,nrs,nsa->na", direction, cofactor, direction, optimize=True)
    redundancy = np.clip(redundancy, 0.0, 1.0)
    checked = redundancy > MIN_REDUNDANCY
    error = np.einsum("nra,nr->na", direction, block.residual)
    w = np.where(checked, error / np.sqrt(np.where(checked, redundancy, 1.0)), 0.0)
    return TestedGroup(
        kind, block, direction, np.where(known, 1.0 / size, np.nan), redundancy, w, 0
    )


def compute_cofactors(block: Block, covariance: Covariance) -> Floats:
    """Compute (n, r, r) cofactor matrices I - A S A^T of each observation's whitened residuals."""
    joint = covariance.blocks(block.columns)
    leverage = np.einsum("nrk,nkl,nsl->nrs", block.jacobian, joint, block.jacobian, optimize=True)
    return np.asarray(np.eye(block.residual.shape[1]) - leverage)


def compute_reductions(block: Block, covariance: Covariance) -> Floats:
    """Compute the (n,) reductions of the sum of squares without each observation (linear model)."""
    return reduce_squares(block.residual, compute_cofactors(block, covariance))


def reduce_squares(
    residual: Floats, cofactors: Floats, min_redundancy: float = MIN_REDUNDANCY
) -> Floats:
    """Compute r^T Q^-1 r (n,): the reductions of the sum of squares without each observation.

    Parameters
    ----------
    residual, cofactors
        (n, r) whitened residuals, and their (n, r, r) cofactor matrices Q.
    min_redundancy
        Eigenvalue of Q up to which no other observation checks its direction: this counts 0.
    """
    redundancy, axes = np.linalg.eigh(cofactors)
    along = np.einsum("nra,nr->na", axes, residual)
    checked = redundancy > min_redundancy
    return np.asarray(
        np.sum(np.where(checked, along**2, 0.0) / np.where(checked, redundancy, 1.0), axis=1)
    )
