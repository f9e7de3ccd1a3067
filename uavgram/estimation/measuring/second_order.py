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

from collections.abc import Iterator
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.linalg import helmert

from uavgram.estimation.measuring.kinds import refers_to_ground
from uavgram.estimation.measuring.propagation import MeasuredValues, values_at
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.refit import refit
from uavgram.estimation.survey.unknowns import State, advance, between, move, unstacked
from uavgram.model.arrays import Floats, Ints
from uavgram.model.flight.frames import Frames
from uavgram.model.survey.observations import MeasurementRequest

REACH = float(np.sqrt(3.0))

AT_REST = 1e-3
"""Squared length, in sigmas, of the last step of an adjustment anew: curvature needs no more."""

FLAT = 1e-9
"""Variance, as a share of the largest, of directions that do not move the points."""


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
    first = 0
    for request in requests:
        count = sum(1 for row in measured.rows[first:] if row.request is request)
        rows = np.arange(first, first + count, dtype=np.int64)
        first += len(rows)
        if np.isfinite(measured.value[rows]).all():
            pairs = list(_pairs(adjustment, measured, request, frames, rows))
            _collect(np.array(pairs), measured, rows, found)
    return found


def _pairs(
    adjustment: Adjustment,
    measured: MeasuredValues,
    request: MeasurementRequest,
    frames: Frames,
    rows: Ints,
) -> Iterator[tuple[Floats, Floats]]:
    """Values of one request at both ends of each direction; NaN where there is no solution."""
    directions = REACH * _directions(adjustment, measured, request, rows)
    plain = advance(
        adjustment.problem.layout, adjustment.state, _both_ways(directions[len(rows) :])
    )
    pairs = [_adjusted_both_ways(adjustment, step) for step in directions[: len(rows)]]
    moved = unstacked(plain)
    for states in (*pairs, *zip(moved, moved, strict=True)):
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


def _both_ways(steps: Floats) -> Floats:
    """(2n, size) each of n steps, and its opposite behind it."""
    return np.stack([steps, -steps], axis=1).reshape(-1, steps.shape[1])


def _adjusted_both_ways(adjustment: Adjustment, step: Floats) -> tuple[State | None, State | None]:
    """The states that fit observations moved as `step`, and as its opposite, would move them.

    What parts the one from a plain step, in second order parts the other as well: it begins there.
    """
    layout, way = adjustment.problem.layout, partial(advance, adjustment.problem.layout)
    ahead = _adjusted(adjustment, step)
    if ahead is None:
        return None, _adjusted(adjustment, -step)
    bent = between(layout, way(adjustment.state, step), ahead)
    begin = move(layout, way(adjustment.state, -step), bent)
    behind = _adjusted(adjustment, -step, begin)
    return ahead, _adjusted(adjustment, -step) if behind is None else behind


def _adjusted(adjustment: Adjustment, step: Floats, begin: State | None = None) -> State | None:
    """The state that fits observations moved as `step` would move them; None where there is none.

    The gauge is no observation, and stays.
    """
    errors = {
        name: np.einsum("nrk,nk->nr", block.jacobian, step[block.columns])
        for name, block in adjustment.minimum.blocks.items()
        if name != "gauge"
    }
    return refit(adjustment, errors, AT_REST, begin)


def _error_in(one: str, reach: float, source: str) -> float:
    """Error of a source, where only one has any."""
    return reach if source == one else 0.0


def _directions(
    adjustment: Adjustment, measured: MeasuredValues, request: MeasurementRequest, rows: Ints
) -> Floats:
    """(d, size) steps of the unknowns by observations that move by one sigma each.

    The observations move along J s, which moves the unknowns by s, and s^T N s = 1: orthogonal
    directions of the observations' space, the first ones towards the measured values.
    """
    survey = adjustment.survey
    label = np.unique([survey.label.index(p) for p in request.points])
    size = adjustment.problem.layout.size
    _, jacobian, columns = adjustment.points_with_jacobian(label)
    spread = _spread(size, jacobian, columns)
    if refers_to_ground(request):
        _, of_feet, _ = adjustment.ground_with_jacobian(label)
        spread = np.concatenate([spread, _spread(size, jacobian - of_feet, columns)], axis=1)
    solved = adjustment.minimum.factor.solve(spread)
    joint = spread.T @ solved
    sigma = np.sqrt(np.diag(joint))
    sigma = np.where(sigma > 0, sigma, 1.0)
    variance, axes = np.linalg.eigh(joint / np.outer(sigma, sigma))
    kept = variance > FLAT * variance.max()
    whitened = (axes[:, kept] / np.sqrt(variance[kept])) / sigma[:, None]
    steps = solved @ whitened
    towards = steps.T @ measured.gradient[:, rows]
    turned, _ = np.linalg.qr(np.concatenate([towards, np.eye(len(towards))], axis=1))
    return np.asarray((steps @ turned).T)


def _spread(size: int, jacobian: Floats, columns: Ints) -> Floats:
    """(size, 3n) gradients of n places, their mean apart from what parts them.

    All may share an error a million times as large.
    """
    n = len(jacobian)
    spread = np.zeros((size, 3 * n))
    at = 3 * np.arange(n)[:, None, None] + np.arange(3)[:, None]
    np.add.at(spread, (columns[:, None, :], at), jacobian)
    return np.asarray(spread @ np.kron(helmert(n, full=True).T, np.eye(3)))


def _collect(pairs: Floats, measured: MeasuredValues, rows: Ints, found: Curvature) -> None:
    """Second-order terms from the values (d, 2, rows) at both ends of each direction."""
    middle = measured.value[rows]
    slope = (pairs[:, 0] - pairs[:, 1]) / (2.0 * REACH)
    second = (pairs[:, 0] + pairs[:, 1] - 2.0 * middle) / REACH**2
    found.bias[rows] = 0.5 * second.sum(axis=0)
    found.sigma[rows] = np.sqrt((slope**2 + 0.5 * second**2).sum(axis=0))
    found.curvature[rows] = np.abs(second).max(axis=0) / measured.sigma[rows]
