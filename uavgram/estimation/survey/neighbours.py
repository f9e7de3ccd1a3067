"""Local accuracy of points against their neighbours, and the surroundings of points.

Errors of receivers and compasses shift and turn a whole survey without changing its shape. The
distance of a point from its neighbours is independent of these errors, and of the datum.

To readjust moved observations, a neighbourhood is cut out of the survey: the photos that show the
moved points, and those that share points with them. There the likelihood itself is evaluated. For
all other observations, which hardly change, the linear model of the adjustment is sufficient.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from uavgram.estimation.solver.normal_equations import Block, Factor
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.selection import Selection, select_picks
from uavgram.estimation.survey.unknowns import State
from uavgram.model.arrays import Bools, Floats, Ints, rows_of
from uavgram.model.survey import Sightings, Survey

NEIGHBOUR_COUNT = 5
"""Neighbours of a point: an odd number, so that the median is one of them; two badly determined
neighbours do not change it."""

MAX_SOLVED = 2_000
"""Largest number of distances that are each solved for where the inverse is not available as a
whole; beyond it their variances are taken from draws of all unknowns."""

DRAW_COUNT = 128
"""Number of draws: the standard deviation of a sigma from so many is 6 %: 1 / sqrt(2 n)."""

_AT_ONCE, _SEED = 32, 20


@dataclass(frozen=True, eq=False)
class Neighbours:
    """Nearest points of each of K points, k = min(5, K - 1) of them.

    Attributes
    ----------
    row
        (K, k) indices of the neighbours, the nearest first.
    distance_sigma_m
        (K, k) standard deviations of the distances to them.
    """

    row: Ints
    distance_sigma_m: Floats

    @property
    def sigma_m(self) -> Floats:
        """(K,) median standard deviation; NaN for a single point."""
        if not self.row.shape[1]:
            return np.full(len(self.row), np.nan)
        return np.asarray(np.median(self.distance_sigma_m, axis=1))


def find_neighbours(adjustment: Adjustment) -> Neighbours:
    """Find the nearest points of every point, and the sigmas of the distances to them.

    Parameters
    ----------
    adjustment
        Adjusted survey.

    Notes
    -----
    Geodesy rates a point likewise, as its local accuracy: the mean of the relative accuracies
    between it and the points next to it (FGDC-STD-007.2-1998, Geospatial Positioning Accuracy
    Standards, part 2). Here the median is taken, because one neighbour that hardly any photo shows
    must not rate all points around it.
    """
    count = adjustment.problem.layout.points
    place, gradient, columns = adjustment.points_with_jacobian(np.arange(count))
    row = _find_nearest(place)
    if not row.size:
        return Neighbours(row, np.zeros(row.shape))
    here = np.repeat(np.arange(count), row.shape[1])
    # Each pair of points once: both directions have the same variance.
    pair, which = np.unique(
        np.sort(np.column_stack([here, row.ravel()])), axis=0, return_inverse=True
    )
    one, other = pair.T
    apart = place[other] - place[one]
    length = np.linalg.norm(apart, axis=1, keepdims=True)
    direction = np.where(length > 0, apart, [1.0, 0.0, 0.0]) / np.where(length > 0, length, 1.0)
    # Gradient of the distance: minus the direction by one point, plus the direction by the other.
    by = np.concatenate(
        [
            -np.einsum("ni,nij->nj", direction, gradient[one]),
            np.einsum("ni,nij->nj", direction, gradient[other]),
        ],
        axis=1,
    )
    variance = _variances(adjustment, np.concatenate([columns[one], columns[other]], axis=1), by)
    return Neighbours(row, np.sqrt(variance)[which.ravel()].reshape(row.shape))


def _find_nearest(place_m: Floats) -> Ints:
    """Return the (K, k) nearest others of places (K, 3)."""
    count = len(place_m)
    wanted = min(NEIGHBOUR_COUNT, count - 1)
    if wanted < 1:
        return np.zeros((count, 0), dtype=np.int64)
    found = np.asarray(cKDTree(place_m).query(place_m, wanted + 1)[1], dtype=np.int64)
    # The query returns the point itself, not always first: another may be at the same place.
    itself = found == np.arange(count)[:, None]
    itself[~itself.any(axis=1), -1] = True
    return np.asarray(found[~itself].reshape(count, wanted), dtype=np.int64)


def _variances(adjustment: Adjustment, columns: Ints, by: Floats) -> Floats:
    """Compute the variances (n,) of linear functions with gradients (n, k) by unknowns (n, k)."""
    factor = adjustment.minimum.factor
    if not factor.sparse:
        joint = adjustment.covariance.blocks(columns)
        return np.asarray(np.einsum("ni,nij,nj->n", by, joint, by))
    if len(columns) <= MAX_SOLVED:
        return factor.variances(columns, by)
    return estimate_variances(factor, adjustment.minimum.blocks.values(), columns, by)


def estimate_variances(
    factor: Factor, blocks: Iterable[Block], columns: Ints, by: Floats
) -> Floats:
    """Estimate variances (n,) of linear functions from `DRAW_COUNT` draws of all unknowns.

    Parameters
    ----------
    factor, blocks
        Factor of the normal matrix N = J^T J and the whitened rows J that make it: with z of unit
        variance, N^-1 J^T z has the covariance N^-1.
    columns, by
        The functions: their gradients (n, k) by unknowns (n, k).
    """
    rng = np.random.default_rng(_SEED)
    rows = [block.sparse(factor.size) for block in blocks]
    total = np.zeros(len(columns))
    for _ in range(DRAW_COUNT // _AT_ONCE):
        right = np.zeros((factor.size, _AT_ONCE))
        for jacobian in rows:
            right += jacobian.T @ rng.standard_normal((jacobian.shape[0], _AT_ONCE))
        # N^-1 J^T z: draws of all unknowns.
        drawn = factor.solve(right)
        value = np.zeros((len(columns), _AT_ONCE))
        for k in range(by.shape[1]):  # one at a time, to save memory
            value += by[:, [k]] * drawn[columns[:, k]]
        total += np.sum(value**2, axis=1)
    return total / DRAW_COUNT


RING_COUNT = 2
"""Rings of photos: those that show the points, and those that share points with them."""

MAX_PHOTOS_FOR_WHOLE = 40
"""Number of photos up to which a survey is its own neighbourhood: a part of it would cost as
much."""

MAX_PART_SHARE = 0.5
"""Share of the photos above which a part is not worth its cost."""


@dataclass(frozen=True, eq=False)
class Neighbourhood:
    """Part of an adjusted survey, or all of it.

    Attributes
    ----------
    problem
        Likelihood of its observations.
    columns
        (n,) positions of its unknowns among those of the whole survey.
    state
        Adjusted values of its unknowns.
    """

    problem: SurveyProblem
    columns: Ints
    state: State


def find_neighbourhood(adjustment: Adjustment, label: Ints) -> Neighbourhood:
    """Return the surroundings of some points: all of a small survey.

    A survey without a world of its own is small, and fixed by its first photo.
    """
    survey = adjustment.survey
    frames = len(survey.frame_id)
    every = np.arange(adjustment.problem.layout.size)
    whole = Neighbourhood(adjustment.problem, every, adjustment.state)
    if is_small(survey):
        return whole
    near = _mark_frames_around(survey, label)
    if np.count_nonzero(near) > MAX_PART_SHARE * frames:
        return whole
    seen = replace(
        survey,
        matches=_find_sightings(survey.matches, near),
        ties=_find_sightings(survey.ties, near),
    )
    return _part(adjustment, select_picks(seen, near[survey.pick_frame]))


def is_small(survey: Survey) -> bool:
    """Return whether the whole survey is the neighbourhood of any of its points."""
    return len(survey.frame_id) <= MAX_PHOTOS_FOR_WHOLE or survey.gauge == "plane"


def _mark_frames_around(survey: Survey, label: Ints) -> Bools:
    """Mark the photos (F,) that show the points, or share a point with one that does."""
    matches, ties = survey.matches, survey.ties
    labels = len(survey.label)
    chained = np.append(survey.pick_label, 0)[matches.pick][matches.point]
    frame = np.concatenate([survey.pick_frame, matches.frame, ties.frame])
    point = np.concatenate([survey.pick_label, chained, labels + ties.point])
    asked = np.zeros(labels + ties.points, dtype=np.bool_)
    asked[label] = True
    near = np.zeros(len(survey.frame_id), dtype=np.bool_)
    for _ in range(RING_COUNT):
        near[frame[asked[point]]] = True
        asked[point[near[frame]]] = True
    return near


def _find_sightings(sightings: Sightings, near: Bools) -> Sightings:
    """Keep the sightings in photos near by; the indices of the points do not change."""
    return replace(sightings, **rows_of(sightings, np.flatnonzero(near[sightings.frame]), "n"))


def _part(adjustment: Adjustment, part: Selection) -> Neighbourhood:
    whole, survey = adjustment.problem, part.survey
    used = np.isin(part.line_index, whole.line_index)
    problem = SurveyProblem(survey, whole.pivot_m, used)
    layout, of = problem.layout, whole.layout
    size, frames = layout.point_size, part.frame_index
    tape = np.array([whole.tapes.index(name) for name in problem.tapes], dtype=np.int64)
    tie = np.concatenate([part.chain_index, adjustment.survey.matches.points + part.tie_index])
    picked = np.searchsorted(adjustment.survey.identified, part.label_index[survey.identified])
    columns = [
        of.point_columns(part.label_index)[:, :size],
        of.picked_columns(picked)[:, :size],
        of.tie_columns(tie)[:, :size],
        of.first_frame + of.frame_size * frames[:, None] + np.arange(layout.frame_size),
        np.arange(of.first_intrinsic, of.first_tape),
        of.first_tape + tape,
        np.arange(of.first_readout, of.size),
    ]
    state = adjustment.state
    return Neighbourhood(
        problem,
        np.concatenate([own.ravel() for own in columns]),
        replace(
            state,
            point=state.point[part.label_index, :size],
            picked=state.picked[picked][:, :size],
            tie=state.tie[tie][:, :size],
            center=state.center[frames],
            rotation=state.rotation[frames],
            turning=state.turning[frames] if layout.turning else np.zeros((len(frames), 0)),
            tape=state.tape[tape],
        ),
    )


def split_into_groups(place_m: Floats, most: int) -> list[Ints]:
    """Split places (n, 2) into groups of up to `most` rows by halving along the longer axis."""
    waiting, found = [np.arange(len(place_m))], []
    while waiting:
        rows = waiting.pop()
        if len(rows) <= most:
            found.append(rows)
            continue
        axis = int(np.argmax(np.ptp(place_m[rows], axis=0)))
        rows = rows[np.argsort(place_m[rows, axis], kind="stable")]
        waiting += [rows[: len(rows) // 2], rows[len(rows) // 2 :]]
    return found
