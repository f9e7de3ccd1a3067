"""Second-order check of measured values, from observations moved by sqrt(3) sigmas.

First-order propagation treats a measured value as a linear function of the observations. This
module computes the error of that approximation. For each measurement:

1. The observations are moved along orthogonal directions, both ways by sqrt(3) sigmas, as in the
   unscented transform (Julier & Uhlmann 2004, with n + kappa = 3, which matches the fourth moment
   of the normal distribution).
2. The first direction is the one that changes the value most. Along it the survey is readjusted:
   this gives the curvature of the whole chain (lens, pose, plane, shape).
3. Along the other directions, the points move by the first-order solution: this gives the
   curvature of the value as a function of its points. For example, noise makes the distance of two
   points that nearly coincide too long.
4. The second derivatives H follow from the values at both ends of each direction, and of each pair
   of directions. With the slopes g, by independent errors of sigma 1, the bias of the value is
   tr(H) / 2 and its variance g^T g + tr(H H) / 2 (Magnus 1978, "The moments of products of
   quadratic forms in normal variables"; likewise Criminisi 1997).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache, partial
from itertools import groupby
from typing import NamedTuple

import numpy as np
from scipy.linalg import helmert

from uavgram.estimation.measuring.propagation import (
    MeasuredValues,
    compute_values,
    compute_values_of_request,
    refers_to_ground,
)
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.neighbours import (
    Neighbourhood,
    find_neighbourhood,
    is_small,
    split_into_groups,
)
from uavgram.estimation.survey.readjustment import Functionals, readjust_moved, readjust_moved_fully
from uavgram.estimation.survey.unknowns import advance_state
from uavgram.estimation.survey.unknowns import select_states as some_of
from uavgram.model.arrays import Floats, Ints
from uavgram.model.frames import Frames
from uavgram.model.observations import MeasurementRequest

MOVE_SIGMAS = float(np.sqrt(3.0))
"""Sigmas by which errors are moved, as in the unscented transform (Julier & Uhlmann 2004, with n +
kappa = 3, which matches the fourth moment of the normal distribution)."""


class SecondOrderTerms(NamedTuple):
    """Second-order terms of M values: of the mean, and of the variance; (M,) each."""

    bias: Floats
    variance: Floats


def make_moves(directions: Floats) -> Floats:
    """Return error moves, both ways: (d (d + 1), n) for d orthonormal directions (d, n).

    First along each direction, then along the sum of each two.
    """
    first, second = np.triu_indices(len(directions), 1)
    ways = np.concatenate([directions, directions[first] + directions[second]])
    return MOVE_SIGMAS * np.concatenate([ways, -ways])


def compute_second_order_terms(values: Floats, middle: Floats) -> SecondOrderTerms:
    """Compute terms from values (S, M) at `make_moves`, in their order, and (M,) without any move.

    NaN if one of the values is.
    """
    ahead, behind = np.split(values - middle, 2)
    # Second differences along each direction and along each sum of two.
    bent = (ahead + behind) / MOVE_SIGMAS**2
    count = (int(np.sqrt(8 * len(bent) + 1)) - 1) // 2
    first, second = np.triu_indices(count, 1)
    own = bent[:count]
    # Mixed derivative: half of (H along the sum) - H_ii - H_jj.
    mixed = 0.5 * (bent[count:] - own[first] - own[second])
    # tr(H H) / 2: squares of the diagonal by half, and each mixed one counts twice.
    variance = 0.5 * np.sum(own**2, axis=0) + np.sum(mixed**2, axis=0)
    return SecondOrderTerms(0.5 * own.sum(axis=0), variance)


MIN_VARIANCE_SHARE = 1e-9
"""Variance, as a share of the largest, below which directions do not move the points."""

GROUP_SIZE = 16
"""Number of requests near each other whose observations are moved together, by one solution."""

GROUP_SIZE_IN_SMALL = 256
"""The same for a small survey, which is all near: grouping by distance gains nothing there."""

RequestRows = Sequence[tuple[MeasurementRequest, Ints]]
"""Requests, and the rows of their values."""


class Curvature(NamedTuple):
    """Second-order terms of M measured values.

    Attributes
    ----------
    bias
        (M,) mean minus value; NaN if moved observations have no solution.
    sigma
        (M,) standard deviation with second-order terms; NaN likewise.
    curvature
        (M,) largest change of slope over one sigma, in slopes; NaN likewise.
    """

    bias: Floats
    sigma: Floats
    curvature: Floats


class _Direction(NamedTuple):
    """Steps (d, n) of the unknowns near by, the first ones towards the values of a request.

    `whole` holds the unknowns (u,) and right-hand sides (u, d) whose solutions are the steps of all
    unknowns.
    """

    steps: Floats
    whole: tuple[Ints, Floats]


def compute_curvature(
    adjustment: Adjustment,
    measured: MeasuredValues,
    frames: Frames,
) -> Curvature:
    """Compute second-order bias and sigma of every measured value.

    Parameters
    ----------
    adjustment, measured
        Adjusted survey, and the values measured in it.
    frames
        Frames that were used for the measurement.

    Notes
    -----
    With m+ and m- at +-t: slope (m+ - m-) / 2t, which contains the third derivative as the variance
    of a normal variable does; second derivative c = (m+ + m- - 2 m) / t^2; bias sum(c) / 2,
    variance sum(slope^2 + c^2 / 2).
    """
    found = Curvature(*(np.full(len(measured.rows), np.nan) for _ in range(3)))
    value = measured.value
    wanted = []
    for _, same in groupby(range(len(value)), key=lambda row: id(measured.rows[row].request)):
        rows = np.array(list(same))
        if np.isfinite(value[rows]).all():
            wanted.append((measured.rows[rows[0]].request, rows))
    if not wanted:
        return found
    place = adjustment.state.point[:, :2]
    middle = [place[adjustment.label_rows(one.points)].mean(axis=0) for one, _ in wanted]
    most = GROUP_SIZE_IN_SMALL if is_small(adjustment.survey) else GROUP_SIZE
    for group in split_into_groups(np.array(middle), most):
        _compute_terms(adjustment, measured, [wanted[k] for k in group], frames, found)
    return found


def _compute_terms(
    adjustment: Adjustment,
    measured: MeasuredValues,
    some: RequestRows,
    frames: Frames,
    found: Curvature,
) -> None:
    """Compute second-order terms of some requests whose observations are moved together."""
    labels = adjustment.label_rows([label for request, _ in some for label in request.points])
    near = find_neighbourhood(adjustment, np.unique(labels))
    directions = list(_directions(adjustment, near, measured, some))
    ends = iter(_readjust(adjustment, near, measured, some, directions, frames))
    towards = [min(len(rows), len(d.steps)) for d, (_, rows) in zip(directions, some, strict=True)]
    plainly = [MOVE_SIGMAS * d.steps[first:] for d, first in zip(directions, towards, strict=True)]
    values = _move_linearly(near, [request for request, _ in some], frames, plainly)
    for first, others, (request, rows) in zip(towards, values, some, strict=True):
        pairs = [next(ends) for _ in range(first)] + others
        sources = {source for row in rows for source in measured.rows[row].others}
        for source in sorted(sources):
            errors = (partial(_get_error, source, reach) for reach in (MOVE_SIGMAS, -MOVE_SIGMAS))
            one, other = (
                compute_values(near.problem, near.state, (request,), frames, error)
                for error in errors
            )
            pairs.append((one, other))
        _collect(np.array(pairs), measured, rows, found)


def _move_linearly(
    near: Neighbourhood,
    requests: Sequence[MeasurementRequest],
    frames: Frames,
    steps: Sequence[Floats],
) -> Iterator[list[tuple[Floats, Floats]]]:
    """Yield the values of each request at both ends of its linear steps."""
    ends = np.cumsum([0, *(2 * len(own) for own in steps)])
    both = np.concatenate([np.concatenate([own, -own]) for own in steps])
    states = advance_state(near.problem.layout, near.state, both)
    for request, first, end in zip(requests, ends[:-1], ends[1:], strict=True):
        one = some_of(states, slice(first, end))
        values = (
            compute_values_of_request(near.problem, one, request, frames) if end > first else ()
        )
        half = len(values) // 2
        yield list(zip(values[:half], values[half:], strict=True))


def _readjust(
    adjustment: Adjustment,
    near: Neighbourhood,
    measured: MeasuredValues,
    some: RequestRows,
    directions: Sequence[_Direction],
    frames: Frames,
) -> Iterator[tuple[Floats, Floats]]:
    """Yield the values after readjustment of observations moved both ways towards each request."""
    every = np.concatenate([rows for _, rows in some])
    sigma = np.where(measured.sigma[every] > 0, measured.sigma[every], 1.0)
    of_row = np.repeat(np.arange(len(some)), [len(rows) for _, rows in some])
    # One direction for each value of a request, or fewer if its values are dependent.
    which = [
        (k, d)
        for k, (_, rows) in enumerate(some)
        for d in range(min(len(rows), len(directions[k].steps)))
    ]
    steps = MOVE_SIGMAS * np.array([directions[k].steps[d] for k, d in which])
    asked = Functionals(
        gradient=(measured.gradient[:, every].toarray()[near.columns] / sigma).T,
        solved=(measured.solved[near.columns[:, None], every] / sigma).T,
        of=np.tile(of_row, (2 * len(which), 1)) == np.array(which + which)[:, :1],
    )
    ends = readjust_moved(near, adjustment.minimum.factor, np.concatenate([steps, -steps]), asked)

    def value(row: int, sign: float, k: int, d: int) -> Floats:
        request, rows = some[k]
        state, own = ends.states[row], of_row == k
        if state is not None:
            last = ends.rest[row, own] * sigma[own]
            return np.asarray(compute_values(near.problem, state, (request,), frames) + last)
        unknowns, makes = directions[k].whole
        right = np.zeros(adjustment.minimum.factor.size)
        right[unknowns] = makes[:, d]
        step = sign * MOVE_SIGMAS * adjustment.minimum.factor.solve(right)
        whole = readjust_moved_fully(adjustment, step)
        if whole is None:
            return np.full(len(rows), np.nan)
        return compute_values(adjustment.problem, whole, (request,), frames)

    for row, (k, d) in enumerate(which):
        yield value(row, 1.0, k, d), value(row + len(which), -1.0, k, d)


def _get_error(one: str, reach: float, source: str) -> float:
    """Return the error of a source, if only one has any."""
    return reach if source == one else 0.0


def _directions(
    adjustment: Adjustment, near: Neighbourhood, measured: MeasuredValues, some: RequestRows
) -> Iterator[_Direction]:
    """Yield steps of the unknowns by observations that move by one sigma each, by request.

    The observations move along J s, which moves the unknowns by s, and s^T N s = 1: orthogonal
    directions of the observations' space, the first ones towards the measured values.
    """
    every = np.concatenate([rows for _, rows in some])
    gradients = measured.gradient[:, every].toarray()[near.columns]
    factor = adjustment.minimum.factor
    place = np.empty(factor.size, dtype=np.int64)  # of the unknowns among those near by
    place[near.columns] = np.arange(len(near.columns))
    spreads = [
        (unknowns, place[unknowns], spread)
        for unknowns, spread in _spreads(adjustment, [request for request, _ in some])
    ]
    count = sum(spread.shape[1] for *_, spread in spreads)
    right, last = np.zeros((len(near.columns), count)), 0
    for _, at, spread in spreads:
        first, last = last, last + spread.shape[1]
        right[at, first:last] = spread
    together = factor.solve_among(near.columns, right)
    last = last_row = 0
    for (unknowns, at, spread), (_, rows) in zip(spreads, some, strict=True):
        first, last = last, last + spread.shape[1]
        first_row, last_row = last_row, last_row + len(rows)
        solved, gradient = together[:, first:last], gradients[:, first_row:last_row]
        joint = spread.T @ solved[at]
        sigma = np.sqrt(np.diag(joint))
        sigma = np.where(sigma > 0, sigma, 1.0)
        # Whiten the covariance of the points (scaled to a unit diagonal), without null directions.
        variance, axes = np.linalg.eigh(joint / np.outer(sigma, sigma))
        kept = variance > MIN_VARIANCE_SHARE * variance.max()
        whitened = (axes[:, kept] / np.sqrt(variance[kept])) / sigma[:, None]
        towards = whitened.T @ (solved.T @ gradient)
        # QR: the first axes along the gradients of the values, the others orthogonal.
        turned, _ = np.linalg.qr(np.concatenate([towards, np.eye(len(towards))], axis=1))
        makes = whitened @ turned
        yield _Direction((solved @ makes).T, (unknowns, spread @ makes))


def _spreads(
    adjustment: Adjustment, requests: Sequence[MeasurementRequest]
) -> Iterator[tuple[Ints, Floats]]:
    """Yield the derivatives of each request's points, and of their heights if it needs the ground.

    The unknowns (u,) that they depend on, and gradients (u, 3n) by these.
    """
    own = [np.unique(adjustment.label_rows(request.points)) for request in requests]
    label = np.unique(np.concatenate(own))
    _, jacobian, columns = adjustment.points_with_jacobian(label)
    over_ground = jacobian - adjustment.ground_with_jacobian(label)[1]
    for request, labels in zip(requests, own, strict=True):
        rows = np.searchsorted(label, labels)
        unknowns, place = np.unique(columns[rows], return_inverse=True)
        parts = (jacobian, over_ground) if refers_to_ground(request) else (jacobian,)
        spread = [_spread(part[rows], place.reshape(len(rows), -1)) for part in parts]
        yield unknowns, np.concatenate(spread, axis=1)


def _spread(jacobian: Floats, columns: Ints) -> Floats:
    """Compute (u, 3n) gradients of n places by their unknowns (n, k).

    Of their mean, separate from their differences: all may share an error a million times as large.
    """
    n = len(jacobian)
    by_all = np.zeros((n, 3, columns.max() + 1))
    at = np.arange(n)[:, None, None], np.arange(3)[:, None], columns[:, None, :]
    np.add.at(by_all, at, jacobian)
    return np.asarray((_means(n) @ by_all.reshape(n, -1)).reshape(3 * n, -1).T)


@lru_cache
def _means(count: int) -> Floats:
    """Return an (n, n) orthogonal matrix: the mean of n numbers, and their differences."""
    return np.asarray(helmert(count, full=True))


def _collect(pairs: Floats, measured: MeasuredValues, rows: Ints, found: Curvature) -> None:
    """Compute second-order terms from the values (d, 2, rows) at both ends of each direction."""
    middle = measured.value[rows]
    slope = (pairs[:, 0] - pairs[:, 1]) / (2.0 * MOVE_SIGMAS)
    second = (pairs[:, 0] + pairs[:, 1] - 2.0 * middle) / MOVE_SIGMAS**2
    found.bias[rows] = 0.5 * second.sum(axis=0)
    found.sigma[rows] = np.sqrt((slope**2 + 0.5 * second**2).sum(axis=0))
    found.curvature[rows] = np.abs(second).max(axis=0) / measured.sigma[rows]
