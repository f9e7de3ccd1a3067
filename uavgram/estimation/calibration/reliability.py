"""Reliability of a calibration: tests of corners and photos, and their common error.

Sigmas that a detector states come from the noise of the grey values. If residuals are several times
as large, the dominating error is the same for a sharp corner and a blurred one; a common factor
would give sharp corners far too much weight. So a variance common to all is added instead (a model
of two variance components, one of which is known; Koch 1999, Parameter estimation and hypothesis
testing in linear models, sec. 3.6).

After Baarda 1968, "A testing procedure for use in geodetic networks", for the two coordinates of a
corner together (Kok 1984, "On data snooping and multiple outlier testing", sec. 3), and with the
variance estimated from the other observations (Cook and Weisberg 1982, "Residuals and influence in
regression", sec. 2.2).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.special import chdtrc, fdtrc

from uavgram.estimation.calibration.adjustment import Fit
from uavgram.estimation.reliability.redundancy import compute_reliability
from uavgram.estimation.reliability.test_statistics import compute_reductions
from uavgram.model.arrays import Floats
from uavgram.model.board import CornerSigma


def estimate_common_error(residual_px: Floats, sigma_px: Floats, redundancy: float) -> float:
    """Estimate the standard deviation per coordinate that all corners have in common.

    Parameters
    ----------
    residual_px
        (N, 2) residuals of an adjustment.
    sigma_px
        (N,) own standard deviations.
    redundancy
        Redundancy of these residuals: their expected sum of squares, in sigmas.

    Returns
    -------
    float
        The value for which the sum of squares is as expected [px]; 0 if the own sigmas are large
        enough.
    """
    squares, variance = np.sum(residual_px**2, axis=1), sigma_px**2

    def excess(common: float) -> float:
        return float(np.sum(squares / (variance + common))) - redundancy

    if not len(squares) or redundancy <= 0 or excess(0.0) <= 0:
        return 0.0
    most = float(squares.sum()) / redundancy  # upper bound: the common variance alone
    return float(np.sqrt(brentq(excess, 0.0, most, xtol=1e-9 * most)))


class CornerTests(NamedTuple):
    """Tests of each corner; all (M, n), 0 (probability 1) if there is none or it is not checked.

    Attributes
    ----------
    w
        Length of the residual in its own standard deviations.
    probability
        Probability of a residual at least as long by chance.
    redundancy
        Mean of the corner's two redundancy numbers.
    """

    w: Floats
    probability: Floats
    redundancy: Floats


class PhotoTests(NamedTuple):
    """Tests of each of M photos against the others.

    Attributes
    ----------
    excess
        (M,) reduction of the sum of squares without the photo.
    degrees
        (M,) degrees of freedom of that reduction.
    probability
        (M,) probability of such an excess by chance.
    shift
        (M, q) change of the border without the photo, to first order; NaN if the others do not
        determine it.
    by_border
        (M,) the part of `excess` by the change of the border for the other photos.
    """

    excess: Floats
    degrees: Floats
    probability: Floats
    shift: Floats
    by_border: Floats


def eliminate_pose(fit: Fit) -> Floats:
    """Compute the (M, 2 n, q) Jacobian by the border with each photo's pose eliminated."""
    return np.asarray(fit.linear.border - fit.linear.pose @ fit.normals.gain)


def compute_corner_tests(fit: Fit, sigma: CornerSigma) -> CornerTests:
    """Test every corner against all the others."""
    there = fit.corners.weight > 0
    block = fit.corner_block
    squared = np.where(there, compute_reductions(block, fit.covariance).reshape(there.shape), 0.0)
    redundancy = (
        compute_reliability(block, fit.covariance).redundancy.mean(axis=1).reshape(there.shape)
    )
    scale, probability = _judge(squared, np.full(squared.shape, 2.0), fit, sigma)
    return CornerTests(
        np.sqrt(squared / scale),
        np.where(squared > 0, probability, 1.0),
        np.where(there, redundancy, 0.0),
    )


def compute_photo_tests(fit: Fit, sigma: CornerSigma) -> PhotoTests:
    """Test every photo against all the others, its pose left free."""
    v, reduced = fit.linear.residual, eliminate_pose(fit)
    gradient = np.einsum("mri,mr->mi", reduced, v)
    others = fit.normals.border - fit.normals.photo_border
    # Without photo i the cost of the others is minimal at a shift d with (S - S_i) d = g_i.
    scale = np.sqrt(np.diag(fit.normals.border))  # positive, as the matrix was inverted before
    scaled = others / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(scaled)
    along = np.einsum("mij,mi->mj", vectors, gradient / scale)
    determined = values > 1e-12
    along = np.where(determined, along / np.where(determined, values, 1.0), np.nan)
    shift = np.einsum("mij,mj->mi", vectors, along) / scale
    by_border = np.einsum("mi,mi->m", gradient, shift)
    excess = np.sum(v**2, axis=1) + by_border
    degrees = np.maximum(2.0 * fit.corners.count - fit.linear.pose.shape[2], 0.0)
    known = np.isfinite(excess) & (degrees > 0)
    judged = _judge(np.where(known, excess, 0.0), np.maximum(degrees, 1.0), fit, sigma)[1]
    return PhotoTests(excess, degrees, np.where(known, judged, 1.0), shift, by_border)


def _judge(squared: Floats, degrees: Floats, fit: Fit, sigma: CornerSigma) -> tuple[Floats, Floats]:
    """Compute the variance factor without each observation, and the probability of its squares."""
    squares = np.maximum(squared, 0.0)  # negative only by rounding
    if sigma == "given":
        return np.ones_like(squared), np.asarray(chdtrc(degrees, squares))
    rest = np.maximum(fit.degrees_of_freedom - degrees, 1.0)
    scale = np.maximum(fit.cost - squared, np.finfo(float).tiny) / rest
    return scale, np.asarray(fdtrc(degrees, rest, squares / degrees / scale))


class PhotoEffect(NamedTuple):
    """Scatter of the single photos' cameras beyond the noise of their corners.

    Attributes
    ----------
    factor
        Factor of the covariance; 1 if all residuals are independent, NaN if it cannot be estimated.
    degrees
        Effective degrees of freedom of that factor.
    probability
        Probability of so large a factor by chance.
    """

    factor: float
    degrees: float
    probability: float


def estimate_photo_effect(fit: Fit, tests: PhotoTests, variance_factor: float) -> PhotoEffect:
    """Compare the scatter of the single photos' cameras with the inverse normal matrix.

    Residuals of one photo are correlated if the board is bent, the lens does not quite follow the
    model, or the camera moved: then the corners are fewer independent observations than their
    number (the design effect of clustered samples: Kish 1965, sec. 5.4). With S the reduced normal
    matrix, S_i the share of photo i and g_i its gradient, g_i^T (S - S_i)^-1 g_i has the
    expectation tr(S_i S^-1) under independence (the unbiased "HC2" of MacKinnon and White 1985 for
    groups); the factor is the sum over photos divided by the sum of the expectations, tested with
    Satterthwaite's degrees of freedom.

    Parameters
    ----------
    fit, tests
        Adjustment, and the tests of its photos.
    variance_factor
        Variance factor of the corners, the unit of their scatter.
    """
    share = fit.normals.photo_border @ fit.border_covariance
    expected = float(np.einsum("mii->", share))
    squares = float(np.einsum("mij,mji->", share, share))
    if not np.isfinite(tests.by_border).all() or squares <= 0 or variance_factor <= 0:
        return PhotoEffect(np.nan, 0.0, 1.0)
    factor = float(tests.by_border.sum()) / (expected * variance_factor)
    degrees = expected**2 / squares
    return PhotoEffect(factor, degrees, float(chdtrc(degrees, factor * degrees)))
