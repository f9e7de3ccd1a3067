"""Which points stand off the ground: a mixture of points on rough ground and points anywhere.

Each point's departure from the ground is normal about 0, of the ground's roughness for most points
and of `ANYWHERE_M` for the others. What share these have, and how rough the ground is, is learnt
from all points together (a spike and a slab: Mitchell and Beauchamp 1988, "Bayesian variable
selection in linear regression").
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.arrays import Floats

ANYWHERE_M = 3.0
"""Standard deviation of the heights of points that stand off the ground."""

RELIEF_M = np.array([0.003, 0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.14, 0.2])
"""Departures of the ground itself that are considered."""

USUAL_RELIEF_M = 0.05
"""Mean of the (exponential) prior of these."""

LEAST_SHARE, MOST_SHARE = 0.02, 0.5
"""Bounds of the share of points off the ground that the mixture takes for granted beforehand."""

ROUNDS = 20
"""Of the share, which converges in a few."""

NOTHING = 1e-6
"""Share of its prior's information below which the observations say nothing of a departure."""


class Seen(NamedTuple):
    """What all observations but its own prior say of each point's departure (K,).

    Attributes
    ----------
    departure_m, variance_m2
        Estimate and variance; infinite where they say nothing.
    """

    departure_m: Floats
    variance_m2: Floats


class Mixture(NamedTuple):
    """Points on and off the ground.

    Attributes
    ----------
    relief_m
        Standard deviation of the departures of points on the ground.
    off
        (n,) probability of each that it stands off the ground.
    """

    relief_m: float
    off: Floats


def seen_departures(adjustment: Adjustment, prior_sigma_m: Floats) -> Seen:
    """Departures of the points as they would be without each one's own prior.

    Parameters
    ----------
    adjustment
        In which each departure is an unknown.
    prior_sigma_m
        (K,) of each departure about 0, as it was adjusted with.
    """
    label = np.arange(len(prior_sigma_m))
    column = adjustment.problem.layout.point_columns(label)[:, 2:]
    variance = adjustment.covariance.blocks(column)[:, 0, 0]
    own = prior_sigma_m**-2.0
    information = 1.0 / variance - own
    says = information > NOTHING * own
    found = np.where(says, 1.0 / np.where(says, information, 1.0), np.inf)
    ratio = np.where(says, found / variance, 0.0)
    return Seen(adjustment.state.point[:, 2] * ratio, found)


def mixture(seen: Seen, roughness_m: Floats, off: Floats) -> Mixture:
    """The likeliest mixture of n points.

    Parameters
    ----------
    seen
        (n,) finite departures.
    roughness_m
        (n,) stated roughness of the ground under each, to which the relief that is found adds.
    off
        (n,) probabilities to start from.
    """
    best, most = Mixture(float(RELIEF_M[0]), off), -np.inf
    anywhere = _log_density(seen, ANYWHERE_M**2)
    for relief_m in RELIEF_M.tolist():
        ground = _log_density(seen, relief_m**2 + roughness_m**2)
        now = off
        for _ in range(ROUNDS):
            share = float(np.clip(now.mean(), LEAST_SHARE, MOST_SHARE))
            standing, lying = np.log(share) + anywhere, np.log1p(-share) + ground
            either = np.logaddexp(standing, lying)
            now = np.exp(standing - either)
        likely = float(either.sum()) - relief_m / USUAL_RELIEF_M
        if likely > most:
            best, most = Mixture(relief_m, now), likely
    return best


def _log_density(seen: Seen, variance_m2: Floats | float) -> Floats:
    variance = seen.variance_m2 + variance_m2
    return np.asarray(-0.5 * (seen.departure_m**2 / variance + np.log(variance)))


class LabelMisfit(NamedTuple):
    """How the picks of each label fit (K,): photos that show it, sum of squares, redundancy."""

    photos: Floats
    squares: Floats
    redundancy: Floats


def label_misfit(adjustment: Adjustment) -> LabelMisfit:
    """How the picks of each label fit."""
    survey, block = adjustment.survey, adjustment.minimum.blocks["pixels"]
    label, labels = survey.pick_label, len(survey.label)
    free = 1.0 - adjustment.covariance.leverage(block)
    pairs = np.unique(np.stack([label, survey.pick_frame]), axis=1)
    return LabelMisfit(
        np.bincount(pairs[0], minlength=labels).astype(np.float64),
        np.bincount(label, (block.residual**2).sum(axis=1), labels).astype(np.float64),
        np.bincount(label, free.sum(axis=1), labels).astype(np.float64),
    )
