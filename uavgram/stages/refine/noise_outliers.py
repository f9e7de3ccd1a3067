"""Separate outliers from noise before estimating variance components.

The size of errors must not be estimated from a few outliers.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from uavgram.estimation.reliability.hypotheses import compute_log_probability
from uavgram.estimation.reliability.redundancy import (
    compute_core_fit,
    compute_level,
    compute_reductions,
    compute_upper_tail,
)
from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.arrays import Floats, Ints

MISFIT_PROBABILITY = 0.05
"""Probability below which picks, lengths and ground fit so badly that the noise is in question."""

MAX_OUTLIER_SHARE = 0.01
"""Share of the observations, and at least one, that may be outliers and not noise."""

SIGNIFICANCE = 0.001
"""Significance of the test of a possible outlier at the noise of the rest."""

MIN_REDUNDANCY = 0.05
"""Least redundancy number with which the size of an error can be estimated."""


_Decrease = tuple[float, str, int]
"""Decrease of the sum of squares without an observation; its group and row."""


class NoiseOutliers(NamedTuple):
    """Outliers of a group.

    Attributes
    ----------
    rows
        (n,) rows of the observations.
    errors
        (n,) size of their errors, in their sigmas.
    """

    rows: Ints
    errors: Floats


def find_noise_outliers(adjustment: Adjustment) -> tuple[dict[str, NoiseOutliers], bool]:
    """Find few observations that exceed all noise; also return whether the others fit."""
    blocks, covariance = adjustment.minimum.blocks, adjustment.covariance
    squares, degrees, _ = compute_core_fit(adjustment)
    falls: list[_Decrease] = []
    for name in ("pixels", "lengths", "known"):
        if name in blocks:
            fall = compute_reductions(blocks[name], covariance)
            falls += [(each, name, row) for row, each in enumerate(fall.tolist())]
    # Sort by probability: a length has fewer degrees of freedom than the picks of its ends.
    axes = {name: block.residual.shape[1] for name, block in blocks.items()}
    falls.sort(key=lambda one: compute_log_probability(one[0], axes[one[1]], 1))
    # The few candidates, then those among them beyond the noise of the rest.
    worst = falls[: max(1, int(MAX_OUTLIER_SHARE * len(falls)))]
    rest = squares - sum(fall for fall, *_ in worst)
    gone = sum(axes[name] for _, name, _ in worst)
    # Variance factor of the rest, and the critical decrease at that noise.
    noise = max(rest / max(degrees - gone, 1.0), 1.0)
    limit = {name: noise * _critical_decrease(blocks[name]) for name in blocks}
    worst = [one for one in worst if one[0] > limit[one[1]]]
    gone = sum(axes[name] for _, name, _ in worst)
    # Chi-square test of the rest.
    fits = (
        compute_upper_tail(squares - sum(fall for fall, *_ in worst), degrees - gone)
        >= MISFIT_PROBABILITY
    )
    groups = dict.fromkeys(name for _, name, _ in worst)
    return {name: _outliers_of_group(adjustment, name, worst) for name in groups}, fits


def _critical_decrease(block: Block) -> float:
    """Return the critical decrease of the sum of squares without one of n observations."""
    n, axes = block.residual.shape
    return float(chdtri(axes, compute_level(SIGNIFICANCE, n)))


def _outliers_of_group(adjustment: Adjustment, name: str, worst: list[_Decrease]) -> NoiseOutliers:
    own = [(fall, row) for fall, group, row in worst if group == name]
    fall, rows = np.array([one[0] for one in own]), np.array([one[1] for one in own])
    leverage = adjustment.covariance.leverage(adjustment.minimum.blocks[name])
    redundancy = np.clip(1.0 - leverage[rows].mean(axis=1), MIN_REDUNDANCY, 1.0)
    return NoiseOutliers(rows, np.sqrt(np.maximum(fall / redundancy, 1.0)))
