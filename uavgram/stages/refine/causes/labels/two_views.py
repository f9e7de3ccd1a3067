"""Hypotheses on labels swapped in a photo, by another photo of the same ground, without poses.

Where an adjustment does not converge, or left a photo out, its points are useless. Two photos of a
plane still differ by a homography: with two labels swapped no homography fits, and of all exchanges
the right one makes it fit.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from uavgram.estimation.reliability.redundancy import core_fit
from uavgram.geometry.camera.back_projection import back_project
from uavgram.model.arrays import Floats, Ints
from uavgram.model.survey.corrections import SurveyCorrection
from uavgram.stages.refine.causes.hypothesis import PRICE, Hypothesis, Standing, taking_part
from uavgram.stages.refine.causes.labels.in_a_photo import swapped_message

LEAST_LABELS = 6
"""Labels needed in both photos: a homography takes four, and five fit after more than one
exchange."""

MOST_LABELS, MOST_PHOTOS = 30, 12
"""Largest number of labels of which all pairs are tried; and of photos that are examined."""

MOST_OUT = 4
"""A photo is in question where more than one in so many of its picks was left out."""

MISFIT = 1e-5
"""Probability of the core's squares below which every photo is in question."""

BETTER = 0.1
"""Largest ratio of the squares after an exchange to those before it."""


def swapped_beside_another(standing: Standing) -> Iterator[Hypothesis]:
    """Propose two labels of a photo whose exchange makes it fit another photo."""
    survey = standing.survey
    may = taking_part(standing.taking) & ~survey.off_ground[survey.pick_label]
    photos = [np.flatnonzero(may & (survey.pick_frame == k)) for k in range(len(survey.frame_id))]
    for frame in _in_question(standing)[:MOST_PHOTOS]:
        here, there = _shared_most(standing, photos, frame)
        pair = _exchange(standing, here, there)
        if pair is None:
            continue
        label, count = survey.pick_label, len(here)
        right = {pair[0]: int(label[pair[1]]), pair[1]: int(label[pair[0]])}
        choices = float(np.log(count * (count - 1) / 2) + np.log(len(survey.frame_id)))
        yield Hypothesis(
            tell=partial(swapped_message, standing, right),
            # With it all picks of the photo take part again.
            mend=SurveyCorrection(label_of_pick={int(k): int(label[k]) for k in here} | right),
            promise=standing.cost,  # everything should fit then
            price=choices - PRICE * _regained(standing, here),
            settles=frozenset([survey.frame_id[frame]]),
        )


def _regained(standing: Standing, here: Ints) -> int:
    """Count left-out numbers that fit at their places, less those that fix the photo's pose."""
    label, used = standing.survey.pick_label, standing.refined.pick_index
    lost = np.setdiff1d(here, used[~standing.spoilt[used]])
    lost = lost[~standing.spoilt[lost]]  # the others are known to be wrong
    seen = int(np.isin(label[lost], label[used]).sum())
    pose = 6 if len(lost) == len(here) else 0
    return max(2 * seen - pose, 0)


def _in_question(standing: Standing) -> list[int]:
    """Return photos that lost many of their picks for any reason; all, where nothing fits."""
    survey, adjustment = standing.survey, standing.adjustment
    few = len(survey.frame_id) <= MOST_PHOTOS  # with many, the others determine the points
    if not adjustment.minimum.converged or (few and core_fit(adjustment).probability < MISFIT):
        return list(range(len(survey.frame_id)))
    used = np.zeros(len(survey.pick_frame), dtype=np.bool_)
    used[standing.refined.pick_index] = True
    every, out = (
        np.bincount(survey.pick_frame[some], minlength=len(survey.frame_id))
        for some in (slice(None), ~used)
    )
    return np.flatnonzero((every >= LEAST_LABELS) & (MOST_OUT * out > every)).tolist()


def _shared_most(standing: Standing, photos: list[Ints], frame: int) -> tuple[Ints, Ints]:
    """Return picks (n,) of a photo, and those of the same labels in the photo that shares most."""
    label = standing.survey.pick_label
    best: tuple[Ints, Ints] = (np.zeros(0, np.int64), np.zeros(0, np.int64))
    for other, picks in enumerate(photos):
        if other == frame:
            continue
        _, mine, theirs = np.intersect1d(label[photos[frame]], label[picks], return_indices=True)
        if len(mine) > len(best[0]):
            best = photos[frame][mine], picks[theirs]
    return best


def _exchange(standing: Standing, here: Ints, there: Ints) -> tuple[int, int] | None:
    """Find the exchange of two picks of a photo that makes it fit another; None without one."""
    count = len(here)
    if not LEAST_LABELS <= count <= MOST_LABELS:
        return None
    camera, survey = standing.survey.calibration, standing.survey
    rays = [
        back_project(camera.model, camera.parameters, survey.pixel_px[k]) for k in (here, there)
    ]
    if not all(np.isfinite(ray).all() for ray in rays):
        return None
    x, y = (_normalised(ray[:, :2]) for ray in rays)
    # All exchanges of two picks, and the original order at the end.
    first, second = np.triu_indices(count, 1)
    order = np.tile(np.arange(count), (len(first) + 1, 1))  # the last: as they are
    rows = np.arange(len(first))
    order[rows, first], order[rows, second] = second, first
    squares = _misfit(x[order], y)
    best = int(np.argmin(squares[:-1]))
    if not squares[best] < BETTER * squares[-1]:
        return None
    return int(here[first[best]]), int(here[second[best]])


def _normalised(point: Floats) -> Floats:
    """Centre points (n, 2) and scale them to a mean distance of sqrt(2) (Hartley 1997)."""
    away = point - point.mean(axis=0)
    size = float(np.sqrt(np.mean(np.sum(away**2, axis=1)) / 2.0))
    scaled: Floats = away / max(size, np.finfo(float).tiny)
    return scaled


def _misfit(x: Floats, y: Floats) -> Floats:
    """Compute algebraic squares (S,) of the best homographies from points (S, n, 2) to (n, 2).

    Direct linear transformation (Hartley and Zisserman 2004, algorithm 4.1).
    """
    one = np.concatenate([x, np.ones((*x.shape[:2], 1))], axis=2)
    zero = np.zeros_like(one)
    u, v = y[:, :1], y[:, 1:]
    rows = np.concatenate(
        [
            np.concatenate([one, zero, -u * one], axis=2),
            np.concatenate([zero, one, -v * one], axis=2),
        ],
        axis=1,
    )
    smallest: Floats = np.linalg.svd(rows, compute_uv=False)[:, -1]
    return np.asarray(smallest**2, dtype=np.float64)
