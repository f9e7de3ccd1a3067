"""Profiles: where points lie along a line, and how high, with their standard deviations."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.measuring.kinds import ground_below
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.geometry.ground.heights import profile
from uavgram.model.arrays import Floats, Ints
from uavgram.model.result.profiles import COLUMNS, ProfileResults
from uavgram.model.survey.observations import MeasurementRequest


def profiles(adjustment: Adjustment, requests: tuple[MeasurementRequest, ...]) -> ProfileResults:
    """All profiles that were asked for, but those that have no direction or a point unseen."""
    names: list[str] = []
    labels: list[str] = []
    tables = [np.zeros((0, 2, len(COLUMNS)))]
    for request in requests:
        label = adjustment.label_rows(request.points)
        if request.kind != "profile" or label.min() < 0:
            continue
        table = _profile(adjustment, label)
        if np.isfinite(table).all():
            names += [request.name] * len(label)
            labels += request.points
            tables.append(table)
    rows = np.concatenate(tables)
    return ProfileResults(
        profile=tuple(names), label=tuple(labels), place_m=rows[:, 0], sigma_m=rows[:, 1]
    )


def _profile(adjustment: Adjustment, label: Ints) -> Floats:
    """(n, 2, 4) places along a profile, and their standard deviations; NaN without a direction."""
    world, jacobian, columns = adjustment.points_with_jacobian(label)
    feet, of_feet, foot_columns = adjustment.ground_with_jacobian(label)
    below = ground_below(adjustment.survey, label, world, feet)
    of_feet = np.where(below.told[:, None, None], jacobian, of_feet)
    foot_columns = np.where(below.told[:, None], columns, foot_columns)
    along = profile(world)
    n = len(label)
    # The ground below over the first point: what lies under a point less the point over the first.
    ground = below.feet[:, 2] - world[0, 2]
    by_points = np.zeros((n, 4, n, 3))
    by_points[:, :3] = along.gradient
    by_points[:, 3, 0, 2] = -1.0
    by_feet = np.zeros((n, 4, n, 3))
    by_feet[np.arange(n), 3, np.arange(n), 2] = 1.0
    unknowns = np.unique(np.concatenate([columns, foot_columns]))
    gradient = np.einsum("apni,niu->apu", by_points, _dense(jacobian, columns, unknowns))
    gradient += np.einsum("apni,niu->apu", by_feet, _dense(of_feet, foot_columns, unknowns))
    joint = adjustment.minimum.factor.joint(unknowns)
    variance = np.einsum("apu,uv,apv->ap", gradient, joint, gradient, optimize=True)
    variance[:, 3] += below.sigma_m**2
    value = np.column_stack([along.value, ground])
    return np.stack([value, np.sqrt(np.maximum(variance, 0.0))], axis=1)


def _dense(jacobian: Floats, columns: Ints, unknowns: Ints) -> Floats:
    """(n, 3, u) Jacobians by all of the unknowns (u,)."""
    dense = np.zeros((*jacobian.shape[:2], len(unknowns)))
    place = np.searchsorted(unknowns, columns)
    rows = np.arange(len(jacobian))[:, None, None]
    np.add.at(dense, (rows, np.arange(3)[:, None], place[:, None, :]), jacobian)
    return dense
