"""Ground straight below points."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey import Survey


class GroundBelow(NamedTuple):
    """Ground straight below k points.

    Attributes
    ----------
    feet
        (k, 3) places on it [m].
    is_determined
        (k,) whether the point determines its place on the ground: the point is on the ground, or at
        a height over it that is stated without a sigma. Then the foot moves with the point.
    sigma_m
        (k,) roughness of the ground there, its departure from the smooth one [m]; 0 where the point
        determines the place.
    """

    feet: Floats
    is_determined: Bools
    sigma_m: Floats


def find_ground_below(survey: Survey, label: Ints, points: Floats, feet: Floats) -> GroundBelow:
    """Compute the places on the ground below points, some of which are known to be on it.

    Parameters
    ----------
    survey
        Survey, which holds the heights of the points above the ground.
    label
        (k,) labels of the points, by index.
    points, feet
        (k, 3) points, and the places on the smooth ground straight below them [m].
    """
    is_determined = np.asarray((survey.height_sigma_m[label] == 0) & ~survey.is_free[label])
    roughness = np.array([survey.grounds[a].roughness_sigma_m for a in survey.area[label]])
    below = points - np.outer(survey.height_above_m[label], [0.0, 0.0, 1.0])
    return GroundBelow(
        np.where(is_determined[:, None], below, feet),
        is_determined,
        np.where(is_determined, 0.0, roughness),
    )
