"""Pooled statistics of many surveys: whether sigmas are realistic, and drifts of calibrations."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from datetime import datetime
from itertools import groupby

import numpy as np
from scipy.special import ndtri
from scipy.stats import chi2

from uavgram.model.batch import Drift, Fit, ParameterUpdate, PooledRatio, SurveyRow

MIN_FREEDOM = 1.0
_YEAR_S = 365.25 * 86400.0
_SHARED_CHANCE = 0.01
"""Probability of one false alarm among all tests on drift of a batch, by Bonferroni's bound."""
_LEARNT = 0.9
_DRIFT_SURVEYS = 3
"""Least number of surveys for a drift, as two are always on a line."""


def pool_fits(rows: Sequence[SurveyRow]) -> tuple[PooledRatio, ...]:
    """Pool errors over sigmas of all surveys, then by camera and by drone.

    A sum of squared errors over their covariance is a chi-square of as many degrees of freedom as
    numbers are compared, where the sigmas are right; so is the sum over independent surveys.

    Parameters
    ----------
    rows
        The surveys; those without results have no effect.
    """
    found = [*_pool("all", "", rows)]
    for of in ("camera", "drone"):
        named = sorted((getattr(row, of), k) for k, row in enumerate(rows) if getattr(row, of))
        for name, members in groupby(named, key=lambda one: one[0]):
            found += _pool(of, name, [rows[k] for _, k in members])
    return tuple(found)


def _pool(of: str, name: str, rows: Sequence[SurveyRow]) -> Iterable[PooledRatio]:
    by_kind: dict[str, list[Fit]] = {}
    for row in rows:
        for fit in row.fits:
            by_kind.setdefault(fit.kind, []).append(fit)
    for kind, fits in by_kind.items():
        freedom = math.fsum(fit.freedom for fit in fits)
        if freedom < MIN_FREEDOM:
            continue
        squares = math.fsum(fit.squares for fit in fits)
        # (squares / factor^2) is a chi-square: the range of factors that it leaves open.
        low, high = np.sqrt(squares / chi2.ppf([0.975, 0.025], freedom)).tolist()
        ratio = math.sqrt(squares / freedom)
        yield PooledRatio(
            of=of,
            name=name,
            kind=kind,
            surveys=len(fits),
            freedom=freedom,
            ratio=ratio,
            low=low,
            high=high,
        )


def find_camera_drifts(rows: Sequence[SurveyRow]) -> tuple[Drift, ...]:
    """Compare the parameters of each camera from its surveys with the file, and over time.

    Parameters
    ----------
    rows
        The surveys.
    """
    cameras: dict[tuple[str, str, float, float], list[tuple[float, ParameterUpdate]]] = {}
    for row in rows:
        for seen in row.seen:
            if _is_significant(seen):
                # another file is another calibration, even with the same name
                key = (row.camera, seen.name, seen.stated, seen.stated_sigma)
                cameras.setdefault(key, []).append((_seconds(row.taken_utc), seen))
    several = {key: found for key, found in cameras.items() if len(found) > 1}
    # two tests, two-sided, of each parameter
    limit = -float(ndtri(_SHARED_CHANCE / max(4 * len(several), 1)))
    return tuple(_drift(key[0], key[1], found, limit) for key, found in several.items())


def _is_significant(seen: ParameterUpdate) -> bool:
    """Return whether a survey determines a parameter that its file leaves free."""
    return 0.0 < seen.sigma < _LEARNT * seen.stated_sigma


def _drift(
    camera: str, name: str, found: Sequence[tuple[float, ParameterUpdate]], limit: float
) -> Drift:
    """Estimate offset and slope by weighted least squares, from the surveys without the file.

    An adjustment moves a parameter from its prior by a shift whose covariance, with itself and with
    the prior's error, is the loss of variance, prior minus adjusted (the Kalman update). So the
    shift times prior over loss is an estimate independent of the prior's error, of variance prior x
    adjusted / loss, for any correlations with other parameters.
    """
    stated = np.array([one.stated for _, one in found])
    prior = np.array([one.stated_sigma for _, one in found]) ** -2.0
    total = np.array([one.sigma for _, one in found]) ** -2.0
    weight = total - prior
    shift = np.array([one.value for _, one in found]) - stated
    own = shift * total / weight  # of the survey alone, minus the file
    offset = float(np.sum(weight * own) / np.sum(weight))
    # Errors of the other parameters are common to all surveys: a mean does not reduce them.
    common = float(np.sum(np.sqrt(weight)) / np.sum(weight))
    offset_sigma = math.hypot(common, found[0][1].stated_sigma)
    slope, slope_sigma = _slope(np.array([time for time, _ in found]) / _YEAR_S, own, weight)
    return Drift(
        camera=camera,
        parameter=name,
        surveys=len(found),
        offset=offset,
        offset_sigma=offset_sigma,
        per_year=slope,
        per_year_sigma=slope_sigma,
        is_off=abs(offset) > limit * offset_sigma,
        drifts=abs(slope) > limit * slope_sigma,
    )


def _slope(years: np.ndarray, own: np.ndarray, weight: np.ndarray) -> tuple[float, float]:
    """Estimate the slope and its sigma; NaN for too few surveys, or a single moment."""
    timed = np.isfinite(years)
    if timed.sum() < _DRIFT_SURVEYS:
        return math.nan, math.nan
    years, own, weight = years[timed], own[timed], weight[timed]
    since = years - np.average(years, weights=weight)
    spread = float(np.sum(weight * since**2))
    if np.ptp(years) <= 0.0:
        return math.nan, math.nan
    return float(np.sum(weight * since * own)) / spread, 1.0 / math.sqrt(spread)


def _seconds(moment: str) -> float:
    return datetime.fromisoformat(moment).timestamp() if moment else math.nan
