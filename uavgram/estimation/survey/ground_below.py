"""The ground straight below points: where it is, and what tells."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey.survey import Survey


class GroundBelow(NamedTuple):
    """The ground straight below k points.

    Attributes
    ----------
    feet
        (k, 3) places on it [m].
    told
        (k,) where the point tells them: it stands on the ground, or as high over it as is stated
        without a sigma. Then the foot moves with the point.
    sigma_m
        (k,) how rough the ground is there: its own departure from the smooth one. 0 where the
        point tells where it is.
    """

    feet: Floats
    told: Bools
    sigma_m: Floats


def ground_below(survey: Survey, label: Ints, points: Floats, feet: Floats) -> GroundBelow:
    """The ground below points, of which it is known that some stand on it.

    Parameters
    ----------
    survey
        Which do.
    label
        (k,) of the points, by index.
    points, feet
        (k, 3) and the places on the smooth ground straight below them [m].
    """
    told = np.asarray((survey.height_sigma_m[label] == 0) & ~survey.is_free[label])
    roughness = np.array([survey.grounds[a].roughness_sigma_m for a in survey.area[label]])
    below = points - np.outer(survey.height_above_m[label], [0.0, 0.0, 1.0])
    return GroundBelow(np.where(told[:, None], below, feet), told, np.where(told, 0.0, roughness))
