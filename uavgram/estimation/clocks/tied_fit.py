"""How well poses in axes of their own go with those of a log, for a camera mounted anyhow."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.geometry.motion.rotation import nearest_rotation
from uavgram.model.arrays import Floats

POSITION_M, ATTITUDE_RAD = 0.5, 0.02
"""Sigmas of a log, from photo to photo: what receivers and estimators were measured to wander."""

STOOD_M = 2.0
"""Root mean square of a vehicle's distances from their middle, below which it stood or hovered:
photos whose ties tell where they were taken were not taken then."""

OTHER_HEIGHT = 3.0
"""Factor by which the height over the ground may differ from that over the lowest place flown."""

ROUNDS = 4

UNKNOWN = 10
"""Scale, shift, turn of the axes, and turn of the camera in its mount."""


class Fit(NamedTuple):
    """Sum of squares over the log's sigmas (infinite: not of this part of the flight).

    Attributes
    ----------
    cost
        The sum.
    degrees
        Observations less unknowns.
    """

    cost: float
    degrees: int


def fit(poses: tuple[Floats, Floats], flown: tuple[Floats, Floats]) -> Fit:
    """The similarity and the mount that bring poses nearest to those of a log.

    Places alone begin (Umeyama 1991); then attitudes have a say in the turn as well: with A of the
    vehicle and B of the camera in their own axes, A mount = turn B for all photos.

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
    for _ in range(ROUNDS):
        scale = max(float(np.sum(target * (source @ turn.T))) / size, 0.0)
        mount = nearest_rotation(np.einsum("nji,jk,nkl->il", body, turn, own))
        by_attitude = np.einsum("nij,jk,nlk->il", body, mount, own) / ATTITUDE_RAD**2
        turn = nearest_rotation(scale * product + by_attitude)
    scale = max(float(np.sum(target * (source @ turn.T))) / size, 0.0)
    here, there = scale * float(np.median(center[:, 2])), float(np.median(place[:, 2]))
    degrees = max(6 * len(center) - UNKNOWN, 1)
    stood = np.sum(target**2) < len(target) * STOOD_M**2
    if stood or not there / OTHER_HEIGHT < here < there * OTHER_HEIGHT:
        return Fit(np.inf, degrees)
    off = np.sum((target - scale * source @ turn.T) ** 2) / POSITION_M**2
    # |A - B|^2 of two rotations by an angle a is 8 sin^2(a / 2).
    twist = np.sum((body @ mount - turn @ own) ** 2) / (2.0 * ATTITUDE_RAD**2)
    return Fit(float(off + twist), degrees)
