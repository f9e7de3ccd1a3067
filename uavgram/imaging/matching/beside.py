"""Small windows that contain a point, each with a larger share of one side of it.

About a corner that is off the ground, some of them show the object, the others the background
behind its edge: they do not move alike from photo to photo (shiftable windows: Kang, Szeliski and
Chai 2001, "Handling occlusions in dense multi-view stereo").
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.imaging.matching.least_squares import Fitted
from uavgram.imaging.patches import Grey, grid, sample
from uavgram.model.arrays import Bools, Floats

SUPPORT = 5
"""Half the side of a window [steps]."""

EVEN = 4.0
"""Standard deviation [grey values] up to which a window has too little texture to be used."""


class Windows(NamedTuple):
    """Set of w windows about a point.

    Attributes
    ----------
    grid
        (s, 2) places that they cover together, about the point.
    middle
        (w, 2) centre of each window.
    weight
        (w, s) weights of the places; each window's sum is 1.
    """

    grid: Floats
    middle: Floats
    weight: Floats

    def likeness(self, own: Grey, there: Grey) -> tuple[Floats, Floats]:
        """Correlate values (..., s) with the source's values (s,) in each window.

        Returns
        -------
        The correlations (..., w), and the variances (w,) of the source's values.
        """
        mean, middle = self.weight @ own, there @ self.weight.T
        variance = self.weight @ own**2 - mean**2
        spread = np.maximum(there**2 @ self.weight.T - middle**2, 1.0)
        both = (there * own) @ self.weight.T - middle * mean
        return both / np.sqrt(spread * np.maximum(variance, 1.0)), variance


def windows_beside(aside: int) -> Windows:
    """Create windows centred on the point, and `aside` steps from it in either direction."""
    places, middle = grid(SUPPORT + aside), aside * grid(1)
    away = places - middle[:, None]
    within = (np.abs(away) <= SUPPORT).all(axis=2)
    weight = np.where(within, np.exp(-2.0 * (away**2).sum(axis=2) / SUPPORT**2), 0.0)
    return Windows(places, middle, weight / weight.sum(axis=1, keepdims=True))


_ASIDE = 3  # steps: the edges at the point are in every window
_SIDES = windows_beside(_ASIDE)
_OTHERS: Floats = np.array([0.0, -4.0, -3.0, 3.0, 4.0])  # steps along the line of sight
_MOST = 0.75  # largest ratio of dissimilarity at the match to that at the other places
_UNSURE = 0.1  # of the noise: chance variation in a window
_NOISE = 0.25  # variance of the difference of two windows of the same area [grey values squared]


def fixed_on_all_sides(near: Grey, far: Grey, there: Fitted, along: Floats) -> Bools:
    """Mark the points (m,) whose surroundings all match at one place along the line of sight.

    Parameters
    ----------
    near, far
        (m, s, s) windows about the point, and about the searched place.
    there
        Match of the first in the second.
    along
        (m, 2) direction of the line of sight there; 0 where the place along it is known.
    """
    edge = near.shape[1] // 2 - SUPPORT - _ASIDE
    fixed = np.ones(len(near), np.bool_)
    for i in np.flatnonzero(along.any(axis=1)).tolist():
        start = _SIDES.grid @ there.linear[i].T + there.place[i] + far.shape[1] // 2
        aside = _OTHERS[:, None, None] * along[i] / np.hypot(*along[i])
        u, v = np.moveaxis(start + aside, -1, 0)
        seen = sample(far[i], u, v)
        like, variance = _SIDES.likeness(near[i, edge:-edge, edge:-edge].ravel(), seen)
        unlike = variance * (1.0 - like)
        noise = np.median(unlike[0])  # of both photos
        here, *others = (unlike - noise)[:, variance > EVEN**2]
        # Every textured window must match clearly better here than at any other place along the
        # line.
        most = _MOST * np.min(others, axis=0)
        fixed[i] = (here + _UNSURE * noise + _NOISE <= most).all()
    return fixed
