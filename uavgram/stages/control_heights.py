"""Control points have their own heights: where these are on no plane, neither are the points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.estimation.reliability.redundancy import upper_tail
from uavgram.model.arrays import Floats
from uavgram.model.survey.survey import Survey

SIGNIFICANCE = 1e-4
"""Probability below which the heights of an area's control points are on no plane."""


def with_own_heights(survey: Survey) -> Survey:
    """Free the heights of an area's control points where no plane of the ground goes through them.

    Where one does, they say where it is. A height above the ground that is stated holds.
    """
    free = np.array(survey.is_free)
    for area, ground in enumerate(survey.grounds):
        own = (survey.area == area) & ~survey.off_ground
        rows = np.flatnonzero(own[survey.control_label])
        sigma = np.hypot(survey.control_sigma_m[rows, 2], ground.roughness_sigma_m)
        squares = _misfit(survey.control_world_m[rows], sigma, ground.slope_sigma_rad)
        if upper_tail(squares, len(rows) - 1.0) < SIGNIFICANCE:
            free[survey.control_label[rows]] = True
    return replace(survey, is_free=free)


def _misfit(place_m: Floats, sigma_m: Floats, slope_sigma: float) -> float:
    """Weighted sum of squares of heights about a plane of unknown height, level up to its sigma.

    Parameters
    ----------
    place_m, sigma_m
        (n, 3), (n,) points, and how well each height is that of the plane.
    slope_sigma
        Prior of the plane's slopes about level; n - 1 degrees of freedom are left.
    """
    if len(place_m) < 2:
        return 0.0
    place = place_m - place_m.mean(axis=0)
    design = np.column_stack([np.ones(len(place)), place[:, :2]]) / sigma_m[:, None]
    design = np.concatenate([design, np.eye(3)[1:] / slope_sigma])
    height = np.append(place[:, 2] / sigma_m, [0.0, 0.0])
    return float(np.sum((height - design @ np.linalg.lstsq(design, height)[0]) ** 2))
