"""Separate few outliers from noise, before variance components are estimated.

The size of ordinary errors must not be learnt from outliers. Nor is an observation an outlier where
the others of its group show that their errors are larger than stated.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import chdtri, fdtri

from uavgram.estimation.reliability.core import core_fit, redundancy_of
from uavgram.estimation.reliability.hypotheses import log_probability
from uavgram.estimation.reliability.redundancy import level_of_each, upper_tail
from uavgram.estimation.reliability.test_statistics import falls_without
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.arrays import Floats, Ints

MISFIT = 0.05
"""Probability below which picks, lengths and ground fit so badly that noise is in question."""

FEW = 0.01
"""Share of the observations, and at least one, that may be blunders and no noise."""

CLEAR = 0.001
"""Significance of the test, at the noise of the rest, of what may be a blunder and no noise."""

STATED_WEIGHT = {"pixels": 20.0, "lengths": 5.0}
"""Of the stated sigmas of groups whose sigmas are learnt, as so many residuals."""

LEAST_REDUNDANCY = 0.05
"""Redundancy number from which on the size of an error can be told."""


_Fall = tuple[float, str, int]
"""By which the sum of squares falls without an observation; its group and row."""


class Outstanding(NamedTuple):
    """Observations of a group that stand out.

    Attributes
    ----------
    rows
        (n,) which.
    errors
        (n,) size of their errors, in their sigmas.
    """

    rows: Ints
    errors: Floats


def outstanding(adjustment: Adjustment) -> tuple[dict[str, Outstanding], bool]:
    """Find few observations that stand out of all noise; and whether everything else fits."""
    blocks, covariance = adjustment.minimum.blocks, adjustment.covariance
    squares, degrees, _ = core_fit(adjustment)
    falls: list[_Fall] = []
    for name in ("pixels", "lengths", "known"):
        if name in blocks:
            fall = falls_without(blocks[name], covariance)
            falls += [(each, name, row) for row, each in enumerate(fall.tolist())]
    # Of a length and the picks of its ends, which fall alike, the length has fewer axes to chance.
    axes = {name: block.residual.shape[1] for name, block in blocks.items()}
    falls.sort(key=lambda one: log_probability(one[0], axes[one[1]], 1))
    worst = falls[: max(1, int(FEW * len(falls)))]
    rest = squares - sum(fall for fall, *_ in worst)
    gone = sum(axes[name] for _, name, _ in worst)
    noise = max(rest / max(degrees - gone, 1.0), 1.0)
    limit = {
        name: _limit(adjustment, name, [fall for fall, own, _ in worst if own == name], noise)
        for name in {own for _, own, _ in worst}
    }
    worst = [one for one in worst if one[0] > limit[one[1]]]
    gone = sum(axes[name] for _, name, _ in worst)
    fits = upper_tail(squares - sum(fall for fall, *_ in worst), degrees - gone) >= MISFIT
    groups = dict.fromkeys(name for _, name, _ in worst)
    return {name: _of_group(adjustment, name, worst) for name in groups}, fits


def _limit(adjustment: Adjustment, name: str, falls: list[float], noise: float) -> float:
    """Compute the fall of the sum of squares without one observation that is hardly chance.

    Where the sigma of a group is learnt, the fall per axis over the variance of the rest of the
    group has an F distribution: with few observations even a large fall may be noise.

    Parameters
    ----------
    adjustment
        With the sigmas as stated.
    name
        Of the group.
    falls
        Of its observations that may stand out.
    noise
        Variance factor of all observations but these; of groups whose sigmas are not learnt.
    """
    block, weight = adjustment.minimum.blocks[name], STATED_WEIGHT.get(name)
    n, axes = block.residual.shape
    level = level_of_each(CLEAR, n)
    if weight is None:
        return float(noise * chdtri(axes, level))
    rest = weight + max(float(np.sum(block.residual**2)) - sum(falls), 0.0)
    degrees = weight + max(redundancy_of(adjustment, name) - axes * len(falls), 0.0)
    return float(max(rest / degrees, 1.0) * axes * fdtri(axes, degrees, 1.0 - level))


def _of_group(adjustment: Adjustment, name: str, worst: list[_Fall]) -> Outstanding:
    own = [(fall, row) for fall, group, row in worst if group == name]
    fall, rows = np.array([one[0] for one in own]), np.array([one[1] for one in own])
    leverage = adjustment.covariance.leverage(adjustment.minimum.blocks[name])
    redundancy = np.clip(1.0 - leverage[rows].mean(axis=1), LEAST_REDUNDANCY, 1.0)
    return Outstanding(rows, np.sqrt(np.maximum(fall / redundancy, 1.0)))
