"""Is first order enough? Measured values of observations moved by sqrt(3) sigmas.

An estimate is a function of the observations, and first-order propagation takes it for a plane.
For each measurement the observations are moved along orthogonal directions that move its points,
both ways by sqrt(3) sigmas, as in the unscented transform (Julier & Uhlmann 2004, with
n + kappa = 3, which meets the fourth moment of the normal distribution). The first direction is
the one that moves the measurement most: along it the survey is adjusted anew, so that the
curvature is that of the whole chain (lens, pose, plane, shape). The others move it in second order
only; along them the points move by the first-order solution, and the curvature is that of the
shape: near a coincidence of two points, say, that is what makes a distance too long.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.linalg import helmert
from scipy.sparse import csc_array, csr_array, hstack

from uavgram.estimation.measuring.kinds import refers_to_ground
from uavgram.estimation.measuring.propagation import MeasuredValues, values_at
from uavgram.estimation.measuring.quadratic import REACH
from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.refit import ENTRIES, refit_many
from uavgram.estimation.survey.unknowns import (
    Layout,
    State,
    advance,
    between,
    move,
    stacked,
    unstacked,
)
from uavgram.model.arrays import Floats, Ints
from uavgram.model.flight.frames import Frames
from uavgram.model.survey.observations import MeasurementRequest

AT_REST = 1e-3
"""Squared length, in sigmas, of the last step of an adjustment anew: curvature needs no more."""

FLAT = 1e-9
"""Variance, as a share of the largest, of directions that do not move the points."""

TOGETHER = 32
"""Measured values whose observations are moved together: solved for at once."""


class Curvature(NamedTuple):
    """Second-order terms of M measured values.

    Attributes
    ----------
    bias
        (M,) mean minus value; NaN where observations so near have no solution.
    sigma
        (M,) standard deviation with second-order terms; NaN likewise.
    curvature
        (M,) largest change of slope over one sigma, in slopes; NaN likewise.
    """

    bias: Floats
    sigma: Floats
    curvature: Floats


def curvature(
    adjustment: Adjustment,
    measured: MeasuredValues,
    requests: tuple[MeasurementRequest, ...],
    frames: Frames,
) -> Curvature:
    """Second-order bias and sigma of every measured value.

    Parameters
    ----------
    adjustment, measured
        The adjusted survey, and what was measured in it.
    requests, frames
        As they were measured.

    Notes
    -----
    With m+ and m- at +-t: slope (m+ - m-) / 2t, which holds the third derivative as the variance
    of a normal variable does; second derivative c = (m+ + m- - 2 m) / t^2; bias sum(c) / 2,
    variance sum(slope^2 + c^2 / 2).
    """
    found = Curvature(*(np.full(len(measured.rows), np.nan) for _ in range(3)))
    some: list[tuple[MeasurementRequest, Ints]] = []
    first = 0
    for request in requests:
        count = sum(1 for row in measured.rows[first:] if row.request is request)
        rows = np.arange(first, first + count, dtype=np.int64)
        first += len(rows)
        if np.isfinite(measured.value[rows]).all():
            some.append((request, rows))
        if sum(len(rows) for _, rows in some) >= TOGETHER:
            _curved(adjustment, measured, some, frames, found)
            some = []
    if some:
        _curved(adjustment, measured, some, frames, found)
    return found


def _curved(
    adjustment: Adjustment,
    measured: MeasuredValues,
    some: Sequence[tuple[MeasurementRequest, Ints]],
    frames: Frames,
    found: Curvature,
) -> None:
    """Second-order terms of some requests, with their rows: their observations move together."""
    steps = [REACH * own for own in _directions(adjustment, measured, some)]
    towards = [own[: len(rows)] for own, (_, rows) in zip(steps, some, strict=True)]
    every = np.concatenate([rows for _, rows in some])
    sigma = measured.sigma[every]
    asked = csr_array(measured.gradient[:, every].T / np.where(sigma > 0, sigma, 1.0)[:, None])
    adjusted = iter(_adjusted_both_ways(adjustment, np.concatenate(towards), asked))
    for own, (request, rows) in zip(steps, some, strict=True):
        ends = [next(adjusted) for _ in rows]
        pairs = list(_pairs(adjustment, measured, request, frames, rows, ends, own[len(rows) :]))
        _collect(np.array(pairs), measured, rows, found)


def _pairs(
    adjustment: Adjustment,
    measured: MeasuredValues,
    request: MeasurementRequest,
    frames: Frames,
    rows: Ints,
    adjusted: Sequence[tuple[State | None, State | None]],
    plainly: Floats,
) -> Iterator[tuple[Floats, Floats]]:
    """Values of one request at both ends of each direction; NaN where there is no solution.

    The directions are those with states `adjusted` to them, and the steps `plainly` taken.
    """
    layout, columns, state = _ground_alone(adjustment)
    moved = unstacked(advance(layout, state, _both_ways(plainly[:, columns])))
    for states in (*adjusted, *zip(moved, moved, strict=True)):
        ends = [
            np.full(len(rows), np.nan)
            if state is None
            else values_at(adjustment, state, (request,), frames)
            for state in states
        ]
        yield ends[0], ends[1]
    sources = {source for row in rows for source in measured.rows[row].others}
    for source in sorted(sources):
        state = adjustment.state
        ends = [
            values_at(adjustment, state, (request,), frames, partial(_error_in, source, reach))
            for reach in (REACH, -REACH)
        ]
        yield ends[0], ends[1]


def _ground_alone(adjustment: Adjustment) -> tuple[Layout, Ints, State]:
    """The unknowns without those of tie points and of all photos but the first; which, and where.

    Values at steps that are plainly taken ask for no photo; the first one may hold the gauge.
    """
    whole, state = adjustment.problem.layout, adjustment.state
    layout = replace(whole, frames=min(1, whole.frames), ties=0)
    after = whole.first_frame + layout.frames * layout.frame_size
    columns = np.r_[
        : whole.first_tie, whole.first_frame : after, whole.first_intrinsic : whole.size
    ]
    few = slice(layout.frames)
    first = replace(
        state,
        center=state.center[few],
        rotation=state.rotation[few],
        turning=state.turning[few],
        tie=state.tie[:0],
    )
    return layout, columns, first


def _both_ways(steps: Floats) -> Floats:
    """(2n, size) each of n steps, and its opposite behind it."""
    return np.stack([steps, -steps], axis=1).reshape(-1, steps.shape[1])


def _adjusted_both_ways(
    adjustment: Adjustment, steps: Floats, asked: csr_array
) -> list[tuple[State | None, State | None]]:
    """The states that fit observations moved as `steps`, and as their opposites, would move them.

    What parts the one from a plain step, in second order parts the other as well: it begins there.
    """
    layout, state = adjustment.problem.layout, adjustment.state
    ahead = _adjusted(adjustment, steps, asked)
    behind: list[State | None] = [None] * len(steps)
    there = [row for row, end in enumerate(ahead) if end is not None]
    if there:
        ends = stacked([end for end in ahead if end is not None])
        bent = between(layout, advance(layout, state, steps[there]), ends)
        begin = move(layout, advance(layout, state, -steps[there]), bent)
        back = _adjusted(adjustment, -steps[there], asked[there], begin)
        for row, end in zip(there, back, strict=True):
            behind[row] = end
    alone = [row for row, end in enumerate(behind) if end is None]
    if alone:
        back = _adjusted(adjustment, -steps[alone], asked[alone])
        for row, end in zip(alone, back, strict=True):
            behind[row] = end
    return list(zip(ahead, behind, strict=True))


def _adjusted(
    adjustment: Adjustment, steps: Floats, asked: csr_array, begin: State | None = None
) -> list[State | None]:
    """The states that fit observations moved as `steps` would move them; None where there is none.

    The gauge is no observation, and stays.
    """
    errors = {
        name: _moved(block, steps)
        for name, block in adjustment.minimum.blocks.items()
        if name != "gauge"
    }
    return refit_many(adjustment, errors, AT_REST, begin, asked)


def _moved(block: Block, steps: Floats) -> Floats:
    """(m, n, r) by which whitened observations would move with m steps; some rows at a time."""
    n, r, k = block.jacobian.shape
    moved = np.empty((len(steps), n, r))
    at_once = max(1, ENTRIES // (k * len(steps)))
    for first in range(0, n, at_once):
        rows = slice(first, first + at_once)
        moved[:, rows] = np.moveaxis(block.times(rows, steps.T), 2, 0)
    return moved


def _error_in(one: str, reach: float, source: str) -> float:
    """Error of a source, where only one has any."""
    return reach if source == one else 0.0


def _directions(
    adjustment: Adjustment,
    measured: MeasuredValues,
    some: Sequence[tuple[MeasurementRequest, Ints]],
) -> Iterator[Floats]:
    """(d, size) steps of the unknowns by observations that move by one sigma each, by request.

    The observations move along J s, which moves the unknowns by s, and s^T N s = 1: orthogonal
    directions of the observations' space, the first ones towards the measured values.
    """
    spreads = [_spread_of(adjustment, request) for request, _ in some]
    together = adjustment.minimum.factor.solve(hstack(spreads, format="csc"))
    ends = np.cumsum([spread.shape[1] for spread in spreads])[:-1]
    for spread, solved, (_, rows) in zip(
        spreads, np.split(together, ends, axis=1), some, strict=True
    ):
        joint = spread.T @ solved
        sigma = np.sqrt(np.diag(joint))
        sigma = np.where(sigma > 0, sigma, 1.0)
        variance, axes = np.linalg.eigh(joint / np.outer(sigma, sigma))
        kept = variance > FLAT * variance.max()
        whitened = (axes[:, kept] / np.sqrt(variance[kept])) / sigma[:, None]
        steps = solved @ whitened
        towards = steps.T @ measured.gradient[:, rows]
        turned, _ = np.linalg.qr(np.concatenate([towards, np.eye(len(towards))], axis=1))
        yield np.asarray((steps @ turned).T)


def _spread_of(adjustment: Adjustment, request: MeasurementRequest) -> csc_array:
    """Of the points of a request, and where it refers to the ground, of their heights over it."""
    label = np.unique(adjustment.label_rows(request.points))
    size = adjustment.problem.layout.size
    _, jacobian, columns = adjustment.points_with_jacobian(label)
    spread = _spread(size, jacobian, columns)
    if not refers_to_ground(request):
        return spread
    _, of_feet, _ = adjustment.ground_with_jacobian(label)
    return csc_array(hstack([spread, _spread(size, jacobian - of_feet, columns)]))


def _spread(size: int, jacobian: Floats, columns: Ints) -> csc_array:
    """(size, 3n) gradients of n places, their mean apart from what parts them.

    All may share an error a million times as large.
    """
    n = len(jacobian)
    at = 3 * np.arange(n)[:, None, None] + np.arange(3)[:, None]
    where = (
        np.broadcast_to(columns[:, None, :], jacobian.shape),
        np.broadcast_to(at, jacobian.shape),
    )
    spread = csc_array((jacobian.ravel(), tuple(w.ravel() for w in where)), shape=(size, 3 * n))
    return csc_array(spread @ csc_array(np.kron(helmert(n, full=True).T, np.eye(3))))


def _collect(pairs: Floats, measured: MeasuredValues, rows: Ints, found: Curvature) -> None:
    """Second-order terms from the values (d, 2, rows) at both ends of each direction."""
    middle = measured.value[rows]
    slope = (pairs[:, 0] - pairs[:, 1]) / (2.0 * REACH)
    second = (pairs[:, 0] + pairs[:, 1] - 2.0 * middle) / REACH**2
    found.bias[rows] = 0.5 * second.sum(axis=0)
    found.sigma[rows] = np.sqrt((slope**2 + 0.5 * second**2).sum(axis=0))
    found.curvature[rows] = np.abs(second).max(axis=0) / measured.sigma[rows]
