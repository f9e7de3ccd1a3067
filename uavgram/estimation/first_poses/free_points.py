"""First values of points whose height is free: where the rays of their picks meet."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.first_poses.meeting import meeting
from uavgram.estimation.first_poses.network import FirstValues
from uavgram.geometry.ground.plane import intersect_ground
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey.survey import Survey

WIDE = 0.1
"""Standard deviation of where rays meet, as a share of how far away that is, from which on they say
nothing: as a rule they then come from one place."""


def with_free_points(survey: Survey, ray: Floats, values: FirstValues) -> FirstValues:
    """First values with the places of the points whose height is free.

    A point gets none (NaN) where its rays say nothing, unless its coordinates or something else
    known of it may tell: such a point begins at its coordinates, or on the ground.

    Parameters
    ----------
    survey
        The observations.
    ray
        (P, 3) of its picks, in their cameras.
    values
        With poses.
    """
    free = np.flatnonzero(survey.is_free)
    if not len(free):
        return values
    frame, label = survey.pick_frame, survey.pick_label
    rows = np.flatnonzero(survey.is_free[label] & np.isfinite(values.center[frame, 0]))
    center, owner = values.center[frame[rows]], label[rows]
    direction = np.einsum("nij,nj->ni", values.rotation[frame[rows]], ray[rows])
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    sigma = survey.pick_sigma_px[rows] / survey.calibration.parameters[0]
    met, spread = meeting(center, direction, sigma, owner, len(survey.label))
    plane = np.array([values.height_m, 0.0, 0.0])
    ground = intersect_ground(center, direction, plane, np.zeros(2), np.zeros(len(rows)))
    point = _means(ground, owner, len(survey.label))
    point[survey.control_label] = survey.control_world_m
    anchored = np.zeros(len(survey.label), dtype=np.bool_)
    for known in (survey.control_label, survey.line_start, survey.line_end):
        anchored[known] = True
    for thing in survey.known:
        anchored[list(thing.label)] = True
    point[~anchored & (spread > WIDE)] = np.nan
    good = _in_front(met, center, direction, owner) & (spread <= WIDE)
    point[good] = met[good]
    point_m, departure_m = values.point_m.copy(), values.departure_m.copy()
    point_m[free] = point[free, :2]
    departure_m[free] = np.nan_to_num(point[free, 2] - values.height_m)
    return values._replace(point_m=point_m, departure_m=departure_m)


def _in_front(met: Floats, center: Floats, direction: Floats, owner: Ints) -> Bools:
    """(K,) which points lie ahead on all of their rays."""
    ahead = np.einsum("ni,ni->n", met[owner] - center, direction) > 0
    behind = np.bincount(owner[~ahead], minlength=len(met)) > 0
    return np.asarray(np.isfinite(met[:, 0]) & ~behind)


def _means(place: Floats, owner: Ints, count: int) -> Floats:
    """(count, 3) mean of the finite rows of each owner; NaN where there is none."""
    finite = np.isfinite(place).all(axis=1)
    total = np.zeros((count, 3))
    np.add.at(total, owner[finite], place[finite])
    number = np.bincount(owner[finite], minlength=count)
    return np.where(number[:, None] > 0, total / np.maximum(number, 1)[:, None], np.nan)
