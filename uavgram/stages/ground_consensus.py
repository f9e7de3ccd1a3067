"""Consensus of labels on the ground: which points are on it, though any of them may be off it.

Errors of the poses raise or tilt all points together, so the height of a single point does not show
whether it is on the ground. The heights of all points are judged together. Each has a mixture of
two priors: on the ground, or anywhere above it. Expectation propagation (Minka 2001) approximates
the posterior: the mixture of each point is replaced in turn by the normal distribution with the
same moments, given all others. The result depends on the start and may be another plane, such as
that of roofs. Therefore it starts from the likeliest of several triples of points that are assumed
to be on the ground (Fischler and Bolles 1981).
"""

from __future__ import annotations

import numpy as np
from scipy.special import logsumexp

from uavgram.model.arrays import Bools, Floats, Ints

RAISED_HEIGHTS_M = np.geomspace(0.25, 10.0, 60)
"""Heights of points off the ground [m], each equally likely: of a door sill to the ridge of a
house."""

UNKNOWN_SIGMA_M = 10.0
"""Sigma of a height without any information [m]."""

MISTAKE_PROBABILITY = 0.01
"""Probability that a point has neither such a height nor that of the ground: it is another thing in
some photo."""

NEAR_SIGMAS = 3.0
"""Height in sigmas of the ground's roughness up to which a point may be of rough ground."""

MAX_ROUGHNESS_M = RAISED_HEIGHTS_M[0]
"""Largest sigma of points about the ground [m]: higher ones are off it."""

TRIED, SEED = 300, 1
"""Number of triples of points of which the likeliest begins the approximation; with a fifth of all
points on the ground, one of them is on it with a probability of 0.9."""

ROUNDS, DAMPING = 40, 0.5
"""Number of rounds, and share of the change that a round makes: less than 1, as all points change
at once."""


def find_ground_points(
    height_m: Floats, covariance_m2: Floats, roughness_m: Floats, odds: float = 1.0
) -> Bools:
    """Mark points (n,) that are more likely on the ground, or near it, than off it.

    Parameters
    ----------
    height_m, covariance_m2
        (n,), (n, n) heights above the ground that the photos show, without any assumption on them.
    roughness_m
        (n,) least sigmas of points on the ground.
    odds
        Odds that a point is on the ground, before.
    """
    step = np.gradient(RAISED_HEIGHTS_M)  # each represents the heights up to the next one
    middle = np.concatenate([[0.0], RAISED_HEIGHTS_M, [0.0]])
    spread = np.tile(np.concatenate([[0.0], step, [UNKNOWN_SIGMA_M]]) ** 2, (len(height_m), 1))
    spread[:, 0] = least = roughness_m**2
    most = np.maximum(least, MAX_ROUGHNESS_M**2)
    ground = (1.0 - MISTAKE_PROBABILITY) * odds / (1.0 + odds)
    raised = (1.0 - MISTAKE_PROBABILITY - ground) / len(RAISED_HEIGHTS_M)
    share = np.concatenate(
        [[ground], np.full(len(RAISED_HEIGHTS_M), raised), [MISTAKE_PROBABILITY]]
    )
    # Approximation of each point's mixture: its precision, and precision times mean.
    precision, pull = np.zeros((2, len(height_m)))
    first = _choose_first_points(height_m, covariance_m2, (middle, spread, share))
    precision[first] = 1.0 / least[first]
    is_low = middle <= NEAR_SIGMAS * roughness_m[:, None]
    is_low[:, -1] = False
    is_near = np.zeros(len(height_m))
    for _ in range(ROUNDS):
        # All points given these: a Kalman update of the heights.
        root = np.sqrt(precision)
        inner = np.eye(len(root)) + root[:, None] * covariance_m2 * root
        gain = covariance_m2 * root @ np.linalg.inv(inner)
        variance = np.diag(covariance_m2) - ((gain * root) * covariance_m2).sum(axis=1)
        update = pull - precision * height_m
        mean = height_m + covariance_m2 @ update - gain @ (root * (covariance_m2 @ update))
        # Each one without its own, times its mixture.
        others = 1.0 / np.maximum(1.0 / variance - precision, 1e-9)
        at = others * (mean / variance - pull)
        wide = others[:, None] + spread
        each = np.log(share) - 0.5 * ((at[:, None] - middle) ** 2 / wide + np.log(wide))
        each = np.exp(each - logsumexp(each, axis=1, keepdims=True))
        is_ground = each[:, 0]
        is_near = (each * is_low).sum(axis=1)
        place = (at[:, None] * spread + middle * others[:, None]) / wide
        mixed = (each * place).sum(axis=1)
        mixed_variance = (each * (others[:, None] * spread / wide + place**2)).sum(axis=1)
        mixed_variance -= mixed**2
        # The ground may be rougher than stated: its variance, by expectation maximisation.
        size = is_ground @ (others * spread[:, 0] / wide[:, 0] + place[:, 0] ** 2)
        spread[:, 0] = np.clip(size / max(is_ground.sum(), 1.0), least, most)
        # Normal distribution of the same moments; a mixture wider than the others shows nothing.
        own = np.maximum(1.0 / mixed_variance - 1.0 / others, 0.0)
        own_pull = np.where(own > 0, mixed / mixed_variance - at / others, 0.0)
        precision = precision + DAMPING * (own - precision)
        pull = pull + DAMPING * (own_pull - pull)
    return np.asarray(is_near > 0.5)


def _choose_first_points(
    height_m: Floats, covariance_m2: Floats, mixture: tuple[Floats, Floats, Floats]
) -> Ints:
    """Choose the three points that explain the others best if they are on the ground.

    Parameters
    ----------
    height_m, covariance_m2
        As for `find_ground_points`.
    mixture
        Means (m,), variances (n, m) and shares (m,) of the components of each point; the first one
        is the ground.
    """
    middle, spread, share = mixture
    n, rng = len(height_m), np.random.default_rng(SEED)
    best, highest = np.zeros(0, dtype=np.int64), -np.inf
    for _ in range(TRIED if n > 3 else 0):
        some = rng.choice(n, 3, replace=False)
        among = covariance_m2[np.ix_(some, some)] + np.diag(spread[some, 0])
        gain = np.linalg.solve(among, covariance_m2[some]).T
        off = height_m - gain @ height_m[some]
        variance = np.diag(covariance_m2) - (gain * covariance_m2[:, some]).sum(axis=1)
        wide = np.maximum(variance, 0.0)[:, None] + spread
        each = np.log(share) - 0.5 * ((off[:, None] - middle) ** 2 / wide + np.log(wide))
        others = np.delete(logsumexp(each, axis=1), some).sum()
        own = height_m[some] @ np.linalg.solve(among, height_m[some])
        likelihood = others - 0.5 * (own + np.linalg.slogdet(among)[1])
        if likelihood > highest:
            best, highest = some, likelihood
    return best
