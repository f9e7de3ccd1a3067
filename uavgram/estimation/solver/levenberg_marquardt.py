"""Levenberg-Marquardt over any state: the loop alone, without knowing what is adjusted.

Its own loop, since scipy's ``least_squares`` knows neither states that move along a manifold
(rotations) nor a sparse Cholesky factor, which serves several steps and the covariance at the end.
An iteration costs one evaluation and one back substitution, and a factorisation where none is kept.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from uavgram.estimation.solver.normal_equations import Block, Factor, NormalEquations, cost_of
from uavgram.estimation.solver.sparse.structure import Structure
from uavgram.model.arrays import Floats

State = TypeVar("State")

CONVERGED = 1e-10
"""Predicted fall of the weighted sum of squares below which the rest is no longer worth a step:
its square root is the length of that step in units of the unknowns' own sigmas."""

CONVERGED_EACH = 1e-13
"""The same by unknown, in large systems."""

ROUNDING = 1e-14
"""Share of the sum of squares below which its fall drowns in rounding: the rest is no step."""

AT_REST = 1e-4
"""Undamped predicted fall (a hundredth of a sigma, squared) up to which a result counts as
converged; kinks of the interpolated flight keep it from being exactly zero."""

MANY = 10_000
"""Unknowns of a large system: from so many on, that is by unknown."""

CLOSE = 0.1
"""Predicted fall by unknown (a third of a sigma, squared) after which the normal matrix hardly
changes: its factor serves the steps that follow too, as long as they keep their promise."""

KEPT = 0.5
"""Share of the predicted fall that must come true for a factor to serve once more."""

SHRINKS = 0.7
"""Predicted fall of a step with a kept factor, in that of the step before, from which on the next
step needs a factor of its own: along weakly determined directions a kept one crawls."""

UNDAMPED = 1e-8
"""Damping up to which a factor serves more than one step: they are as good as Newton's."""

REFUSED_EACH = 5e-9
"""Predicted fall by unknown up to which a step that hardly comes true is the last: kinks of the
interpolated flight refuse it, and in large systems each try costs a factorisation. Less where a
sharper minimum is asked for than `CONVERGED`."""

MAX_ITERATIONS = 80
MAX_DAMPING = 1e12


@dataclass(frozen=True, eq=False)
class Minimum(Generic[State]):
    """Where the iterations ended.

    Attributes
    ----------
    state, blocks
        The state, and its whitened residuals and Jacobians.
    factor
        Of the undamped normal matrix there.
    cost
        Weighted sum of squared residuals.
    iterations, converged
        Accepted and refused steps together; whether they came to rest.
    """

    state: State
    blocks: dict[str, Block]
    factor: Factor
    cost: float
    iterations: int
    converged: bool


def minimise(
    state: State,
    evaluate: Callable[[State], dict[str, Block] | None],
    update: Callable[[State, Floats], State],
    size: int,
    structure: Structure | None = None,
    most: int = MAX_ITERATIONS,
    at_rest: float = CONVERGED,
    slack: float = 0.0,
    first: dict[str, Block] | None = None,
) -> Minimum[State]:
    """Minimise a sum of squared whitened residuals.

    Parameters
    ----------
    state
        First values.
    evaluate
        Residuals and Jacobians by group; None where the state is impossible (ground behind the
        camera): such a step is refused.
    update
        State and increment (size,) to new state.
    size
        Number of unknowns.
    structure
        What they are, for a good elimination order of large systems.
    most
        Iterations after which it ends wherever it is.
    at_rest
        Predicted fall below which the rest is not worth a step.
    slack
        Damping where the normal matrix is singular, and damping of the last factor: what
        nothing determines is then an end like any other, with sigmas that are large, but mean
        nothing.
    first
        What `evaluate` says of the first values, where that is known already.

    Returns
    -------
    Minimum
        Also where it did not converge: `converged` says so.

    Raises
    ------
    SingularError
        An unknown is not determined, and there is no slack.
    ValueError
        The first values are impossible.

    References
    ----------
    Marquardt 1963 (scaling of the damping by the diagonal); Nielsen 1999, "Damping parameter in
    Marquardt's method", IMM-REP-1999-05, eq. 2.5 (the damping's own update). Ortega and Rheinboldt
    1970, "Iterative solution of nonlinear equations in several variables", ch. 7 (one factor for
    several steps).
    """
    blocks = first or evaluate(state)
    if blocks is None:
        raise ValueError("the first values are impossible")
    normal, cost = NormalEquations(list(blocks.values()), size, structure), cost_of(blocks.values())
    refused = REFUSED_EACH * size * min(1.0, at_rest / CONVERGED)
    at_rest = max(at_rest, CONVERGED_EACH * size)
    damping, growth = 1e-9, 2.0
    iteration = 0
    factor: Factor | None = None
    before = np.inf
    while iteration < most:
        iteration += 1
        fresh = factor is None
        factor = factor or normal.factor(damping, slack)
        step = -factor.solve(normal.gradient)
        predicted = factor.predicted_fall(step, normal.gradient)
        if predicted < max(at_rest, ROUNDING * cost) or damping > MAX_DAMPING:
            break
        trial = update(state, step)
        trial_blocks = evaluate(trial)
        trial_cost = np.inf if trial_blocks is None else cost_of(trial_blocks.values())
        gain = (cost - trial_cost) / predicted
        if trial_blocks is not None and gain > 0:
            state, blocks, cost = trial, trial_blocks, trial_cost
            normal = NormalEquations(list(blocks.values()), size, structure, normal.plan)
            damping *= max(1.0 / 3.0, 1.0 - (2.0 * gain - 1.0) ** 3)
            growth = 2.0
        elif fresh:
            damping, growth = damping * growth, 2.0 * growth
            # The step that was refused would come again, and cost a large system a factorisation.
            while size > MANY and damping < UNDAMPED:
                damping, growth = damping * growth, 2.0 * growth
        if fresh and gain < KEPT and predicted < refused:
            break
        crawls = not fresh and predicted > SHRINKS * before
        if predicted > CLOSE * size or gain < KEPT or damping > UNDAMPED or crawls:
            factor = None
        before = predicted
    factor = normal.factor(slack)
    # Newton's decrement without damping: how far below the minimum of the model still lies.
    decrement = float(normal.gradient @ factor.solve(normal.gradient))
    is_at_rest = decrement < AT_REST * max(1.0, size / MANY)
    return Minimum(state, blocks, factor, cost, iteration, is_at_rest)
