"""Readjustment of observations that moved a little, by kept factors or in full.

`refit` takes Gauss-Newton steps with the normal matrix of the first adjustment ("simplified
Newton"), which cost an evaluation and a back substitution each. Where they do not converge fast,
because the normal matrix has changed too much, the full iteration continues from there.

`readjust_moved` takes such steps for many movements at once. Observations near the moved ones are
evaluated at every step; those farther away keep the linear model of the first adjustment. With x =
x0 + s + d, where s is the first-order effect of the movement, the correction d is

    d = - N^-1 sum over rows near by of  J(x)^T (r(x) - e) - J0^T (r0 + J0 d).

The change of a requested function by the next step is known without a solution of the normal
equations, as S g, the columns of the covariance times its gradient g, are known.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array, vstack

from uavgram.estimation.solver.levenberg_marquardt import (
    MAX_UNDAMPED_REDUCTION,
    MIN_REDUCTION,
    minimise,
)
from uavgram.estimation.solver.normal_equations import (
    Block,
    Factor,
    SingularError,
    compute_gradient,
    sum_by_unknown,
)
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.neighbours import Neighbourhood
from uavgram.estimation.survey.unknowns import State, advance_state, select_states
from uavgram.model.arrays import Bools, Floats, Ints

MAX_STEP_RATIO = 0.5
"""Ratio of the squared lengths of successive steps above which a new normal matrix is cheaper."""


def refit(
    adjustment: Adjustment,
    errors: Mapping[str, Floats],
    at_rest: float = MIN_REDUCTION,
) -> State | None:
    """Estimate the state that fits observations with errors; None if there is none.

    Parameters
    ----------
    adjustment
        Adjustment of the observations as they are.
    errors
        (n, r) by group, in whitened units: an error e of the observations makes their residuals r -
        e. Groups that are not named keep theirs.
    at_rest
        Squared length of a step, in sigmas of the unknowns, below which it is the last.
    """
    layout, factor = adjustment.problem.layout, adjustment.minimum.factor
    state, previous = adjustment.state, np.inf
    before = state
    blocks: Mapping[str, Block] | None = adjustment.minimum.blocks
    while blocks is not None:
        moved = add_errors(blocks, errors)
        gradient = compute_gradient(moved.values(), layout.size)
        step = -factor.solve(gradient)
        # Squared length of the step in sigmas: step^T N step.
        length = float(-gradient @ step)
        if length > MAX_STEP_RATIO * previous:
            return _refit_all(adjustment, state, errors, at_rest)
        before, state, previous = state, advance_state(layout, state, step), length
        if length < at_rest:
            return state
        blocks = adjustment.problem.evaluate(state)
    return _refit_all(adjustment, before, errors, at_rest)


def add_errors(blocks: Mapping[str, Block], errors: Mapping[str, Floats]) -> dict[str, Block]:
    """Return the blocks of observations with these errors added."""
    return {
        name: Block(block.residual - errors[name], block.columns, block.jacobian)
        if name in errors
        else block
        for name, block in blocks.items()
    }


def _refit_all(
    adjustment: Adjustment, start: State, errors: Mapping[str, Floats], at_rest: float
) -> State | None:
    problem, layout = adjustment.problem, adjustment.problem.layout

    def evaluate(state: State) -> dict[str, Block] | None:
        blocks = problem.evaluate(state)
        return None if blocks is None else add_errors(blocks, errors)

    try:
        minimum = minimise(
            start,
            evaluate,
            lambda state, step: advance_state(layout, state, step),
            layout.size,
            layout.structure,
            at_rest=min(at_rest, 0.1 * MAX_UNDAMPED_REDUCTION),
        )
    except SingularError:
        return None
    return minimum.state if minimum.converged else None


MAX_NONLINEARITY_AT_END = 0.005
"""Largest squared departure of the observations from the linear model, in sigmas, with which the
first step is the last: further steps would change the requested functions by about as many of their
sigmas."""

MAX_LAST_CHANGE = 0.005
"""Largest change of a requested function by the last step, in its sigmas."""

MAX_LAST_STEP = 0.01
"""Largest squared length of the last step, in sigmas."""

MAX_LAST_STEP_OF_ALL = 1e-3
"""Squared length, in sigmas, of the last step when the whole survey is adjusted anew."""

MAX_NONLINEARITY = 2.0
"""Squared departure from the linear model, in sigmas, from which such steps do not converge: the
whole survey is adjusted instead."""

MAX_NONLINEARITY_LATER = 100.0
"""Limit like `MAX_NONLINEARITY` after the first step: a step may diverge once, and return by mixing
with others."""

MAX_STEPS = 20
"""Largest number of steps."""

HISTORY_SIZE = 6
"""Number of steps that are mixed."""

DIAGONAL_SHARE = 1e-10
"""Share of the step lengths that is added to the diagonal, so that steps that repeat each other
count as different."""

ZERO_STEP = 1e-300
"""Squared length of a zero step."""

MAX_ENTRIES = 1_000_000
"""Numbers in the derivatives of all states that are evaluated together: 8 MB."""


@dataclass(frozen=True, eq=False)
class Readjustments:
    """Results of m adjustments of moved observations.

    Attributes
    ----------
    states
        Unknowns near by; None where the iteration did not converge.
    rest
        (m, r) change of the requested functions by the last step, which is not included in
        `states`.
    """

    states: list[State | None]
    rest: Floats


@dataclass(frozen=True, eq=False)
class Functionals:
    """Requested functions of the unknowns near by.

    Attributes
    ----------
    gradient
        (r, n) in sigmas of each.
    solved
        (r, n) the covariance of the unknowns times it.
    of
        (m, r) mask of the functions that are requested for each movement.
    """

    gradient: Floats
    solved: Floats
    of: Bools


def readjust_moved(
    near: Neighbourhood, factor: Factor, steps: Floats, asked: Functionals
) -> Readjustments:
    """Adjust observations that moved by the equivalent of `steps`.

    Parameters
    ----------
    near
        Unknowns near by.
    factor
        Factor of the whole survey.
    steps
        (m, n) first-order steps of the unknowns near by.
    asked
        Functions that have to converge.
    """
    count, base = len(steps), near.problem.evaluate(near.state)
    assert base is not None  # noqa: S101  (the adjustment stands there)
    plane = _LinearModel.of(base, steps.shape[1])
    found: list[State | None] = [None] * count
    rest = np.full((count, len(asked.gradient)), np.nan)
    left, way = np.arange(count), _Iteration.from_here(steps.shape)
    for taken in range(MAX_STEPS):
        states = advance_state(near.problem.layout, near.state, steps[left] + way.beyond)
        gradient, bent = _compute_departures(near, plane, states, steps[left], way.beyond)
        # Effect of the next step on the requested functions: g^T (-N^-1 gradient - beyond).
        ahead = -gradient @ asked.solved.T - way.beyond @ asked.gradient.T
        # Nearly linear movements end at once; very nonlinear or impossible ones do not converge.
        is_last = (bent < MAX_NONLINEARITY_AT_END) & (taken == 0)
        further = np.flatnonzero(
            ~is_last & (bent < (MAX_NONLINEARITY_LATER if taken else MAX_NONLINEARITY))
        )
        drive = gradient[further] + way.force[further]
        # step = -N^-1 drive
        step = factor.solve_among(near.columns, -drive.T).T
        felt = np.abs(np.where(asked.of[left[further]], ahead[further], 0.0)).max(axis=1)
        rests = (
            (felt < MAX_LAST_CHANGE) & (-(drive * step).sum(axis=1) < MAX_LAST_STEP) & (taken > 0)
        )
        is_last[further[rests]] = True
        for row in np.flatnonzero(is_last).tolist():
            found[left[row]] = select_states(states, row)
        rest[left[is_last]] = ahead[is_last]
        if rests.all():
            break
        way = way.further(further[~rests], drive[~rests], step[~rests])
        left = left[further[~rests]]
    return Readjustments(found, rest)


class _Iteration(NamedTuple):
    """Current positions of m iterations, and their last steps.

    Attributes
    ----------
    beyond
        (m, n) difference of each from its first step.
    force
        (m, n) normal matrix times that; zero except near by, where all of the step originates.
    past
        Last iterations, oldest first: `beyond`, `force`, the gradient that drove the step, and the
        step.
    """

    beyond: Floats
    force: Floats
    past: tuple[tuple[Floats, ...], ...]

    @classmethod
    def from_here(cls, shape: tuple[int, ...]) -> _Iteration:
        """Start with the first step alone."""
        return cls(np.zeros(shape), np.zeros(shape), ())

    def further(self, rows: Ints, drive: Floats, step: Floats) -> _Iteration:
        """Compute the next positions of some iterations from steps (r, n) and gradients (r, n).

        The next position is the mixture of the last steps' ends whose remaining step would be
        shortest, in sigmas, if everything were linear (Anderson 1965, Iterative procedures for
        nonlinear integral equations; Walker & Ni 2011). Plain steps diverge where the normal matrix
        has changed.
        """
        before = (tuple(one[rows] for one in each) for each in self.past)
        past = (*before, (self.beyond[rows], self.force[rows], drive, step))[-HISTORY_SIZE:]
        beyond, force = self.beyond[rows] + step, self.force[rows] - drive
        if len(past) > 1:
            by = [np.diff(np.stack(each, axis=1), axis=1) for each in zip(*past, strict=True)]
            by_beyond, by_force, by_drive, by_step = by
            # Inner products s^T N s' of steps s = -N^-1 g: -g^T s'
            joint = -by_step @ np.swapaxes(by_drive, 1, 2)
            part = _solve_small(
                0.5 * (joint + np.swapaxes(joint, 1, 2)), -by_drive @ step[..., None]
            )
            beyond = beyond - (part * (by_beyond + by_step)).sum(axis=1)
            force = force - (part * (by_force - by_drive)).sum(axis=1)
        return _Iteration(beyond, force, past)


def _solve_small(joint: Floats, right: Floats) -> Floats:
    """Solve small systems (m, h, h) for (m, h, 1), also where steps repeat each other."""
    scale = 1.0 / np.sqrt(np.maximum(np.einsum("mii->mi", joint), ZERO_STEP))[..., None]
    scaled = joint * scale * np.swapaxes(scale, 1, 2) + DIAGONAL_SHARE * np.eye(joint.shape[1])
    return np.asarray(np.linalg.solve(scaled, right * scale) * scale)


class _LinearModel(NamedTuple):
    """Linear model of all rows near by, group by group.

    Attributes
    ----------
    residual
        (R,) at the linearisation point.
    jacobian
        (R, n) by the unknowns near by.
    observed
        (R,) 1, but 0 for the gauge, which is no observation and does not move.
    """

    residual: Floats
    jacobian: csr_array
    observed: Floats

    @classmethod
    def of(cls, blocks: Mapping[str, Block], size: int) -> _LinearModel:
        """Return the linear model of an adjustment's blocks."""
        observed = [np.full(b.residual.size, float(name != "gauge")) for name, b in blocks.items()]
        return cls(
            np.concatenate([block.residual.ravel() for block in blocks.values()]),
            csr_array(vstack([block.sparse(size) for block in blocks.values()])),
            np.concatenate(observed),
        )

    def times(self, steps: Floats) -> Floats:
        """Compute the (m, R) changes of the rows by steps (m, n)."""
        return np.asarray((self.jacobian @ steps.T).T)


def _compute_departures(
    near: Neighbourhood, plane: _LinearModel, states: State, steps: Floats, beyond: Floats
) -> tuple[Floats, Floats]:
    """Compute the departures of m states from the linear model: gradients (m, n) and sizes (m,).

    The size is the squared length of the difference of the residuals from the linear model; NaN
    where a state is impossible.
    """
    count = len(steps)
    gradient, bent = np.full(steps.shape, np.nan), np.full(count, np.nan)
    at_once = max(1, MAX_ENTRIES // plane.jacobian.nnz)
    waiting = [np.arange(first, min(first + at_once, count)) for first in range(0, count, at_once)]
    while waiting:
        rows = waiting.pop()
        there = near.problem.evaluate(select_states(states, rows))
        if there is not None:
            gradient[rows], bent[rows] = _departure_gradients(
                plane, there, steps[rows], beyond[rows]
            )
        elif len(rows) > 1:  # bisect to isolate the impossible state
            waiting += [rows[: len(rows) // 2], rows[len(rows) // 2 :]]
    return gradient, bent


def _departure_gradients(
    plane: _LinearModel, there: Mapping[str, Block], steps: Floats, beyond: Floats
) -> tuple[Floats, Floats]:
    """Compute gradients (m, n) of departures from the linear model, and squared lengths (m,)."""
    count, size = steps.shape
    moved_by = plane.observed * plane.times(steps)
    expected = plane.residual + plane.times(beyond)
    found = np.concatenate([b.residual.reshape(count, -1) for b in there.values()], axis=1)
    # r(x) - e: the moved observations make the residuals smaller by J0 s.
    found -= moved_by
    gradient, first = -(plane.jacobian.T @ expected.T).T, 0
    for block in there.values():
        n, r = block.residual.shape[1:]
        own = found[:, first : first + n * r].reshape(count, n, r)
        gradient += sum_by_unknown(block.columns, block.multiply_transposed(own), size)
        first += n * r
    off = found - expected
    return gradient, np.einsum("mr,mr->m", off, off)


def readjust_moved_fully(adjustment: Adjustment, step: Floats) -> State | None:
    """Adjust the whole survey to observations moved by the equivalent of a step (size,)."""
    errors = {
        name: np.einsum("nrk,nk->nr", block.jacobian, step[block.columns])
        for name, block in adjustment.minimum.blocks.items()
        if name != "gauge"
    }
    return refit(adjustment, errors, MAX_LAST_STEP_OF_ALL)
