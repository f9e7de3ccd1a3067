"""Mean and variance of values to second order, from what they are where normal errors are moved.

With slopes g and second derivatives H by independent errors of sigma 1, a value's mean is off by
tr(H) / 2, and its variance is g^T g + tr(H H) / 2 (Magnus 1978, "The moments of products of
quadratic forms in normal variables"; so too Criminisi 1997). H is taken from values at both ends of
each direction, and of each pair of directions.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Floats

REACH = float(np.sqrt(3.0))
"""Sigmas by which errors are moved, as in the unscented transform (Julier & Uhlmann 2004, with
n + kappa = 3, which meets the fourth moment of the normal distribution)."""


class SecondOrderTerms(NamedTuple):
    """What second order adds to M values: to the mean, and to the variance; (M,) each."""

    bias: Floats
    variance: Floats


def moves(directions: Floats) -> Floats:
    """By how much errors are moved, both ways: (d (d + 1), n) of d orthonormal directions (d, n).

    First along each direction, then along the sum of each two.
    """
    first, second = np.triu_indices(len(directions), 1)
    ways = np.concatenate([directions, directions[first] + directions[second]])
    return REACH * np.concatenate([ways, -ways])


def second_order_terms(values: Floats, middle: Floats) -> SecondOrderTerms:
    """Terms of values (S, M) at `moves`, in their order, and (M,) without any move.

    NaN where one of the values is.
    """
    ahead, behind = np.split(values - middle, 2)
    bent = (ahead + behind) / REACH**2
    count = (int(np.sqrt(8 * len(bent) + 1)) - 1) // 2
    first, second = np.triu_indices(count, 1)
    own = bent[:count]
    mixed = 0.5 * (bent[count:] - own[first] - own[second])
    variance = 0.5 * np.sum(own**2, axis=0) + np.sum(mixed**2, axis=0)
    return SecondOrderTerms(0.5 * own.sum(axis=0), variance)
