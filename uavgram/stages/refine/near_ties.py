"""The ground below labels, as the tie points around them show it.

A label that one photo shows lies where its ray meets the ground: on a plane, off by as much as the
ground is uneven, and at 45 degrees by that sideways too. Ties are dense: those around a label say
to a few centimetres how high the ground is there. How far such a guess is off, the ties themselves
tell: each is guessed from those around it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.geometry.ground.plane_of_most import plane_of_most
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey.survey import Survey
from uavgram.model.survey.ties import Sightings

NEIGHBOURS = 12
"""Ties around a label that tell its ground, at the most."""

FEWEST = 6
"""Of them, fewer tell nothing; and of all, so many times as many."""

UNEVEN_M = 0.05
"""How far a point of the ground may lie off its plane while the plane is looked for."""

OFF_M, OFF = 0.25, 4.0
"""Height, and spreads of the ground, from which on a tie does not lie on it."""

APART, LEAST_M = 3.0, 0.01
"""Spreads beyond which one of the ties around a label is of something else; their least spread."""

LEVEL = 0.5
"""By how many ties at the rim the plane through those around a label is held level."""

MEDIAN = 0.6745
"""Of the absolute value of a normal variable, in sigmas."""


class _Guessed(NamedTuple):
    """Heights over the plane at n places, their spread, and which of m ties around tell them.

    Attributes
    ----------
    height_m, spread_m
        (n,); NaN where too few ties are around.
    tie, used, rise_m
        (n, m) by index; whether it tells; by how much the ground rises from it to the place.
    """

    height_m: Floats
    spread_m: Floats
    tie: Ints
    used: Bools
    rise_m: Floats


def with_near_ties(survey: Survey, adjustment: Adjustment) -> Survey:
    """The survey in which ties around labels on the ground say how high it is there.

    Parameters
    ----------
    survey
        All observations; which labels stand off the ground is known.
    adjustment
        With its ties anywhere in space: see `sound_ties`.
    """
    shown, state, row = adjustment.survey, adjustment.state, survey.row_of_label
    lone = np.flatnonzero(shown.ties.pick < 0)
    names = [k for k, name in enumerate(shown.label) if not survey.off_ground[row[name]]]
    if len(survey.grounds) > 1 or len(lone) < FEWEST * NEIGHBOURS or not names:
        return survey
    world = state.tie[lone]
    plane = plane_of_most(world[:, :2], world[:, 2], np.full(len(lone), UNEVEN_M))
    if plane is None:
        return survey
    height = world[:, 2] - plane
    near = np.abs(height) < OFF_M
    spread = float(np.median(np.abs(height[near])) / MEDIAN) if near.any() else 0.0
    level = np.flatnonzero(np.abs(height) < np.maximum(OFF_M, OFF * spread))
    if len(level) < FEWEST * NEIGHBOURS:
        return survey
    place, height = world[level, :2], height[level]
    tree = cKDTree(place)
    around = np.asarray(tree.query(place, NEIGHBOURS + 1)[1])[:, 1:]
    others = _guessed(around, place, (place, height))
    with np.errstate(invalid="ignore"):
        off = np.abs(height - others.height_m) / others.spread_m
    off = off[np.isfinite(off)]
    if not len(off):
        return survey
    factor = float(np.sqrt(np.mean(np.minimum(off, OFF) ** 2)))
    labels = state.point[names, :2]
    told = _guessed(tree.query(labels, NEIGHBOURS)[1], labels, (place, height))
    rows = [row[shown.label[k]] for k in names]
    point = _points(survey.ties, shown.ties, lone[level])
    return replace(survey, ties=_joined(survey.ties, rows, told, (point, factor)))


def _guessed(around_them: ArrayLike, place_m: Floats, ties: tuple[Floats, Floats]) -> _Guessed:
    """Heights at places: of the plane that fits the ties around each.

    Parameters
    ----------
    around_them
        (n, m) indices of ties.
    place_m
        (n, 2).
    ties
        Places (T, 2) and heights (T,) of all.
    """
    tie = np.asarray(around_them, dtype=np.int64)
    around = ties[1][tie]
    middle = np.median(around, axis=1, keepdims=True)
    spread = np.median(np.abs(around - middle), axis=1, keepdims=True) / MEDIAN
    used = np.abs(around - middle) <= APART * np.maximum(spread, LEAST_M)
    count = used.sum(axis=1)
    away = ties[0][tie] - place_m[:, None]
    reach = np.maximum(np.linalg.norm(away, axis=2).max(axis=1), LEAST_M)[:, None, None]
    rows = np.concatenate([np.ones((*tie.shape, 1)), away / reach], axis=2) * used[..., None]
    normal = np.einsum("nmi,nmj->nij", rows, rows) + LEVEL * np.diag([0.0, 1.0, 1.0])
    normal[count < FEWEST] = np.eye(3)
    right = np.einsum("nmi,nm->ni", rows, around)
    fitted = np.linalg.solve(normal, right[..., None])[..., 0]
    off = used * (around - np.einsum("nmi,ni->nm", rows, fitted))
    size = np.sqrt(np.sum(off**2, axis=1) / np.maximum(count - 3, 1) + LEAST_M**2)
    known = np.where(count < FEWEST, np.nan, 1.0)
    rise = -np.einsum("nmi,ni->nm", away / reach, fitted[:, 1:])
    return _Guessed(known * fitted[:, 0], known * size, tie, used, rise)


def _points(ties: Sightings, shown: Sightings, which: Ints) -> Ints:
    """Points among `ties` of some points of an adjustment's, by the rows of the table."""
    first = np.full(shown.points, -1)
    first[shown.point[::-1]] = shown.row[::-1]
    order = np.argsort(ties.row, kind="stable")
    at = np.searchsorted(ties.row[order], first[which])
    return np.asarray(ties.point[order[np.minimum(at, len(order) - 1)]])


def _joined(ties: Sightings, label: list[int], told: _Guessed, of: tuple[Ints, float]) -> Sightings:
    """The ties, each joined to at most one label.

    Parameters
    ----------
    ties
        Of the survey.
    label
        (n,) by index.
    told
        Of these labels.
    of
        The point of each tie in `told`; how many spreads such a guess is off.
    """
    point, factor = of
    near = np.full(ties.points, -1)
    rise, sigma = np.zeros(ties.points), np.ones(ties.points)
    for k, own in enumerate(label):
        mine, rises = point[told.tie[k][told.used[k]]], told.rise_m[k][told.used[k]]
        free = near[mine] < 0
        mine = mine[free]
        if len(mine) >= FEWEST and np.isfinite(told.height_m[k]):
            near[mine], rise[mine] = own, rises[free]
            # Each has a part in one guess, whose error they share.
            sigma[mine] = factor * told.spread_m[k] * np.sqrt(len(mine))
    return replace(ties, near=near, near_rise_m=rise, near_sigma_m=sigma)
