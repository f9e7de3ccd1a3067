"""Poses of frames from nearly one place: hovering, a camera only turns between them.

What they share has no parallax, so no pose follows from two such frames alone: but where one of
them has its pose, the others have it too, but for a turn, which a few shared points tell.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.estimation.first_poses.tied.survey_rays import tied_rays
from uavgram.estimation.first_poses.tied.tied_rays import TiedRays
from uavgram.geometry.motion.rotation import nearest_rotation
from uavgram.model.arrays import Floats
from uavgram.model.survey.survey import Survey

FEWEST = 10
"""Points that two frames must share, and that must fit the turn between them."""

TYPICAL_RAD = 0.01
"""Angle by which rays typically may miss after the turn: a hundredth of the distance flown."""

AGREE = 3.0
"""Typical misses up to which a ray takes part in the turn."""

ROUNDS = 10


def with_turned(survey: Survey, center: Floats, rotation: Floats) -> tuple[Floats, Floats]:
    """The poses (F, 3), (F, 3, 3), also of frames that only turned from one that has a pose.

    Parameters
    ----------
    survey
        What the frames share.
    center, rotation
        World from camera; NaN for frames without a pose.
    """
    missing = np.isnan(center[:, 0])
    if not survey.ties.points + survey.matches.points or missing.all() or not missing.any():
        return center, rotation
    return spread(center, rotation, tied_rays(survey)[0])


def spread(center: Floats, rotation: Floats, sightings: TiedRays) -> tuple[Floats, Floats]:
    """Poses handed on from frame to frame, each time between the two that share most.

    Parameters
    ----------
    center, rotation
        (F, 3), (F, 3, 3) world from camera; NaN for frames without a pose.
    sightings
        What the frames share.
    """
    center, rotation = center.copy(), rotation.copy()
    shared = sightings.shared()
    placed = np.isfinite(center[:, 0])
    tried = np.zeros_like(shared, dtype=np.bool_)
    while True:
        count = np.where(placed[:, None] & ~placed[None] & ~tried, shared, 0)
        known, new = np.unravel_index(int(np.argmax(count)), count.shape)
        if count[known, new] < FEWEST:
            return center, rotation
        tried[known, new] = True
        one, other = sightings.of_pair(int(new), int(known))
        turn = turn_between(sightings.ray[one], sightings.ray[other])
        if turn is not None:
            center[new], rotation[new] = center[known], rotation[known] @ turn
            placed[new] = True


def turn_between(first: Floats, second: Floats) -> Floats | None:
    """(3, 3) what turns most rays of a camera onto those of a second one; None where none does.

    Parameters
    ----------
    first, second
        (n, 3) unit rays to the same points.
    """
    turn = best_turn(first, second)
    enough = turn.agree >= max(FEWEST, len(first) // 2)
    return turn.rotation if enough and turn.miss_rad <= TYPICAL_RAD else None


class Turn(NamedTuple):
    """Rays of a second camera are about rotation @ those of the first.

    Attributes
    ----------
    rotation
        (3, 3).
    miss_rad
        How far they typically pass each other then: the parallax.
    agree
        How many do not pass much further.
    """

    rotation: Floats
    miss_rad: float
    agree: int


def best_turn(first: Floats, second: Floats) -> Turn:
    """What turns rays onto others best; those that miss far, as wrong ones do, have no say.

    Parameters
    ----------
    first, second
        (n, 3) unit rays to the same points, n >= 1.
    """
    good = np.ones(len(first), dtype=np.bool_)
    for _ in range(ROUNDS):
        rotation = nearest_rotation(second[good].T @ first[good])
        miss = np.linalg.norm(second - first @ rotation.T, axis=1)
        typical = float(np.median(miss))
        near = miss <= AGREE * typical + 1e-12
        if (near == good).all():
            break
        good = near
    return Turn(rotation, typical, int(good.sum()))
