"""Data snooping of corners and photos: one at a time, with an adjustment after each."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from uavgram.estimation.calibration.adjustment import Fit, Normals, adjust
from uavgram.estimation.calibration.problem import Corners, Lens, Linearisation, State
from uavgram.estimation.calibration.reliability import compute_corner_tests, compute_photo_tests
from uavgram.estimation.calibration.start import MIN_CORNERS
from uavgram.estimation.reliability.variance_components import VarianceComponent, estimate_single
from uavgram.model.arrays import Bools, Floats
from uavgram.model.board import CalibrationOptions

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
        fit, scale = adjust_scaled(lens, corners.weighted(kept), fit.state, options)
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
        factor = estimate_single(
            fit.corner_cost, redundancy, VarianceComponent("corners")
        ).factor.item()
        if (
            fit.corner_cost <= 0 or abs(factor - 1) < MIN_SIGMA_CHANGE
        ):  # exact observations have no scale
            break
        scale *= factor
        fit = adjust(lens, corners.weighted(corners.weight / scale), fit.state)
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
