"""How far the ground of an adjusted survey lies off its planes, point by point."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.arrays import Floats


def departures(adjustment: Adjustment) -> tuple[Floats, Floats]:
    """Heights of the ground under all points over the plane of their area.

    Roughness and relief together: heights of the points over the plane, less what was stated.

    Returns
    -------
    departure_m, sigma_m : (K,)
        Both 0 where the ground is a plane.
    """
    layout, state, ground = adjustment.problem.layout, adjustment.state, adjustment.problem.ground
    if layout.point_size < 3 and not layout.relief:
        return np.zeros(layout.points), np.zeros(layout.points)
    label = np.arange(layout.points)
    relief = ground.at(np.zeros_like(state.plane), state.relief, label, state.point[:, :2])
    rough = np.ones_like(state.point[:, 2:]) * (ground.roughness_sigma_m > 0)[:, None]
    departure = relief.height_m + np.sum(rough * state.point[:, 2:], axis=1)
    unknowns = adjustment.problem.plane_columns(label)
    by_relief = np.where(unknowns >= layout.first_relief, relief.by_unknowns, 0.0)
    gradient = np.concatenate([relief.slope, rough, by_relief], axis=1)
    columns = np.concatenate([layout.point_columns(label), unknowns], axis=1)
    joint = adjustment.covariance.blocks(columns)
    variance = np.einsum("ni,nij,nj->n", gradient, joint, gradient, optimize=True)
    return departure, np.sqrt(np.maximum(variance, 0.0))
