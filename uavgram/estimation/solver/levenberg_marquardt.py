"""Levenberg-Marquardt iteration over a state of any type.

Own implementation, since scipy's ``least_squares`` supports neither states that move along a
manifold (rotations) nor a sparse Cholesky factor, which serves several steps and the covariance at
the end. An iteration costs one evaluation and one back substitution, and a factorisation if none is
kept.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np

from uavgram.estimation.solver.normal_equations import (
    Block,
    Factor,
    NormalEquations,
    compute_cost,
    compute_gradient,
)
from uavgram.estimation.solver.sparse.block_matrix import Structure
from uavgram.model.arrays import Floats
from uavgram.model.work import report_work

State = TypeVar("State")

MIN_REDUCTION = 1e-10
"""Predicted reduction of the weighted sum of squares below which the iteration ends: its square
root is the length of the step in units of the unknowns' own sigmas."""

MIN_REDUCTION_EACH = 1e-13
"""The same per unknown, in large systems."""

ROUNDING_SHARE = 1e-14
"""Share of the sum of squares below which its reduction is lost in rounding and the iteration
ends."""

MAX_UNDAMPED_REDUCTION = 1e-4
"""Undamped predicted reduction (a hundredth of a sigma, squared) up to which a result counts as
converged; kinks of the interpolated flight keep it from being exactly zero. In gusts the linear
model predicts more: then the reduction that is found along the step counts."""

LARGE_SYSTEM = 10_000
"""Number of unknowns of a large system, from which that limit grows with their number."""

MAX_CREEP, MAX_LAST_STEP = 1e-2, 0.05
"""Reduction in the second half of the iterations (a tenth of a sigma, squared), and along one more
step, up to which a result counts as converged after the largest number of them: between noisy
positions of a log, the sum of squares falls ever more slowly along a winding valley."""

MAX_REUSE_REDUCTION = 0.1
"""Predicted reduction per unknown (a third of a sigma, squared) below which the normal matrix
hardly changes: its factor is kept for the next steps, as long as they achieve the predicted
reduction."""

MIN_ACHIEVED_SHARE = 0.5
"""Share of the predicted reduction that must be achieved for a factor to be kept."""

MAX_REDUCTION_RATIO = 0.7
"""Ratio of the predicted reductions of two successive steps, the later one with a kept factor,
above which the next step needs a new factor: along weakly determined directions a kept one
converges slowly."""

MAX_REUSE_DAMPING = 1e-8
"""Damping up to which a factor is kept for more than one step: the steps are as good as
Newton's."""

MAX_REFUSED_REDUCTION_EACH = 5e-9
"""Predicted reduction per unknown up to which a step that hardly reduces the sum of squares is the
last: it fails at kinks of the interpolated flight, and in large systems each try costs a
factorisation. Smaller if a sharper minimum than `MIN_REDUCTION` is requested."""

PACE_STEPS = 20
"""Number of steps like the present one, or of all that are left, in which a required sum of squares
has to be in reach: iterations take larger steps first, and converge quadratically at the end."""

STEP_FRACTIONS = tuple(0.5**k for k in range(8))
"""Fractions of a step along which the minimum is searched where the linear model does not hold."""

BEND_SHARE, MAX_BEND = 0.1, 0.75
"""Share of a step from which its acceleration is computed, and the largest ratio of twice the bend
to the step that is tried (Transtrum and Sethna 2012)."""

MAX_ITERATIONS = 80
MAX_DAMPING = 1e12


@dataclass(frozen=True, eq=False)
class Minimum(Generic[State]):
    """Result of the iteration.

    Attributes
    ----------
    state, blocks
        Final state, and its whitened residuals and Jacobians.
    factor
        Factor of the undamped normal matrix there.
    cost
        Weighted sum of squared residuals.
    iterations, converged
        Number of accepted and refused steps together; whether they converged.
    """

    state: State
    blocks: dict[str, Block]
    factor: Factor
    cost: float
    iterations: int
    converged: bool


def minimise(  # noqa: PLR0913  (settings of one algorithm)
    state: State,
    evaluate: Callable[[State], dict[str, Block] | None],
    update: Callable[[State, Floats], State],
    size: int,
    structure: Structure | None = None,
    most: int = MAX_ITERATIONS,
    at_rest: float = MIN_REDUCTION,
    slack: float = 0.0,
    goal: float = np.inf,
    *,
    bends: bool = False,
) -> Minimum[State]:
    """Minimise a sum of squared whitened residuals.

    Parameters
    ----------
    state
        Initial values.
    evaluate
        Function that returns residuals and Jacobians by group; None if the state is impossible
        (ground behind the camera): such a step is refused.
    update
        Function from state and increment (size,) to the new state.
    size
        Number of unknowns.
    structure
        Structure of the unknowns, for a good elimination order of large systems.
    most
        Largest number of iterations.
    at_rest
        Predicted reduction below which the iteration ends.
    slack
        Damping if the normal matrix is singular, and damping of the last factor: undetermined
        unknowns are then accepted, with large sigmas that have no meaning.
    goal
        Sum of squares above which the result is of no use: the iteration ends where it is out of
        reach (`PACE_STEPS`).
    bends
        Whether steps follow a bent valley from the first refused one on. Straight steps stay
        nearer to first values, which is better where gross errors take part.

    Returns
    -------
    Minimum
        Also if it did not converge: see `converged`.

    Raises
    ------
    SingularError
        An unknown is not determined, and there is no slack.
    ValueError
        The initial values are impossible.

    References
    ----------
    Marquardt 1963 (scaling of the damping by the diagonal); Nielsen 1999, "Damping parameter in
    Marquardt's method", IMM-REP-1999-05, eq. 2.5 (the damping's own update). Ortega and Rheinboldt
    1970, "Iterative solution of nonlinear equations in several variables", ch. 7 (one factor for
    several steps). Transtrum and Sethna 2012, "Improvements to the Levenberg-Marquardt algorithm
    for nonlinear least-squares minimization", arXiv:1201.5885, sec. 3 (steps along a bent valley,
    from the first refused one on).
    """
    blocks = evaluate(state)
    if blocks is None:
        raise ValueError("the first values are impossible")
    normal = NormalEquations(list(blocks.values()), size, structure)
    cost = compute_cost(blocks.values())
    now = _Iteration(
        evaluate, update, size, structure, slack, goal, state, blocks, cost, normal, bends
    )
    refused = MAX_REFUSED_REDUCTION_EACH * size * min(1.0, at_rest / MIN_REDUCTION)
    limit = max(at_rest, MAX_UNDAMPED_REDUCTION * max(1.0, size / LARGE_SYSTEM))
    while True:
        now.descend(most, max(at_rest, MIN_REDUCTION_EACH * size), refused)
        factor = now.normal.factor(slack)
        # Newton's decrement without damping: reduction to the minimum of the linear model.
        step = -factor.solve(now.normal.gradient)
        is_at_rest = -float(now.normal.gradient @ step) < limit
        if is_at_rest or now.is_hopeless:
            break
        if now.count >= most:
            creeps = 0.0 < now.halfway - now.cost < MAX_CREEP
            is_at_rest = creeps and now.search_along(step, np.inf) < MAX_LAST_STEP
            break
        # Where the model does not hold, as on a flight in gusts, the function itself decides: it
        # is at its minimum if it hardly decreases along that step.
        fall = now.search_along(step, limit)
        is_at_rest = 0.0 < fall < limit
        if fall < limit:
            break
    return Minimum(now.state, now.blocks, factor, now.cost, now.count, is_at_rest)


@dataclass(eq=False)
class _Iteration(Generic[State]):
    """Present state of an iteration, and the functions that it calls; see `minimise`.

    `halfway` is the sum of squares after half of the largest number of steps, `is_hopeless` whether
    the goal is out of reach, and `is_bent` whether steps follow a bent valley.
    """

    evaluate: Callable[[State], dict[str, Block] | None]
    update: Callable[[State, Floats], State]
    size: int
    structure: Structure | None
    slack: float
    goal: float
    state: State
    blocks: dict[str, Block]
    cost: float
    normal: NormalEquations
    bends: bool
    count: int = 0
    halfway: float = np.inf
    is_hopeless: bool = False
    is_bent: bool = False

    def _try(self, step: Floats) -> tuple[State, dict[str, Block] | None, float]:
        """Evaluate a step: state, residuals, and the sum of squares (infinite if impossible)."""
        state = self.update(self.state, step)
        blocks = self.evaluate(state)
        cost = np.inf if blocks is None else compute_cost(blocks.values())
        return state, blocks, np.inf if np.isnan(cost) else cost

    def _bend(self, step: Floats, factor: Factor) -> Floats:
        """Bend a step along a bent valley; unchanged in another, or where the bend is too large.

        The bend is half the acceleration a, where N a = -J^T r''. A short part h of the step gives
        the second derivative of the residuals along it: r'' = 2 / h ((r(h) - r) / h - J step).
        """
        if not self.is_bent:
            return step
        short = self.evaluate(self.update(self.state, BEND_SHARE * step))
        if short is None:
            return step
        curved = [
            replace(
                block,
                residual=(short[name].residual - block.residual) / BEND_SHARE
                - block.times(slice(None), step[:, None])[..., 0],
            )
            for name, block in self.blocks.items()
        ]
        bend = -factor.solve(compute_gradient(curved, self.size)) / BEND_SHARE
        scale = self.normal.normal.diagonal()
        is_small = 4.0 * (bend**2 @ scale) <= MAX_BEND**2 * (step**2 @ scale)
        return step + bend if is_small else step

    def _move(self, state: State, blocks: dict[str, Block], cost: float) -> None:
        self.state, self.blocks, self.cost = state, blocks, cost
        plan = self.normal.plan
        self.normal = NormalEquations(list(blocks.values()), self.size, self.structure, plan)

    def descend(self, most: int, at_rest: float, refused: float) -> None:
        """Take damped steps until the predicted reduction is small.

        Parameters
        ----------
        most
            Largest number of all steps.
        at_rest
            Predicted reduction below which the iteration ends.
        refused
            Likewise, where a step hardly reduces the sum of squares.
        """
        damping, growth = 1e-9, 2.0
        factor: Factor | None = None
        before, self.is_bent = np.inf, False
        while self.count < most:
            report_work()
            if self.count == most // 2:
                self.halfway = self.cost
            self.count += 1
            fresh = factor is None
            factor = factor or self.normal.factor(damping, self.slack)
            step = -factor.solve(self.normal.gradient)
            predicted = factor.predict_reduction(step, self.normal.gradient)
            if predicted < max(at_rest, ROUNDING_SHARE * self.cost) or damping > MAX_DAMPING:
                break
            left = min(most - self.count + 1, PACE_STEPS)
            self.is_hopeless = self.cost - left * predicted > self.goal
            if self.is_hopeless:
                break
            state, blocks, cost = self._try(self._bend(step, factor))
            # Gain ratio: actual over predicted reduction.
            gain = (self.cost - cost) / predicted
            if blocks is not None and gain > 0:
                self._move(state, blocks, cost)
                # Nielsen's update of the damping after an accepted step.
                damping *= max(1.0 / 3.0, 1.0 - (2.0 * gain - 1.0) ** 3)
                growth = 2.0
            elif fresh:
                self.is_bent = self.bends
                damping, growth = damping * growth, 2.0 * growth
                # With less damping than that the same step would be refused again, each time at
                # the cost of a factorisation.
                while self.size > LARGE_SYSTEM and damping < MAX_REUSE_DAMPING:
                    damping, growth = damping * growth, 2.0 * growth
            if fresh and gain < MIN_ACHIEVED_SHARE and predicted < refused:
                break
            crawls = not fresh and predicted > MAX_REDUCTION_RATIO * before
            # Keep the factor only near the minimum, while its steps achieve the predicted
            # reduction; never along a bent valley.
            if (
                predicted > MAX_REUSE_REDUCTION * self.size
                or gain < MIN_ACHIEVED_SHARE
                or damping > MAX_REUSE_DAMPING
                or crawls
                or self.is_bent
            ):
                factor = None
            before = predicted

    def search_along(self, step: Floats, least: float) -> float:
        """Move to the smallest sum of squares along a step, if it falls by at least so much.

        Returns
        -------
        The reduction; 0 where there is none.
        """
        state, blocks, cost = min(
            (self._try(fraction * step) for fraction in STEP_FRACTIONS), key=lambda one: one[2]
        )
        fall = max(self.cost - cost, 0.0)
        if blocks is not None and fall >= least:
            self._move(state, blocks, cost)
        return fall
