"""Bias, spread and coverage of repeated measurements, with confidence intervals."""

from __future__ import annotations

import numpy as np
from scipy.special import betaincinv, chdtri, stdtrit

from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.simulation import COVERAGE_SIGMAS, Accuracy, Repetitions

TAIL_PROBABILITY = 0.025
"""Probability on each side of a confidence interval."""


def compute_accuracy(repetitions: Repetitions) -> Accuracy:
    """Compute the accuracy of each value from the repetitions.

    Bias by Student's t, spread and z by chi-square, shares by Clopper and Pearson (Biometrika 26,
    1934): all exact for normal errors.

    Parameters
    ----------
    repetitions
        Repetitions, whose counted values are used.
    """
    counted = repetitions.counted
    error = np.where(counted, repetitions.value - repetitions.true, np.nan)
    ratio = error / np.where(counted, repetitions.sigma, np.nan)
    count = counted.sum(axis=0)
    bias, spread = _moments(error, count)
    with np.errstate(invalid="ignore", divide="ignore"):
        half = stdtrit(np.maximum(count - 1, 1), 1.0 - TAIL_PROBABILITY) * spread / np.sqrt(count)
    z = compute_rms(ratio, counted)
    # Share of errors within k stated sigmas.
    within = np.stack([(np.abs(ratio) <= k).sum(axis=0) for k in COVERAGE_SIGMAS], axis=1)
    share, share_range = compute_share_intervals(within, count[:, None])
    return Accuracy(
        count=count,
        bias=bias,
        bias_range=np.stack([bias - half, bias + half], axis=1),
        spread=spread,
        spread_range=compute_sigma_interval(spread, count - 1),
        stated=compute_rms(repetitions.sigma, counted),
        coverage=share,
        coverage_range=share_range,
        z=z,
        z_range=compute_sigma_interval(z, count),
    )


def compute_running_ratio(repetitions: Repetitions, count: int) -> float:
    """Compute the RMS, over the values, of spread over predicted sigma after `count` repetitions.

    NaN as long as it is undetermined.
    """
    counted = repetitions.counted[:count]
    error = np.where(counted, (repetitions.value - repetitions.true)[:count], np.nan)
    _, spread = _moments(error, counted.sum(axis=0))
    ratio = spread / repetitions.predicted
    known = ratio[np.isfinite(ratio)]
    return float(np.sqrt(np.mean(known**2))) if known.size else float("nan")


def compute_rms(value: Floats, counted: Bools) -> Floats:
    """Compute the (M,) RMS of the counted ones of (N, M); NaN if there is none."""
    with np.errstate(invalid="ignore", divide="ignore"):
        total = np.where(counted, value, 0.0) ** 2
        return np.asarray(np.sqrt(total.sum(axis=0) / counted.sum(axis=0)))


def compute_sigma_interval(sigma: Floats, degrees: Ints) -> Floats:
    """Compute (..., 2) confidence intervals of the true sigma from estimates and their degrees.

    s sqrt(n / chi2(1 - p)) to s sqrt(n / chi2(p)); NaN without any.
    """
    known = degrees > 0
    free = np.maximum(degrees, 1).astype(np.float64)
    low = np.sqrt(free / chdtri(free, TAIL_PROBABILITY))
    high = np.sqrt(free / chdtri(free, 1.0 - TAIL_PROBABILITY))
    factor = np.stack([low, high], axis=-1)
    return np.where(known[..., None], sigma[..., None] * factor, np.nan)


def compute_share_intervals(within: Ints, count: Ints) -> tuple[Floats, Floats]:
    """Compute shares (...,) of counts, and the confidence intervals (..., 2) of the true shares."""
    n = np.broadcast_to(count, within.shape).astype(np.float64)
    k = within.astype(np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.where(n > 0, k / n, np.nan)
    low = np.where(k > 0, betaincinv(np.maximum(k, 1.0), n - k + 1.0, TAIL_PROBABILITY), 0.0)
    high = np.where(k < n, betaincinv(k + 1.0, np.maximum(n - k, 1.0), 1.0 - TAIL_PROBABILITY), 1.0)
    return share, np.where((n > 0)[..., None], np.stack([low, high], axis=-1), np.nan)


def _moments(error: Floats, count: Ints) -> tuple[Floats, Floats]:
    """Compute mean and standard deviation (M,) of (N, M) without NaN; NaN if there are too few."""
    known = np.isfinite(error)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.where(known, error, 0.0).sum(axis=0) / count
        squares = (np.where(known, error - mean, 0.0) ** 2).sum(axis=0)
        spread = np.sqrt(squares / (count - 1))
    return mean, np.where(count > 1, spread, np.nan)
