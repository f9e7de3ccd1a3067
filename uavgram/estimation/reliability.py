"""Is it honest? Redundancy, standardised residuals, minimal detectable bias, variance factors.

After Baarda 1968, "A testing procedure for use in geodetic networks". All inputs are whitened:
residuals and Jacobian rows in units of the observation's own standard deviation.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.stats import chi2, norm

from uavgram.estimation.normal_equations import Block, Covariance, Factor
from uavgram.model.arrays import Floats

POWER = 0.80
"""Probability with which a bias of the minimal detectable size is found."""

NO_REDUNDANCY = 1e-6
"""Redundancy number below which an observation is not checked by any other."""


class Reliability(NamedTuple):
    """Per whitened observation of one group; all (n, r).

    Attributes
    ----------
    redundancy
        Number in [0, 1]: how much of an error in the observation shows in its residual.
    w
        Residual over its own standard deviation; 0 where nothing checks the observation.
    """

    redundancy: Floats
    w: Floats


def reliability(block: Block, covariance: Covariance) -> Reliability:
    """Redundancy numbers and standardised residuals of one group of observations."""
    joint = covariance.blocks(block.columns)
    leverage = np.einsum("nrk,nkl,nrl->nr", block.jacobian, joint, block.jacobian, optimize=True)
    redundancy = np.clip(1.0 - leverage, 0.0, 1.0)
    checked = redundancy > NO_REDUNDANCY
    w = np.where(checked, block.residual / np.sqrt(np.where(checked, redundancy, 1.0)), 0.0)
    return Reliability(redundancy, w)


def critical_value(significance: float) -> float:
    """Two-sided critical value of a standardised residual."""
    return float(norm.ppf(1.0 - significance / 2.0))


def minimal_detectable_bias(redundancy: Floats, sigma: Floats, significance: float) -> Floats:
    """Smallest error found with probability ``POWER``, in the units of `sigma`; NaN if none is.

    Baarda 1968: sigma * delta0 / sqrt(r), delta0 = z(1 - alpha / 2) + z(power).
    """
    noncentrality = critical_value(significance) + float(norm.ppf(POWER))
    checked = redundancy > NO_REDUNDANCY
    return np.where(
        checked, sigma * noncentrality / np.sqrt(np.where(checked, redundancy, 1)), np.nan
    )


class GroupFit(NamedTuple):
    """How one group of observations fits as a whole.

    `redundancy` is the group's share of the degrees of freedom, `variance_factor` its sum of
    squares over that share (NaN without redundancy), `probability` that of a factor at least as
    large by chance.
    """

    redundancy: float
    variance_factor: float
    probability: float


EXACT_GROUP = 400
"""Observations up to which a group's cofactor matrix is computed whole."""


def group_fit(block: Block, factor: Factor, covariance: Covariance) -> GroupFit:
    """Variance factor of a group and its chi-square test.

    The residuals of one group have the cofactor matrix Q = I - A S A^T, which is no projector: a
    sum of squares with Satterthwaite's degrees of freedom tr(Q)^2 / tr(Q^2) and scale
    tr(Q^2) / tr(Q) (Satterthwaite 1946, eq. 9); for one observation that is its w-test. In large
    groups, which carry nearly all of their own unknowns, tr(Q^2) = tr(Q).
    """
    squares = float(np.sum(block.residual**2))
    if block.residual.size <= EXACT_GROUP:
        cofactor = _cofactor(block, factor)
        trace, trace_of_square = float(np.trace(cofactor)), float(np.sum(cofactor**2))
    else:
        trace = float(reliability(block, covariance).redundancy.sum())
        trace_of_square = trace
    if trace <= NO_REDUNDANCY:
        return GroupFit(max(trace, 0.0), np.nan, 1.0)
    scale = trace_of_square / trace
    return GroupFit(trace, squares / trace, upper_tail(squares / scale, trace / scale))


def _cofactor(block: Block, factor: Factor) -> Floats:
    n, r, k = block.jacobian.shape
    rows = np.zeros((n, r, factor.size))
    at = np.broadcast_to(block.columns[:, None, :], (n, r, k))
    np.add.at(rows, (np.arange(n)[:, None, None], np.arange(r)[:, None], at), block.jacobian)
    flat = rows.reshape(n * r, factor.size)
    return np.asarray(np.eye(n * r) - flat @ factor.solve(np.ascontiguousarray(flat.T)))


def upper_tail(squares: float, degrees: float) -> float:
    """Probability that chi-square with `degrees` exceeds `squares` (1 without redundancy)."""
    return float(chi2.sf(squares, degrees)) if degrees > NO_REDUNDANCY else 1.0


def correlated_w(block: Block, covariance: Covariance, whitening: Floats) -> Floats:
    """Standardised residuals (n, r) of correlated observations, in their own physical axes.

    Parameters
    ----------
    block
        Whitened by `whitening`.
    covariance
        Of the unknowns.
    whitening
        (n, r, r) matrices W with W cov W^T = I.

    Notes
    -----
    Baarda 1968 for correlated observations: w_j = e_j^T P v / sqrt(e_j^T P Q_vv P e_j); with
    P = W^T W and whitened residuals that is (W^T v)_j / sqrt((W^T Q W)_jj), Q = I - A S A^T.
    """
    joint = covariance.blocks(block.columns)
    size = block.residual.shape[1]
    cofactor = np.eye(size) - np.einsum(
        "nrk,nkl,nsl->nrs", block.jacobian, joint, block.jacobian, optimize=True
    )
    numerator = np.einsum("nrj,nr->nj", whitening, block.residual)
    variance = np.einsum("nrj,nrs,nsj->nj", whitening, cofactor, whitening, optimize=True)
    scale = np.einsum("nrj,nrj->nj", whitening, whitening)
    checked = variance > NO_REDUNDANCY * scale
    return np.where(checked, numerator / np.sqrt(np.where(checked, variance, 1.0)), 0.0)
