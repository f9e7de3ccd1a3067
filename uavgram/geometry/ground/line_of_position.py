"""How far points lie beside a line whose ends have known coordinates, and how its errors act."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Floats

FARTHEST = 2.0
"""In lengths of the line from its start (and as far before it): what lies further out counts no
less, or an adjustment could run away along a line to where its direction says nothing."""


class Beside(NamedTuple):
    """Of k points by m axes: across the line in plan, to the left; then, if asked for, up.

    Attributes
    ----------
    value
        (k, m) offsets [m].
    gradient
        (k, m, 3) by the points.
    by_ends
        (k, m, 2, 3) by the coordinates of the line's start and end.
    """

    value: Floats
    gradient: Floats
    by_ends: Floats


def beside_line(points: Floats, ends: Floats, *, upwards: bool) -> Beside:
    """Offsets of points from a line.

    Parameters
    ----------
    points
        (k, 3) east, north, up [m].
    ends
        (2, 3) start and end of the line, apart in plan.
    upwards
        Whether to tell how far points lie above it, too: straight up.

    Notes
    -----
    With the plan direction d (a unit vector), n square to it and the share t of the way from start
    A to end B at which P lies: across = n.(P - A), up = P_u - A_u - t (B_u - A_u). An error of A
    turns the line about B, so it moves the line at P by 1 - t of it; one of B by t. These hold for
    points on the line, to first order; so do the derivatives by the ends.
    """
    start, ahead = ends[0], ends[1] - ends[0]
    length = float(np.hypot(*ahead[:2]))
    along = ahead[:2] / length
    across = np.array([-along[1], along[0], 0.0])
    away = points - start
    share = away[:, :2] @ along / length
    rise = ahead[2] / length
    up = np.array([*(-rise * along), 1.0])
    axes = np.stack([across, up])[: 1 + upwards]
    value = away @ axes.T
    lever = np.clip(share, -FARTHEST + 1.0, FARTHEST)
    levers = np.stack([1.0 - lever, lever], axis=1)
    gradient = np.broadcast_to(axes, (len(points), *axes.shape))
    return Beside(value, gradient, -levers[:, None, :, None] * axes[None, :, None, :])


def joint_covariance(by_ends: Floats, sigma_m: Floats, own_m: float) -> Floats:
    """Covariance (k m, k m) of all offsets from one line, which share the errors of its ends.

    Parameters
    ----------
    by_ends
        (k, m, 2, 3) as `beside_line` gives.
    sigma_m
        (2, 3) of start and end: east, north, up.
    own_m
        Sigma of each offset's own.
    """
    rows = (by_ends * sigma_m).reshape(len(by_ends) * by_ends.shape[1], -1)
    return np.asarray(rows @ rows.T + own_m**2 * np.eye(len(rows)))


def inverse_root(covariance: Floats) -> Floats:
    """The symmetric W with W W = covariance^-1.

    Of all whitenings the one whose rows stay closest to what they are made of (Kessy, Lewin and
    Strimmer 2018, "Optimal whitening and decorrelation"), so a row is still that of its point.
    """
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray((vectors / np.sqrt(values)) @ vectors.T)
