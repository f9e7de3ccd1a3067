"""Errors that are correlated in time, in a likelihood that treats them as independent."""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Floats


def compute_trend_inflation(time_s: Floats, shortest_s: float, longest_s: float) -> float:
    """Compute the factor of the variance by which independent errors represent correlated ones.

    The error that all instants have in common is a bias with an unknown of its own. The most
    harmful of the remaining errors is the slowest change, one period over the whole span T: at this
    frequency the errors of a first-order Gauss-Markov process, correlated over tau, have the
    spectral density of independent ones times

        (1 - rho^2) / (1 - 2 rho cos(w dt) + rho^2),   rho = exp(-dt / tau),   w = 2 pi / T

    (Box, Jenkins and Reinsel 1994, Time series analysis, eq. 3.2.15, over that of white noise). It
    is largest about tau = 1 / w; faster changes are overstated by the same factor.

    Parameters
    ----------
    time_s
        (N,) instants, in any order.
    shortest_s, longest_s
        Range of tau; the worst value within it is taken.

    Returns
    -------
    float
        At least 1; 1 for fewer than three instants, or if all are the same (or unknown).
    """
    span = float(np.ptp(time_s)) if len(time_s) > 2 else 0.0
    if span == 0.0:
        return 1.0
    interval = span / (len(time_s) - 1)
    frequency = 2.0 * np.pi / span
    # The worst correlation time, 1 / w, within its range.
    tau = float(np.clip(1.0 / frequency, shortest_s, longest_s))
    rho = float(np.exp(-interval / tau))
    density = (1.0 - rho**2) / (1.0 - 2.0 * rho * np.cos(frequency * interval) + rho**2)
    return max(1.0, float(density))
