"""Reliability of a calibration: tests of corners and photos, data snooping, and their common error.

The detector derives the sigma of a corner from the noise of the grey values. If the residuals are
several times as large, another error dominates, and it is the same for sharp and blurred corners.
Therefore one common variance is added to those of all corners (a model of two variance components,
one of which is known; Koch 1999, Parameter estimation and hypothesis testing in linear models, sec.
3.6). A common factor of all sigmas would give sharp corners far too much weight.

The tests follow Baarda 1968, "A testing procedure for use in geodetic networks", for the two
coordinates of a corner together (Kok 1984, "On data snooping and multiple outlier testing", sec.
3), and with the variance estimated from the other observations (Cook and Weisberg 1982, "Residuals
and influence in regression", sec. 2.2).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.special import chdtrc, fdtrc

from uavgram.estimation.calibration.adjustment import Fit, Normals, adjust
from uavgram.estimation.calibration.problem import Corners, Lens, Linearisation, State
from uavgram.estimation.calibration.start import MIN_CORNERS
from uavgram.estimation.reliability.redundancy import compute_reductions, compute_reliability
from uavgram.estimation.reliability.variance_components import VarianceComponent, estimate_single
from uavgram.model.arrays import Bools, Floats
from uavgram.model.board import CalibrationOptions, CornerSigma


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


MAX_ADJUSTMENTS = 100
"""Largest number of adjustments after removal of corners and photos."""

MAX_BAD_SHARE = 0.15
"""Share of bad corners in a photo above which the photo itself does not fit."""

MAX_RELATIVE_RESIDUAL = 3.0
"""Residuals of a bad photo, in units of the median of all photos: photos always differ, so a test
against the corners' noise alone would reject half of any good set."""

MIN_PHOTOS = 3

MIN_SIGMA_CHANGE = 5e-7
"""Relative change of the corners' sigmas at which the estimate has converged."""

_MAX_SCALINGS = 20


@dataclass(frozen=True, eq=False)
class CleanedFit:
    """Adjustment, and the outliers that were found.

    Attributes
    ----------
    fit
        Last adjustment, its weights scaled by `sigma_scale`.
    sigma_scale
        Factor of the corners' sigmas estimated from their residuals; 1 if they are given.
    bad_corner
        (M, n) mask of corners that are outliers: removed, or only reported.
    bad_photo
        (M,) mask of photos likewise.
    bad_photo_size
        (M,) residuals of each photo in units of the median of all when it was judged.
    """

    fit: Fit
    sigma_scale: float
    bad_corner: Bools
    bad_photo: Bools
    bad_photo_size: Floats


def remove_outliers(
    lens: Lens, corners: Corners, start: State, options: CalibrationOptions
) -> CleanedFit:
    """Adjust, test corners and photos, remove the worst, and adjust again until all fit.

    In each round at most the worst corner of each photo is removed: corners of different photos
    hardly share redundancy, those of one photo do. If outliers are only reported, all observations
    take part in the last adjustment again.

    Parameters
    ----------
    lens, corners
        Lens to estimate, and the observations of M photos.
    start
        Initial values.
    options
        Level of significance, and whether outliers are removed or only reported.
    """
    fit, scale = adjust_scaled(lens, corners, start, options)
    bad_corner = np.zeros(corners.weight.shape, bool)
    bad_photo = np.zeros(len(corners.weight), bool)
    size = np.full(len(corners.weight), np.nan)
    for _ in range(MAX_ADJUSTMENTS):
        new_corner = _find_bad_corners(fit, options)
        crowded = (bad_corner | new_corner).sum(axis=1) > MAX_BAD_SHARE * corners.count
        if new_corner.any() and not crowded.any():
            bad_corner |= new_corner
        else:
            # A photo is only removed if single corners no longer explain the misfit.
            worst, found = _find_worst_photo(fit, crowded, options)
            size = np.where(bad_photo, size, found)
            if worst is None:
                break
            bad_photo[worst] = True
            bad_corner[:] = False  # the photo may have distorted the tests of the others
        kept = np.where(bad_corner | bad_photo[:, None], 0.0, corners.weight)
        fit, scale = adjust_scaled(lens, corners.replace_weights(kept), fit.state, options)
    if options.outliers == "report" and (bad_corner.any() or bad_photo.any()):
        fit, scale = adjust_scaled(lens, corners, fit.state, options)
    return CleanedFit(fit, scale, bad_corner, bad_photo, size)


def adjust_scaled(
    lens: Lens, corners: Corners, start: State, options: CalibrationOptions
) -> tuple[Fit, float]:
    """Adjust with the corners' sigmas given, or scaled until they agree with the residuals.

    If there are priors, the scale decides their weight, so both are estimated together (variance
    components after Foerstner 1979).

    Parameters
    ----------
    lens, corners
        Lens to estimate, and the observations.
    start
        Initial values.
    options
        Whether the corners' sigmas are given, or follow from the residuals.

    Returns
    -------
    fit, scale
        Adjustment with the scaled weights; factor of the corners' sigmas.
    """
    scale = 1.0
    fit = adjust(lens, corners, start)
    if options.corner_sigma == "given":
        return fit, scale
    for _ in range(_MAX_SCALINGS):
        redundancy = max(fit.corner_redundancy, 1.0)
        factor = estimate_single(fit.corner_cost, redundancy, VarianceComponent("corners")).factor
        if (
            fit.corner_cost <= 0 or abs(factor - 1) < MIN_SIGMA_CHANGE
        ):  # exact observations have no scale
            break
        scale *= factor
        fit = adjust(lens, corners.replace_weights(corners.weight / scale), fit.state)
    return fit, scale


def _find_bad_corners(fit: Fit, options: CalibrationOptions) -> Bools:
    """Mark (M, n) the worst corner of each photo if it is an outlier."""
    tests = compute_corner_tests(fit, options.corner_sigma)
    count = max(int(fit.corners.count.sum()), 1)
    worst = tests.probability.argmin(axis=1)
    result = np.zeros(fit.corners.weight.shape, bool)
    photo = np.arange(len(worst))
    # Bonferroni: the significance is that of the whole set.
    result[photo, worst] = tests.probability[photo, worst] < options.significance / count
    # A photo keeps the corners that its pose needs, and some to check it.
    result[fit.corners.count <= 2 * MIN_CORNERS] = False
    return result


def _find_worst_photo(
    fit: Fit, crowded: Bools, options: CalibrationOptions
) -> tuple[int | None, Floats]:
    """Find the photo that fits too badly, if any, and the residuals of all over their median."""
    tests = compute_photo_tests(fit, options.corner_sigma)
    used = (fit.corners.count > 0) & np.isfinite(tests.excess)
    rms = np.sqrt(np.maximum(tests.excess, 0.0) / np.maximum(tests.degrees, 1.0))
    median = float(np.median(rms[used])) if used.any() else 0.0
    size = np.where(used & (median > 0), rms / max(median, 1e-300), np.nan)
    improbable = tests.probability < options.significance / max(int(used.sum()), 1)
    bad = used & ((improbable & (size > MAX_RELATIVE_RESIDUAL)) | crowded)
    if used.sum() <= MIN_PHOTOS or not bad.any():
        return None, size
    return int(np.argmax(np.where(bad, size, -np.inf))), size


def drop_unweighted(fit: Fit, photos: Bools) -> Fit:
    """Drop photos that have no weight left; the result does not change."""
    return replace(
        fit,
        corners=fit.corners.take(~photos),
        state=fit.state.take(~photos),
        linear=Linearisation(*(rows[~photos] for rows in fit.linear)),
        normals=Normals._make([*(rows[~photos] for rows in fit.normals[:3]), fit.normals.border]),
    )
