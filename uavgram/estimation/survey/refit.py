"""The adjustment again, of slightly different observations: with the factor that is at hand.

Gauss-Newton steps with the normal matrix of the first adjustment ("simplified Newton") cost an
evaluation and a back substitution each. Where they do not come to rest fast, because the normal
matrix has turned too far, the full iteration goes on from there.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.sparse import csr_array

from uavgram.estimation.solver.levenberg_marquardt import AT_REST, CONVERGED, minimise
from uavgram.estimation.solver.normal_equations import Block, SingularError, gradient_of
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.unknowns import State, advance, some
from uavgram.model.arrays import Floats

FAST = 0.5
"""Ratio of the squared lengths of successive steps above which a new normal matrix pays."""

NEAR = 0.3
"""Squared length of a step, in sigmas of the unknowns, up to which it may be the last because what
is asked hardly feels it."""

UNFELT = 0.01
"""By how many of its sigmas a step then may move what is asked."""

STEADY = 0.9
"""In place of `FAST`, for such steps: ten of them cost what a few new normal matrices do."""

ENTRIES = 2_000_000
"""Numbers in the derivatives of all states that are evaluated together: 16 MB."""


def refit(
    adjustment: Adjustment,
    errors: Mapping[str, Floats],
    at_rest: float = CONVERGED,
    begin: State | None = None,
) -> State | None:
    """The state that fits observations with errors; None where there is none.

    Parameters
    ----------
    adjustment
        Of the observations as they are.
    errors
        (n, r) by group, in whitened units: an error e of the observations makes their residuals
        r - e. Groups that are not named keep theirs.
    at_rest
        Squared length of a step, in sigmas of the unknowns, from which on it is the last.
    begin
        A state near by; None: where the adjustment stands.
    """
    layout, factor = adjustment.problem.layout, adjustment.minimum.factor
    state, previous = adjustment.state, np.inf
    before = state
    blocks: Mapping[str, Block] | None = adjustment.minimum.blocks
    if begin is not None and (near := adjustment.problem.evaluate(begin)) is not None:
        state, blocks = begin, near
    while blocks is not None:
        moved = with_errors(blocks, errors)
        gradient = gradient_of(moved.values(), layout.size)
        step = -factor.solve(gradient)
        length = float(-gradient @ step)
        if length > FAST * previous:
            return _in_full(adjustment, state, errors, at_rest, moved)
        before, state, previous = state, advance(layout, state, step), length
        if length < at_rest:
            return state
        blocks = adjustment.problem.evaluate(state)
    return _in_full(adjustment, before, errors, at_rest)


def refit_many(
    adjustment: Adjustment,
    errors: Mapping[str, Floats],
    at_rest: float = CONVERGED,
    begin: State | None = None,
    asked: csr_array | None = None,
) -> list[State | None]:
    """As `refit`, of many sets of errors: their steps are taken together.

    Parameters
    ----------
    adjustment, at_rest
        As there.
    errors
        (m, n, r) by group, of all groups with errors: m sets of them.
    begin
        m states near by, stacked; None: where the adjustment stands.
    asked
        (m, size) gradient of what is asked of each, in its sigmas: steps that come to rest slowly
        are the last where they hardly move it. Kinks of the interpolated flight make photos far
        from what is asked go to and fro, and no other normal matrix ends that.
    """
    layout, factor = adjustment.problem.layout, adjustment.minimum.factor
    count = len(next(iter(errors.values())))
    found: list[State | None] = [None] * count
    left = np.arange(count)
    states = begin
    previous = np.full(count, np.inf)
    while True:
        own = {name: error[left] for name, error in errors.items()}
        gradient = _gradients(adjustment, states, own)
        if gradient is None:
            break
        step = -factor.solve(gradient.T).T
        length = -(gradient * step).sum(axis=1)
        is_slow = length > FAST * previous
        is_last = ~is_slow & (length < at_rest)
        if asked is not None and is_slow.any():
            moved = np.abs(asked[left].multiply(step).sum(axis=1))
            is_last |= is_slow & (length < NEAR) & (moved < UNFELT)
            is_slow &= length > np.where(length < NEAR, STEADY, FAST) * previous
        for row in np.flatnonzero(is_slow & ~is_last).tolist():
            one = {name: error[row] for name, error in own.items()}
            state = adjustment.state if states is None else some(states, row)
            found[left[row]] = _in_full(adjustment, state, one, at_rest)
        trial = advance(layout, adjustment.state if states is None else states, step)
        for row in np.flatnonzero(is_last).tolist():
            found[left[row]] = some(trial, row)
        further = np.flatnonzero(~is_slow & ~is_last)
        if not len(further):
            return found
        left, previous, states = left[further], length[further], some(trial, further)
    for row in left.tolist():  # one of them is impossible: each alone
        one = {name: error[row] for name, error in errors.items()}
        near = None if begin is None else some(begin, row)
        found[row] = refit(adjustment, one, at_rest, near)
    return found


def _gradients(
    adjustment: Adjustment, states: State | None, errors: Mapping[str, Floats]
) -> Floats | None:
    """(m, size) by m sets of errors, at one state each; None where one of these is impossible.

    Without states where the adjustment stands. Derivatives of a few states at a time are held.
    """
    size = adjustment.problem.layout.size
    there = adjustment.minimum.blocks
    count = len(next(iter(errors.values())))
    at_once = max(1, ENTRIES // sum(block.jacobian.size for block in there.values()))
    gradient = np.empty((count, size))
    for first in range(0, count, at_once):
        rows = np.arange(first, min(first + at_once, count))
        blocks = there if states is None else adjustment.problem.evaluate(some(states, rows))
        if blocks is None:
            return None
        own = {name: error[rows] for name, error in errors.items()}
        gradient[rows] = gradient_of(with_errors(blocks, own).values(), size)
    return gradient


def with_errors(blocks: Mapping[str, Block], errors: Mapping[str, Floats]) -> dict[str, Block]:
    """The blocks as they would be, had the observations these errors."""
    return {
        name: Block(block.residual - errors[name], block.columns, block.jacobian)
        if name in errors
        else block
        for name, block in blocks.items()
    }


def _in_full(
    adjustment: Adjustment,
    start: State,
    errors: Mapping[str, Floats],
    at_rest: float,
    first: dict[str, Block] | None = None,
) -> State | None:
    problem, layout = adjustment.problem, adjustment.problem.layout

    def evaluate(state: State) -> dict[str, Block] | None:
        blocks = problem.evaluate(state)
        return None if blocks is None else with_errors(blocks, errors)

    try:
        minimum = minimise(
            start,
            evaluate,
            lambda state, step: advance(layout, state, step),
            layout.size,
            layout.structure,
            at_rest=min(at_rest, 0.1 * AT_REST),
            first=first,
        )
    except SingularError:
        return None
    return minimum.state if minimum.converged else None
