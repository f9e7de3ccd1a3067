"""Detect whether a survey has a misfit, or left-out observations, that need a cause."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.reliability.hypotheses import (
    MIN_PROBABILITY,
    compare_hypotheses,
    compute_log_probability,
)
from uavgram.estimation.reliability.redundancy import (
    compute_core_fit,
    compute_reductions,
    compute_redundancy,
    compute_upper_tail,
)
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.stages.refine.causes.common_length_errors import has_common_misfit
from uavgram.stages.refine.causes.flight_log import find_turn_by_places, list_prior_hypotheses
from uavgram.stages.refine.causes.hypothesis import MISFIT_PROBABILITY, Diagnosis
from uavgram.stages.refine.causes.suspect_lengths import find_unchecked_lengths
from uavgram.stages.refine.causes.swapped_labels import propose_swapped_by_two_views
from uavgram.stages.refine.causes.turned_photos import find_photos_against_log

LOG_SIGNIFICANCE = float(np.log(0.001))
"""Logarithm of the significance level for the whole survey: the frequency of false causes."""


def needs_cause(diagnosis: Diagnosis) -> bool:
    """Return whether the survey has a misfit, or left-out observations, that need a cause."""
    return bool(diagnosis.left_out) or has_misfit(diagnosis)


def has_misfit(diagnosis: Diagnosis) -> bool:
    """Return whether the participating observations do not fit."""
    adjustment = diagnosis.adjustment
    if not adjustment.minimum.converged:
        return True
    if (
        compute_core_fit(adjustment).probability < MISFIT_PROBABILITY
        or _worst_observation(adjustment) < LOG_SIGNIFICANCE
    ):
        return True
    if _worst_prior(adjustment) < LOG_SIGNIFICANCE:
        return True
    if len(find_unchecked_lengths(adjustment)):
        return True
    if has_common_misfit(adjustment) or find_photos_against_log(diagnosis):
        return True
    return any(True for _ in propose_swapped_by_two_views(diagnosis))


def _worst_prior(adjustment: Adjustment) -> float:
    """Compute the log probability of the prior that fits worst, at the level of the survey.

    Tested are the unknowns common to the flight and its camera, and the poses of the log together.
    """
    priors = list(list_prior_hypotheses(adjustment))
    found = compare_hypotheses(adjustment, priors)
    worst = min(
        (compute_log_probability(f.gain, f.unknowns, len(priors) + 1) for f in found), default=0.0
    )
    if "telemetry" in adjustment.minimum.blocks:
        squares = float(np.sum(adjustment.minimum.blocks["telemetry"].residual ** 2))
        degrees = compute_redundancy(adjustment, "telemetry")
        probability = compute_upper_tail(squares, degrees) * (len(priors) + 1)
        worst = min(worst, float(np.log(max(probability, MIN_PROBABILITY))))
    # A common rotation of the whole log: one test outside the linear model.
    return min(worst, compute_log_probability(find_turn_by_places(adjustment).gain, 1, 1))


def _worst_observation(adjustment: Adjustment) -> float:
    """Compute the log probability of the worst observation, at the level of the survey."""
    worst = 0.0
    for name in ("pixels", "lengths", "known"):
        if name in adjustment.minimum.blocks:
            block = adjustment.minimum.blocks[name]
            fall = compute_reductions(block, adjustment.covariance)
            axes = block.residual.shape[1]
            worst = min(
                worst, compute_log_probability(float(fall.max(initial=0.0)), axes, len(fall))
            )
    return worst
