"""The ground below labels, as the tie points around them show it.

A label that one photo shows lies where its ray meets the ground: on a plane, off by as much as the
ground is uneven, and at 45 degrees by that sideways too. Ties around it say how high the ground is,
and how uneven it is there. How far such a guess is off, the ties themselves tell: each is guessed
from those around it (simple kriging about the plane, by the correlation of heights under which such
guesses come out likeliest; Cressie 1993, "Statistics for spatial data", 3.2).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.geometry.ground.plane import plane_of_most
from uavgram.model.arrays import Floats, Ints
from uavgram.model.survey.survey import Survey
from uavgram.model.survey.ties import Beside, Sightings

NEIGHBOURS = 8
"""Ties around a label that tell its ground: twelve tell it no better."""

FEWEST = 72
"""Ties on the ground: fewer do not tell how it is shaped."""

UNEVEN_M = 0.05
"""How far a point of the ground may lie off its plane while the plane is looked for."""

OFF_M, OFF = 0.25, 4.0
"""Height, and spreads of the ground, from which on a tie does not lie on it; also the spreads of
guesses from which on a tie is of something else."""

REACHES = (1.0, 2.0, 4.0, 8.0, 16.0)
"""Reaches of the correlation that are tried, in usual distances between ties."""

OWN = (0.01, 0.03, 0.1, 0.3, 1.0)
"""Variances that each tie has for itself, beside that which it shares with those around it."""

STANDS = 1e3
"""The same of a tie that is of something else: it has no say."""

USUAL = 8.0
"""Ties around, with errors of the usual size, that the usual size counts for where a label is."""

LEAST_M = 0.003
"""Sigma that no guess is better than."""

LEAST_SAID = 0.3
"""Share of the variance of a height that a guess explains, at the least: a poorer one is none."""

MEDIAN = 0.6745
"""Of the absolute value of a normal variable, in sigmas."""


@dataclass(frozen=True, eq=False)
class _Ties:
    """T ties on the ground: places (T, 2), heights (T,), and the variance (T,) each has itself."""

    place_m: Floats
    height_m: Floats
    own: Floats


class _Guessed(NamedTuple):
    """Heights at n places, each from m ties around it.

    Attributes
    ----------
    tie, weight
        (n, m) by index, and their parts in it.
    sigma
        (n,) of the guess, in units of that of what heights share.
    """

    tie: Ints
    weight: Floats
    sigma: Floats

    def off(self, ties: _Ties) -> Floats:
        """(T,) how far each tie lies off what those around it say, in their sigmas."""
        said = np.sum(self.weight * ties.height_m[self.tie], axis=1)
        return np.asarray((ties.height_m - said) / self.sigma)


def with_near_ties(survey: Survey, adjustment: Adjustment) -> Survey:
    """The survey in which ties around labels on the ground say how high and uneven it is there.

    Parameters
    ----------
    survey
        All observations; which labels stand off the ground is known, and how rough that is.
    adjustment
        With its ties anywhere in space: see `sound_ties`.
    """
    shown, state, row = adjustment.survey, adjustment.state, survey.row_of_label
    names = [k for k, name in enumerate(shown.label) if not survey.off_ground[row[name]]]
    rough_m = survey.ground.roughness_sigma_m
    if len(survey.grounds) > 1 or not names or not rough_m:
        return survey
    lone = np.flatnonzero(shown.ties.pick < 0)
    on_ground, height = _on_ground(state.tie[lone])
    if len(height) < FEWEST:
        return survey
    place = state.tie[lone[on_ground], :2]
    tree = cKDTree(place)
    around = np.asarray(tree.query(place, NEIGHBOURS + 1)[1])[:, 1:]
    ties, reach = _likeliest(_Ties(place, height, np.zeros(len(height))), around)
    off = np.abs(_guessed(around, place, ties, reach).off(ties))
    usual = max(float(np.median(off)) / MEDIAN, LEAST_M)
    square = np.minimum(off, OFF * usual) ** 2
    labels = state.point[names, :2]
    told = _guessed(np.asarray(tree.query(labels, NEIGHBOURS)[1]), labels, ties, reach)
    # The ground is rougher here than there: what those around show of it counts.
    here = (USUAL * square.mean() + square[told.tie].sum(axis=1)) / (USUAL + NEIGHBOURS)
    unclear = _unclear_m(labels, state.tie[lone, :2], on_ground, (float(ties.own.min()), reach))
    own_m = np.hypot(rough_m * np.sqrt(here / square.mean()), unclear)
    told = told._replace(sigma=np.hypot(told.sigma * np.sqrt(here), unclear))
    index = _points(survey.ties, shown.ties, lone[on_ground])
    label = np.array([row[shown.label[k]] for k in names])
    beside = _beside(label, told._replace(tie=index[told.tie]), own_m, rough_m)
    return replace(survey, ties=replace(survey.ties, beside=beside))


def _beside(label: Ints, told: _Guessed, own_m: Floats, rough_m: float) -> Beside:
    """What guesses say of the heights of labels, beside the prior that the ground is even.

    A guess by simple kriging has taken that prior into account. What it knows besides is N(g, v)
    with 1/v = 1/s² - 1/r² and g/v = h/s², of a guess h with sigma s and a prior r: both together
    are the guess again. So the prior still holds the plane, and how rough the ground is can be
    learnt from labels.

    Parameters
    ----------
    label
        (B,) by index.
    told
        The guesses, by the ties of the survey, with sigmas in metres.
    own_m
        (B,) how uneven the ground is below each label.
    rough_m
        How uneven the area's is.
    """
    share = 1.0 - (told.sigma / own_m) ** 2
    says = share > LEAST_SAID
    share = np.where(says, share, 1.0)
    sigma_m = np.maximum(told.sigma / np.sqrt(share), LEAST_M)
    return Beside(
        label=label,
        tie=told.tie,
        weight=told.weight / share[:, None],
        sigma_m=np.where(says, sigma_m, np.nan),
        uneven=own_m / rough_m,
    )


def _unclear_m(place_m: Floats, ties_m: Floats, on_ground: Ints, by: tuple[float, float]) -> Floats:
    """(n,) what ties off the ground around a place leave unclear of it.

    At the foot of a bank, what goes for the ground on one side does not go for it. Where a tie lies
    off, the ground is anywhere up to where one counts as off, and matters by what the tie would
    have had to say.

    Parameters
    ----------
    place_m, ties_m
        (n, 2), and (T, 2) of all ties.
    on_ground
        Which of the ties are.
    by
        The variance of each tie for itself, and the reach of the correlation.
    """
    every = _Ties(ties_m, np.zeros(len(ties_m)), np.full(len(ties_m), by[0]))
    around = np.asarray(cKDTree(ties_m).query(place_m, NEIGHBOURS)[1])
    weight = np.maximum(_guessed(around, place_m, every, by[1]).weight, 0.0)
    said = np.maximum(weight.sum(axis=1), np.finfo(np.float64).tiny)
    share = np.sum(weight * ~np.isin(around, on_ground), axis=1) / said
    return np.asarray(share * OFF_M / np.sqrt(3.0))


def _on_ground(world_m: Floats) -> tuple[Ints, Floats]:
    """Which ties (T, 3) lie on the ground, and their heights over its plane."""
    none = np.zeros(0, dtype=np.int64), np.zeros(0)
    if len(world_m) < FEWEST:
        return none
    plane = plane_of_most(world_m[:, :2], world_m[:, 2], np.full(len(world_m), UNEVEN_M))
    if plane is None:
        return none
    height = world_m[:, 2] - plane
    near = np.abs(height) < OFF_M
    spread = float(np.median(np.abs(height[near])) / MEDIAN) if near.any() else 0.0
    level = np.abs(height) < np.maximum(OFF_M, OFF * spread)
    on_ground = np.flatnonzero(level)
    return on_ground, height[on_ground]


def _likeliest(ties: _Ties, around: Ints) -> tuple[_Ties, float]:
    """The correlation under which each tie is guessed best by those around it (T, m).

    By the likelihood of errors that are Laplace's, whose size is the one that fits: some ties are
    of something else. These have no say in what follows.

    Returns
    -------
    ties, reach_m
        With their own variances, in units of what they share; how far that reaches.
    """
    apart = float(np.median(np.linalg.norm(ties.place_m - ties.place_m[around[:, 0]], axis=1)))
    best = np.inf, ties, 1.0
    for times, own in product(REACHES, OWN):
        tried = replace(ties, own=np.full(len(around), own))
        reach = times * max(apart, LEAST_M)
        found = _guessed(around, ties.place_m, tried, reach)
        off = np.abs(found.off(tried))
        cost = float(np.log(off.mean()) + np.log(found.sigma).mean())
        if cost < best[0]:
            stands = off > OFF * np.median(off) / MEDIAN
            best = cost, replace(tried, own=np.where(stands, STANDS, own)), reach
    return best[1], best[2]


def _guessed(around: Ints, place_m: Floats, ties: _Ties, reach_m: float) -> _Guessed:
    """Heights at places (n, 2), each from ties (n, m) around it.

    Parameters
    ----------
    around
        By index.
    place_m
        Of what is guessed.
    ties
        All.
    reach_m
        Of the correlation.
    """
    at, own = ties.place_m[around], ties.own[around]
    among = _correlation(np.linalg.norm(at[:, :, None] - at[:, None], axis=3), reach_m)
    among = among + own[:, :, None] * np.eye(around.shape[1])
    here = _correlation(np.linalg.norm(at - place_m[:, None], axis=2), reach_m)
    weight = np.linalg.solve(among, here[..., None])[..., 0]
    variance = 1.0 + float(ties.own.min()) - np.sum(weight * here, axis=1)
    return _Guessed(around, np.asarray(weight), np.sqrt(variance))


def _correlation(apart_m: Floats, reach_m: float) -> Floats:
    """Of heights so far apart. An exponential: kerbs and ruts are no smooth waves."""
    return np.asarray(np.exp(-apart_m / reach_m))


def _points(ties: Sightings, shown: Sightings, which: Ints) -> Ints:
    """Points among `ties` of some points of an adjustment's, by the rows of the table."""
    first = np.full(shown.points, -1)
    first[shown.point[::-1]] = shown.row[::-1]
    order = np.argsort(ties.row, kind="stable")
    at = np.searchsorted(ties.row[order], first[which])
    return np.asarray(ties.point[order[np.minimum(at, len(order) - 1)]])
