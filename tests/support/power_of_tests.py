"""Power of the w-test of a single observation."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from uavgram.estimation.reliability.redundancy import compute_critical_value
from uavgram.model.arrays import Floats


def compute_power(bias: Floats, redundancy: Floats, sigma: Floats, significance: float) -> Floats:
    """Compute the probability with which the w-test of an observation finds an error of `bias`.

    Baarda 1968: w is normal about bias * sqrt(r) / sigma; the test has two sides.

    Parameters
    ----------
    bias, redundancy, sigma
        (...) size of the error, redundancy number and standard deviation of the observation.
    significance
        Significance of the test.
    """
    mean = np.abs(bias) * np.sqrt(redundancy) / sigma
    limit = compute_critical_value(significance)
    return np.asarray(ndtr(mean - limit) + ndtr(-limit - mean))
