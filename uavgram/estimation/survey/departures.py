"""Heights of the ground over its plane, and of points over the ground."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.unknowns import State
from uavgram.model.arrays import Floats


def compute_departures(adjustment: Adjustment) -> tuple[Floats, Floats]:
    """Compute the heights of the ground under all points over the plane of their area.

    Roughness and relief together: heights of the points over the plane, minus the stated heights.

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
    rough = np.zeros_like(state.point[:, 2:])
    rough[adjustment.problem.third.rough] = 1.0
    departure = relief.height_m + np.sum(rough * state.point[:, 2:], axis=1)
    unknowns = adjustment.problem.plane_columns(label)
    # Only relief and roughness count: the plane's own unknowns get no derivative.
    by_relief = np.where(unknowns >= layout.first_relief, relief.by_unknowns, 0.0)
    gradient = np.concatenate([relief.slope, rough, by_relief], axis=1)
    columns = np.concatenate([layout.point_columns(label), unknowns], axis=1)
    joint = adjustment.covariance.blocks(columns)
    # Error propagation: g^T C g for each point.
    variance = np.einsum("ni,nij,nj->n", gradient, joint, gradient, optimize=True)
    return departure, np.sqrt(np.maximum(variance, 0.0))


def compute_heights(adjustment: Adjustment) -> tuple[Floats, Floats]:
    """Compute the heights of all points over the smooth ground below, as stated or estimated.

    The ground right below a point may depart from the smooth one by its roughness, which the sigma
    of an estimated height contains.

    Returns
    -------
    height_m, sigma_m : (K,)
        Both 0 for points on the ground.
    """
    survey, problem = adjustment.survey, adjustment.problem
    height, sigma = compute_heights_at(adjustment, adjustment.state), np.zeros(len(survey.label))
    roughness = np.array([ground.roughness_sigma_m for ground in survey.grounds])[survey.area]
    own = np.union1d(problem.third.stated, problem.third.free)
    if len(own):
        column = problem.layout.point_columns(own)[:, 2:]
        variance = adjustment.covariance.blocks(column)[:, 0, 0]
        sigma[own] = np.sqrt(variance + roughness[own] ** 2)
    return height, sigma


def compute_heights_at(adjustment: Adjustment, state: State) -> Floats:
    """Return the (K,) heights over the smooth ground below, at a state of the unknowns."""
    height = np.array(adjustment.survey.height_above_m)
    own = np.union1d(adjustment.problem.third.stated, adjustment.problem.third.free)
    if len(own):
        height[own] += state.point[own, 2]
    return height
