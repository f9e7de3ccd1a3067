"""Errors that go together in time, in a likelihood that takes them as independent."""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Floats


def trend_inflation(time_s: Floats, shortest_s: float, longest_s: float) -> float:
    """Factor of the variance by which independent errors stand in for correlated ones.

    What all instants have in common is a bias, and has an unknown of its own. What is left and
    does the most harm is the slowest change, one period over the whole span T: there the errors of
    a first-order Gauss-Markov process, correlated over tau, have the spectral density of
    independent ones times

        (1 - rho^2) / (1 - 2 rho cos(w dt) + rho^2),   rho = exp(-dt / tau),   w = 2 pi / T

    (Box, Jenkins and Reinsel 1994, Time series analysis, eq. 3.2.15, over that of white noise). It
    is largest about tau = 1 / w; faster changes are overstated by the same factor.

    Parameters
    ----------
    time_s
        (N,) instants, in any order.
    shortest_s, longest_s
        Range in which tau lies; the worst of it is taken.

    Returns
    -------
    float
        At least 1; 1 for fewer than three instants, or where all are the same (or unknown).
    """
    span = float(np.ptp(time_s)) if len(time_s) > 2 else 0.0
    if span == 0.0:
        return 1.0
    interval = span / (len(time_s) - 1)
    frequency = 2.0 * np.pi / span
    tau = float(np.clip(1.0 / frequency, shortest_s, longest_s))
    rho = float(np.exp(-interval / tau))
    density = (1.0 - rho**2) / (1.0 - 2.0 * rho * np.cos(frequency * interval) + rho**2)
    return max(1.0, float(density))
