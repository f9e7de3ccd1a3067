"""Estimate the ground below labels from the tie points around them.

A label in only one photo is placed where its ray meets the ground. If the ground is a plane, the
error of its height is as large as the unevenness of the ground, and at 45 degrees so is the
horizontal error. Tie points around the label show the height of the ground there. The error of such
a prediction is estimated from the tie points: each is predicted from those around it (simple
kriging about the plane, by the correlation of heights under which such predictions are likeliest;
Cressie 1993, "Statistics for spatial data", 3.2).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.geometry.ground.plane import fit_robust_plane
from uavgram.model.arrays import Floats, Ints
from uavgram.model.survey import GroundConstraints, Sightings, Survey

NEIGHBOURS = 8
"""Ties around a label from which its ground is predicted: twelve give no better prediction."""

MIN_TIES = 72
"""Least number of ties on the ground that show its shape."""

MAX_UNEVENNESS_M = 0.05
"""Allowed distance of ground points from their plane while the plane is fitted [m]."""

OTHER_OBJECT_M, OTHER_OBJECT_SIGMAS = 0.25, 4.0
"""Height [m], and multiple of the spread of the ground, above which a tie is off the ground; the
latter also for prediction errors of ties of another object."""

REACH_FACTORS = (1.0, 2.0, 4.0, 8.0, 16.0)
"""Ranges of the correlation that are tried, in units of the median distance to the nearest tie."""

OWN_VARIANCES = (0.01, 0.03, 0.1, 0.3, 1.0)
"""Variances of each tie by itself, beside the variance that it shares with its neighbours."""

OTHER_OBJECT_VARIANCE = 1e3
"""Own variance of a tie of another object: it has no influence."""

USUAL_REACH = 8.0
"""Weight of the mean square prediction error of all ties in that at a label, as a number of
ties."""

MIN_SIGMA_M = 0.003
"""Lower limit of the sigma of a prediction [m]."""

LEAST_EXPLAINED = 0.3
"""Least share of the variance of a height that a prediction has to explain to be used."""

MEDIAN_SIGMAS = 0.6745
"""Median of the absolute value of a normal variable, in sigmas."""


@dataclass(frozen=True, eq=False)
class _Ties:
    """Ties on the ground: places (T, 2), heights (T,), and each tie's own variance (T,)."""

    place_m: Floats
    height_m: Floats
    own: Floats


class _Prediction(NamedTuple):
    """Predicted heights at n places, each from m ties around it.

    Attributes
    ----------
    tie, weight
        (n, m) indices of the ties, and their weights.
    sigma
        (n,) sigma of the prediction, in units of that of the shared part of heights.
    """

    tie: Ints
    weight: Floats
    sigma: Floats

    def off(self, ties: _Ties) -> Floats:
        """Compute the difference (T,) of each tie from its prediction, in sigmas of the latter."""
        said = np.sum(self.weight * ties.height_m[self.tie], axis=1)
        return np.asarray((ties.height_m - said) / self.sigma)


def constrain_by_near_ties(survey: Survey, adjustment: Adjustment) -> Survey:
    """Add predictions of the height and unevenness of the ground at labels from ties around them.

    Parameters
    ----------
    survey
        All observations; labels off the ground and the roughness are known.
    adjustment
        Adjustment with its ties anywhere in space: see `tie_outliers.py`.
    """
    shown, state, row = adjustment.survey, adjustment.state, survey.row_of_label
    names = [k for k, name in enumerate(shown.label) if not survey.off_ground[row[name]]]
    rough_m = survey.ground.roughness_sigma_m
    if len(survey.grounds) > 1 or not names or not rough_m:
        return survey
    lone = np.flatnonzero(shown.ties.pick < 0)
    on_ground, height = _on_ground(state.tie[lone])
    if len(height) < MIN_TIES:
        return survey
    place = state.tie[lone[on_ground], :2]
    tree = cKDTree(place)
    around = np.asarray(tree.query(place, NEIGHBOURS + 1)[1])[:, 1:]
    # Correlation of heights, and prediction errors of the ties themselves.
    ties, reach = _likeliest_reach(_Ties(place, height, np.zeros(len(height))), around)
    off = np.abs(_predict_heights(around, place, ties, reach).off(ties))
    usual = max(float(np.median(off)) / MEDIAN_SIGMAS, MIN_SIGMA_M)
    square = np.minimum(off, OTHER_OBJECT_SIGMAS * usual) ** 2
    # Predict the ground at labels, and scale the sigmas by the errors nearby.
    labels = state.point[names, :2]
    told = _predict_heights(np.asarray(tree.query(labels, NEIGHBOURS)[1]), labels, ties, reach)
    # The roughness varies with the place: use the prediction errors of the neighbours.
    here = (USUAL_REACH * square.mean() + square[told.tie].sum(axis=1)) / (USUAL_REACH + NEIGHBOURS)
    unclear = _unclear_ground_m(
        labels, state.tie[lone, :2], on_ground, (float(ties.own.min()), reach)
    )
    own_m = np.hypot(rough_m * np.sqrt(here / square.mean()), unclear)
    told = told._replace(sigma=np.hypot(told.sigma * np.sqrt(here), unclear))
    index = _points(survey.ties, shown.ties, lone[on_ground])
    label = np.array([row[shown.label[k]] for k in names])
    beside = _ground_constraints(label, told._replace(tie=index[told.tie]), own_m, rough_m)
    return replace(survey, ties=replace(survey.ties, constraints=beside))


def _ground_constraints(
    label: Ints, told: _Prediction, own_m: Floats, rough_m: float
) -> GroundConstraints:
    """Convert predictions of heights to observations beside the prior of an even ground.

    Simple kriging has already used that prior. The additional information is N(g, v) with 1/v =
    1/s² - 1/r² and g/v = h/s², for a prediction h with sigma s and a prior sigma r: both together
    are the prediction again. So the prior still constrains the plane, and the roughness of the
    ground can be estimated from labels.

    Parameters
    ----------
    label
        (B,) indices of labels.
    told
        The predictions, by the ties of the survey, with sigmas in metres.
    own_m
        (B,) unevenness of the ground below each label.
    rough_m
        Roughness of the area.
    """
    share = 1.0 - (told.sigma / own_m) ** 2
    says = share > LEAST_EXPLAINED
    share = np.where(says, share, 1.0)
    sigma_m = np.maximum(told.sigma / np.sqrt(share), MIN_SIGMA_M)
    return GroundConstraints(
        label=label,
        tie=told.tie,
        weight=told.weight / share[:, None],
        sigma_m=np.where(says, sigma_m, np.nan),
        uneven=own_m / rough_m,
    )


def _unclear_ground_m(
    place_m: Floats, ties_m: Floats, on_ground: Ints, by: tuple[float, float]
) -> Floats:
    """Compute the uncertainty (n,) that ties off the ground around a place leave [m].

    At the foot of a bank, the ground on one side differs from that on the other. Where a tie is off
    the ground, the ground may be at any height up to `OFF_M`, and this counts by the weight that
    the tie would have had.

    Parameters
    ----------
    place_m, ties_m
        (n, 2) places, and (T, 2) places of all ties.
    on_ground
        Indices of ties on the ground.
    by
        The own variance of each tie, and the range of the correlation.
    """
    every = _Ties(ties_m, np.zeros(len(ties_m)), np.full(len(ties_m), by[0]))
    around = np.asarray(cKDTree(ties_m).query(place_m, NEIGHBOURS)[1])
    weight = np.maximum(_predict_heights(around, place_m, every, by[1]).weight, 0.0)
    said = np.maximum(weight.sum(axis=1), np.finfo(np.float64).tiny)
    share = np.sum(weight * ~np.isin(around, on_ground), axis=1) / said
    return np.asarray(share * OTHER_OBJECT_M / np.sqrt(3.0))


def _on_ground(world_m: Floats) -> tuple[Ints, Floats]:
    """Find ties (T, 3) on the ground, and their heights over its plane."""
    none = np.zeros(0, dtype=np.int64), np.zeros(0)
    if len(world_m) < MIN_TIES:
        return none
    plane = fit_robust_plane(world_m[:, :2], world_m[:, 2], np.full(len(world_m), MAX_UNEVENNESS_M))
    if plane is None:
        return none
    height = world_m[:, 2] - plane
    near = np.abs(height) < OTHER_OBJECT_M
    spread = float(np.median(np.abs(height[near])) / MEDIAN_SIGMAS) if near.any() else 0.0
    level = np.abs(height) < np.maximum(OTHER_OBJECT_M, OTHER_OBJECT_SIGMAS * spread)
    on_ground = np.flatnonzero(level)
    return on_ground, height[on_ground]


def _likeliest_reach(ties: _Ties, around: Ints) -> tuple[_Ties, float]:
    """Find the correlation under which each tie is predicted best by those around it (T, m).

    The likelihood is that of Laplace distributed errors of the fitted size, since some ties are of
    another object. These have no influence afterwards.

    Returns
    -------
    ties, reach_m
        Ties with their own variances, in units of the shared one; range of the correlation.
    """
    apart = float(np.median(np.linalg.norm(ties.place_m - ties.place_m[around[:, 0]], axis=1)))
    best = np.inf, ties, 1.0
    for times, own in product(REACH_FACTORS, OWN_VARIANCES):
        tried = replace(ties, own=np.full(len(around), own))
        reach = times * max(apart, MIN_SIGMA_M)
        found = _predict_heights(around, ties.place_m, tried, reach)
        off = np.abs(found.off(tried))
        # Negative log-likelihood of the Laplace distribution with its size estimated.
        cost = float(np.log(off.mean()) + np.log(found.sigma).mean())
        if cost < best[0]:
            stands = off > OTHER_OBJECT_SIGMAS * np.median(off) / MEDIAN_SIGMAS
            best = cost, replace(tried, own=np.where(stands, OTHER_OBJECT_VARIANCE, own)), reach
    return best[1], best[2]


def _predict_heights(around: Ints, place_m: Floats, ties: _Ties, reach_m: float) -> _Prediction:
    """Predict heights at places (n, 2), each from ties (n, m) around it, by simple kriging.

    Parameters
    ----------
    around
        (n, m) indices of ties.
    place_m
        (n, 2) places.
    ties
        All ties.
    reach_m
        Range of the correlation.
    """
    at, own = ties.place_m[around], ties.own[around]
    among = _correlation(np.linalg.norm(at[:, :, None] - at[:, None], axis=3), reach_m)
    among = among + own[:, :, None] * np.eye(around.shape[1])
    here = _correlation(np.linalg.norm(at - place_m[:, None], axis=2), reach_m)
    # Kriging weights C^-1 c and variance 1 + own - c^T C^-1 c.
    weight = np.linalg.solve(among, here[..., None])[..., 0]
    variance = 1.0 + float(ties.own.min()) - np.sum(weight * here, axis=1)
    return _Prediction(around, np.asarray(weight), np.sqrt(variance))


def _correlation(apart_m: Floats, reach_m: float) -> Floats:
    """Compute the correlation of heights: exponential, as kerbs and ruts are not smooth."""
    return np.asarray(np.exp(-apart_m / reach_m))


def _points(ties: Sightings, shown: Sightings, which: Ints) -> Ints:
    """Return indices among `ties` of points of an adjustment, matched by rows of the table."""
    first = np.full(shown.points, -1)
    first[shown.point[::-1]] = shown.row[::-1]
    order = np.argsort(ties.row, kind="stable")
    at = np.searchsorted(ties.row[order], first[which])
    return np.asarray(ties.point[order[np.minimum(at, len(order) - 1)]])
