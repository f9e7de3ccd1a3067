"""Height of the ground where nothing but known coordinates tells it."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.first_poses.network import placing
from uavgram.model.survey.survey import Survey


def known_height(survey: Survey) -> float:
    """Height of the ground under control points, else under lines of known position.

    Of control points those whose own height is not known count where all do. Then it is the lowest:
    they stand on it or above it. Where lines have no heights, that of the ground beforehand.
    """
    label, up = survey.control_label, survey.control_world_m[:, 2]
    if not len(label):
        lines = [one.position for one in survey.known if one.position is not None]
        heights = [line.ends_m[:, 2].mean() for line in lines if line.has_height]
        return float(np.median(heights)) if heights else survey.ground.height_m
    level = placing(survey)[label]
    if not level.any():
        return float(up.min())
    return float(np.mean((up - survey.height_above_m[label])[level]))
