"""Test statistics of every observation and prior of a survey, group by group.

Baarda 1968, "A testing procedure for use in geodetic networks"; with priors as observations as in
Foerstner & Wrobel 2016, "Photogrammetric computer vision", ch. 4.6.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from uavgram.estimation.reliability.redundancy import (
    MIN_REDUNDANCY,
    compute_critical_value,
    compute_level,
    compute_minimal_detectable_bias,
    compute_reliability,
)
from uavgram.estimation.solver.normal_equations import Block, Covariance
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.observations.kinds import READINGS
from uavgram.model.arrays import Bools, Floats, Ints


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
        rows = observation.tested(adjustment.minimum.blocks[kind])
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
