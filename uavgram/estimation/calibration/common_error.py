"""An error that all corners have beside their own noise: the print, the board's shape, the lens.

Sigmas that a detector states come from the noise of the grey values. Where residuals are several
times as large, what dominates is the same for a sharp corner and a blurred one; a common factor
would trust sharp corners far too much. So a variance common to all is added instead (a model of
two variance components, of which one is known; Koch 1999, Parameter estimation and hypothesis
testing in linear models, sec. 3.6).
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from uavgram.model.arrays import Floats


def common_error(residual_px: Floats, sigma_px: Floats, redundancy: float) -> float:
    """Standard deviation per coordinate that all corners have in common.

    Parameters
    ----------
    residual_px
        (N, 2) of an adjustment.
    sigma_px
        (N,) own standard deviations.
    redundancy
        Of these residuals: their expected sum of squares, in sigmas.

    Returns
    -------
    float
        With which the squares sum up as expected [px]; 0 where the own sigmas are large enough.
    """
    squares, variance = np.sum(residual_px**2, axis=1), sigma_px**2

    def excess(common: float) -> float:
        return float(np.sum(squares / (variance + common))) - redundancy

    if not len(squares) or redundancy <= 0 or excess(0.0) <= 0:
        return 0.0
    most = float(squares.sum()) / redundancy  # alone it would make the sum right
    return float(np.sqrt(brentq(excess, 0.0, most, xtol=1e-9 * most)))
