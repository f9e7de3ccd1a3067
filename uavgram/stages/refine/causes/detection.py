"""Detect whether a survey has a misfit, or left-out observations, that need a cause."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.reliability.hypotheses import SMALLEST, explained, log_probability
from uavgram.estimation.reliability.redundancy import core_fit, redundancy_of, upper_tail
from uavgram.estimation.reliability.test_statistics import falls_without
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.stages.refine.causes.flight.log import strained_priors, turn_by_places
from uavgram.stages.refine.causes.hypothesis import Standing
from uavgram.stages.refine.causes.labels.two_views import swapped_beside_another
from uavgram.stages.refine.causes.lengths.common import common_misfit
from uavgram.stages.refine.causes.photos.turned import against_the_log

MISFIT = 0.01
"""Probability of the core's sum of squares below which a cause is looked for."""

BY_CHANCE = float(np.log(0.001))
"""Logarithm of the significance level for the whole survey: the frequency of false causes."""


def asks(standing: Standing) -> bool:
    """Return whether the survey has a misfit, or left-out observations, that need a cause."""
    adjustment = standing.adjustment
    if standing.left_out or not adjustment.minimum.converged:
        return True
    if core_fit(adjustment).probability < MISFIT or _worst(adjustment) < BY_CHANCE:
        return True
    if _strained(adjustment) < BY_CHANCE:
        return True
    if common_misfit(adjustment) or against_the_log(standing):
        return True
    return any(True for _ in swapped_beside_another(standing))


def _strained(adjustment: Adjustment) -> float:
    """Compute the log probability of the prior that fits worst, at the level of the survey.

    Tested are the unknowns common to the flight and its camera, and the poses of the log together.
    """
    priors = list(strained_priors(adjustment))
    found = explained(adjustment, priors)
    worst = min((log_probability(f.gain, f.unknowns, len(priors) + 1) for f in found), default=0.0)
    if "telemetry" in adjustment.minimum.blocks:
        squares = float(np.sum(adjustment.minimum.blocks["telemetry"].residual ** 2))
        degrees = redundancy_of(adjustment, "telemetry")
        probability = upper_tail(squares, degrees) * (len(priors) + 1)
        worst = min(worst, float(np.log(max(probability, SMALLEST))))
    # A common rotation of the whole log: one test outside the linear model.
    return min(worst, log_probability(turn_by_places(adjustment).gain, 1, 1))


def _worst(adjustment: Adjustment) -> float:
    """Compute the log probability of the worst observation, at the level of the survey."""
    worst = 0.0
    for name in ("pixels", "lengths", "known"):
        if name in adjustment.minimum.blocks:
            block = adjustment.minimum.blocks[name]
            fall = falls_without(block, adjustment.covariance)
            axes = block.residual.shape[1]
            worst = min(worst, log_probability(float(fall.max(initial=0.0)), axes, len(fall)))
    return worst
