"""Is it honest? Redundancy, standardised residuals, minimal detectable bias, variance factors.

After Baarda 1968, "A testing procedure for use in geodetic networks". All inputs are whitened:
residuals and Jacobian rows in units of the observation's own standard deviation.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.stats import chi2, norm

from uavgram.estimation.normal_equations import Block, Covariance
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
