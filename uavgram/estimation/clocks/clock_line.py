"""A straight line between two clocks, from pairs of readings with outliers or with delays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Floats

# Autopilots were measured to run 18 to 146 ppm off; a short log must not invent more than that.
DRIFT_SIGMA = 2e-4
_STEPS = 30
_LONGEST_DELAY_S = 600.0  # a reading further off the others is damaged
_TUKEY = 4.685  # of the biweight, 95 % efficient for normal errors (Huber 1981)


@dataclass(frozen=True)
class ClockLine:
    """``other = offset_s + rate * time``.

    Attributes
    ----------
    offset_s, rate
        Of the line.
    scatter_s
        Robust standard deviation of one pair about it.
    sigma_s
        Standard deviation of the line at the middle of the readings.
    drift_sigma
        Standard deviation of the rate.
    """

    offset_s: float
    rate: float
    scatter_s: float
    sigma_s: float
    drift_sigma: float

    def residual_s(self, time_s: Floats, other_s: Floats) -> Floats:
        """(N,) by how much readings of the other clock are ahead of the line."""
        # the offset last: beside 1e9 s a microsecond of the others would be lost
        return np.asarray((other_s - self.offset_s) - self.rate * time_s)


def fit_line(time_s: Floats, other_s: Floats) -> ClockLine:
    """Fit a line by iteratively reweighted least squares (Tukey's biweight).

    The start is robust: the median slope of pairs half the data apart (after Theil and Sen), so
    up to a quarter of wrong pairs cannot pull it.

    Parameters
    ----------
    time_s, other_s
        (N,) readings of the two clocks at the same instants, N >= 1.
    """
    middle = float(np.mean(time_s))
    t = time_s - middle
    base = float(np.median(other_s - time_s))
    y = (other_s - time_s) - base  # small numbers: the clocks themselves are 1e9 s large
    slope = _start_slope(t, y)
    level = float(np.median(y - slope * t))
    scatter = 0.0
    weight = np.ones(len(t))
    for _ in range(_STEPS):
        residual = y - level - slope * t
        # readings are digital: below a microsecond there is nothing to weigh
        scatter = max(1.4826 * float(np.median(np.abs(residual))), 1e-6)
        weight = np.clip(1 - (residual / (_TUKEY * scatter)) ** 2, 0, None) ** 2
        previous = (level, slope)
        level, slope = _weighted_line(t, y, weight, scatter)
        if abs(level - previous[0]) < 1e-9 and abs(slope - previous[1]) < 1e-12:
            break
    rate = 1.0 + slope
    return ClockLine(
        offset_s=base + level + middle - rate * middle,
        rate=rate,
        scatter_s=scatter,
        sigma_s=float(scatter / np.sqrt(max(float(weight.sum()), 1.0))),
        drift_sigma=float(scatter / np.sqrt(weight @ t**2 + (scatter / DRIFT_SIGMA) ** 2)),
    )


def _start_slope(t: Floats, y: Floats) -> float:
    half = len(t) // 2
    if half < 2:
        return 0.0
    apart = t[half:] - t[: len(t) - half]
    slopes = (y[half:] - y[: len(y) - half])[apart > 0] / apart[apart > 0]
    if not len(slopes):
        return 0.0
    return float(np.clip(np.median(slopes), -10 * DRIFT_SIGMA, 10 * DRIFT_SIGMA))


def _weighted_line(t: Floats, y: Floats, weight: Floats, scatter: float) -> tuple[float, float]:
    """Level and slope; the slope has a prior of zero with `DRIFT_SIGMA`."""
    prior = (scatter / DRIFT_SIGMA) ** 2
    normal = np.array(
        [[weight.sum(), weight @ t], [weight @ t, weight @ t**2 + prior]], dtype=np.float64
    )
    level, slope = np.linalg.solve(normal, np.array([weight @ y, weight @ (t * y)]))
    return float(level), float(slope)


def fit_lower_envelope(time_s: Floats, other_s: Floats, bin_s: float = 5.0) -> ClockLine:
    """Fit the line below readings that come late by an unknown, varying, never negative delay.

    The least delayed reading of every `bin_s` seconds stands for the clock; the line goes through
    those.

    Parameters
    ----------
    time_s, other_s
        (N,) readings of the two clocks at the same instants; `other_s` may be late.
    bin_s
        Length of time of which one reading is taken.
    """
    late = other_s - time_s
    # one of the readings itself: the mean of two far apart would be near to none
    near = np.abs(late - np.quantile(late, 0.5, method="lower")) < _LONGEST_DELAY_S
    time_s, other_s, late = time_s[near], other_s[near], late[near]
    order = np.lexsort((late, np.floor((time_s - time_s[0]) / bin_s)))
    bins = np.floor((time_s[order] - time_s[0]) / bin_s)
    least = order[np.diff(bins, prepend=-np.inf) > 0]
    return fit_line(time_s[least], other_s[least])
