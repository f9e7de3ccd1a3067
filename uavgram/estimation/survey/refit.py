"""The adjustment again, of slightly different observations: with the factor that is at hand.

Gauss-Newton steps with the normal matrix of the first adjustment ("simplified Newton") cost an
evaluation and a back substitution each. Where they do not come to rest fast, because the normal
matrix has turned too far, the full iteration goes on from there.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from uavgram.estimation.solver.levenberg_marquardt import AT_REST, CONVERGED, minimise
from uavgram.estimation.solver.normal_equations import Block, SingularError, gradient_of
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.unknowns import State, advance
from uavgram.model.arrays import Floats

FAST = 0.5
"""Ratio of the squared lengths of successive steps above which a new normal matrix pays."""


def refit(
    adjustment: Adjustment,
    errors: Mapping[str, Floats],
    at_rest: float = CONVERGED,
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
    """
    layout, factor = adjustment.problem.layout, adjustment.minimum.factor
    state, previous = adjustment.state, np.inf
    before = state
    blocks: Mapping[str, Block] | None = adjustment.minimum.blocks
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
