"""Offset of a camera's clock from tie points: poses in free axes against those of a log.

Ties alone determine the relative poses of photos: their places up to a similarity, their directions
up to one rotation. At the right instants they fit the log's track; at others the worse the more the
flight turned, climbed or changed its speed between the photos.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from uavgram.geometry.motion.rotation import nearest_rotation
from uavgram.model.arrays import Floats

POSITION_M, ATTITUDE_RAD = 0.5, 0.02
"""Sigmas of a log, from photo to photo: the measured drift of receivers and estimators."""

MIN_MOTION_M = 2.0
"""Root mean square of a vehicle's distances from their mean, below which it was on the ground or
hovered [m]: photos whose ties determine their places were not taken then."""

MAX_HEIGHT_RATIO = 3.0
"""Largest ratio of the height over the ground and that over the lowest place flown, either way."""

FIT_ROUNDS = 4

UNKNOWN_COUNT = 10
"""Number of unknowns: scale, shift, rotation of the axes, and rotation of the camera in its
mount."""


class Fit(NamedTuple):
    """Sum of squares over the log's sigmas (infinite: not in this part of the flight).

    Attributes
    ----------
    cost
        Sum of squares.
    degrees
        Observations minus unknowns.
    """

    cost: float
    degrees: int


def fit_similarity(poses: tuple[Floats, Floats], flown: tuple[Floats, Floats]) -> Fit:
    """Fit the similarity and the mount that bring poses nearest to those of a log.

    The first rotation is by the places alone (Umeyama 1991); then attitudes contribute to it as
    well: with A of the vehicle and B of the camera in their own axes, A mount = turn B for all
    photos.

    Parameters
    ----------
    poses
        (N, 3), (N, 3, 3) of the cameras, over the ground, in any scale.
    flown
        (N, 3), (N, 3, 3) of the vehicle, over the lowest place where it was.
    """
    (center, own), (place, body) = poses, flown
    source, target = center - center.mean(axis=0), place - place.mean(axis=0)
    product = target.T @ source / POSITION_M**2
    turn = nearest_rotation(product)
    size = float(np.sum(source**2))
    # Alternate scale, mount and rotation, each in closed form for the others.
    for _ in range(FIT_ROUNDS):
        scale = max(float(np.sum(target * (source @ turn.T))) / size, 0.0)
        mount = nearest_rotation(np.einsum("nji,jk,nkl->il", body, turn, own))
        by_attitude = np.einsum("nij,jk,nlk->il", body, mount, own) / ATTITUDE_RAD**2
        turn = nearest_rotation(scale * product + by_attitude)
    scale = max(float(np.sum(target * (source @ turn.T))) / size, 0.0)
    here, there = scale * float(np.median(center[:, 2])), float(np.median(place[:, 2]))
    degrees = max(6 * len(center) - UNKNOWN_COUNT, 1)
    stood = np.sum(target**2) < len(target) * MIN_MOTION_M**2
    if stood or not there / MAX_HEIGHT_RATIO < here < there * MAX_HEIGHT_RATIO:
        return Fit(np.inf, degrees)
    off = np.sum((target - scale * source @ turn.T) ** 2) / POSITION_M**2
    # |A - B|^2 of two rotations by an angle a is 8 sin^2(a / 2).
    twist = np.sum((body @ mount - turn @ own) ** 2) / (2.0 * ATTITUDE_RAD**2)
    return Fit(float(off + twist), degrees)


STEP_S = 0.5
"""Step of the offsets that are tried [s]: a drone flies a few metres in it."""

OFFSET_ACCURACY_S = 0.02
"""Accuracy of the search of the best offset [s]."""

MIN_RIVAL_INCREASE = 25.0
"""Sum of squares by which another offset must be worse: five sigmas."""

MIN_RIVAL_DISTANCE_S = 2.0
"""Difference below which two offsets are the same [s]."""

MAX_MINIMA = 20
"""Largest number of minima that are refined."""

LAG_SIGMA_S = 0.05
"""Sigma of a common delay of a log's positions and attitudes [s]."""

FlightPoses = Callable[[Floats], tuple[Floats, Floats]]
"""Function that returns positions (N, 3) and attitudes (N, 3, 3) of a log's vehicle at instants
(N,)."""


@dataclass(frozen=True, eq=False)
class TiedClock:
    """Offset of a camera's clock from tie points.

    Attributes
    ----------
    offset_s, sigma_s
        Camera clock minus the log's, and its standard deviation.
    misfit
        Root mean square of the residuals, in sigmas of the log.
    rival_s
        Other offsets that fit as well.
    """

    offset_s: float
    sigma_s: float
    misfit: float
    rival_s: tuple[float, ...]


def estimate_tied_clock(
    poses: tuple[Floats, Floats], reading_s: Floats, flown: FlightPoses, span_s: tuple[float, float]
) -> TiedClock | None:
    """Estimate the best offset; None if no offset puts all photos into the log.

    Parameters
    ----------
    poses
        (N, 3), (N, 3, 3) places and attitudes of at least four photos, in axes of their own.
    reading_s
        (N,) readings of the camera's clock.
    flown, span_s
        Function of the log's poses, and start and end of the time in which it has them.
    """
    first = float(reading_s.max()) - span_s[1] + OFFSET_ACCURACY_S
    last = float(reading_s.min()) - span_s[0] - OFFSET_ACCURACY_S
    if first >= last:
        return None

    def at(offset_s: float) -> Fit:
        return fit_similarity(poses, flown(reading_s - offset_s))

    tried = np.linspace(first, last, max(int((last - first) / STEP_S) + 1, 3))
    cost = np.array([at(offset).cost for offset in tried.tolist()])
    if np.isinf(cost).all():
        return None
    around = np.pad(cost, 1, constant_values=np.inf)
    low = np.flatnonzero(np.isfinite(cost) & (cost <= around[:-2]) & (cost <= around[2:]))
    low = low[np.argsort(cost[low])][:MAX_MINIMA]
    found = sorted(_refine(at, float(tried[k]), (first, last)) for k in low.tolist())
    least, best = found[0]
    square = least / at(best).degrees
    scale = max(square, 1.0)
    # If the cost hardly rises, neighbouring offsets fit as well, although they are no minima.
    every = [*found, *zip(cost.tolist(), tried.tolist(), strict=True)]
    rivals: list[float] = []
    for cost_there, offset in sorted(every):
        apart = min(abs(offset - other) for other in (best, *rivals))
        if cost_there < least + MIN_RIVAL_INCREASE * scale and apart > MIN_RIVAL_DISTANCE_S:
            rivals.append(offset)
    sigma = _sigma(at, best, scale, (first, last))
    return TiedClock(best, sigma, float(np.sqrt(square)), tuple(rivals))


def _refine(
    at: Callable[[float], Fit], offset_s: float, bounds: tuple[float, float]
) -> tuple[float, float]:
    """Refine a tried minimum by halving the step; return cost and offset."""
    step, best = STEP_S, (at(offset_s).cost, offset_s)
    while step > OFFSET_ACCURACY_S:
        step *= 0.5
        near = [float(np.clip(best[1] + way * step, *bounds)) for way in (-1, 1)]
        best = min([best, *((at(o).cost, o) for o in near)])
    return best


def _sigma(
    at: Callable[[float], Fit], offset_s: float, scale: float, bounds: tuple[float, float]
) -> float:
    """Compute the sigma from the rise of the cost on both sides, over the scatter."""
    low, high = max(offset_s - STEP_S, bounds[0]), min(offset_s + STEP_S, bounds[1])
    here = at(offset_s).cost
    rise = max(
        (at(side).cost - here) / (side - offset_s) ** 2 for side in (low, high) if side != offset_s
    )
    return float(np.hypot(np.sqrt(scale / max(rise, 1e-12)), LAG_SIGMA_S))
