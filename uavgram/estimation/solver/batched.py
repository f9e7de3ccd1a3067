"""Minimisation of many small least-squares problems at once, each with its own damping.

Thousands of systems are solved together, with the number of the system as the last axis: an
operation on one row of all systems is one array operation. LAPACK, which solves them one after the
other, takes ten times as long.

`levenberg_marquardt` minimises one large sparse problem. The problems here have a few unknowns each
(a plane, a pose), and there are up to thousands: candidates of a search, photos of a board, draws
of a simulation. Unknowns that belong to one problem alone (points) are eliminated by the problem
itself.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from uavgram.model.arrays import Bools, Floats, Ints

MIN_BATCH = 40
"""Number of systems from which they are solved together rather than one after the other by
LAPACK."""


def cholesky(matrix: Floats) -> Floats:
    """Factor positive definite matrices (n, n, B) into L L^T; NaN if one is not.

    Above the diagonal the result holds zeros.
    """
    size = len(matrix)
    lower = np.zeros_like(matrix)
    with np.errstate(invalid="ignore", divide="ignore"):
        for j in range(size):
            # Column j: the diagonal first, then the rest by the rows that are known.
            known = lower[j, :j]
            lower[j, j] = np.sqrt(matrix[j, j] - np.einsum("kb,kb->b", known, known))
            if j + 1 < size:
                rest = matrix[j + 1 :, j] - np.einsum("ikb,kb->ib", lower[j + 1 :, :j], known)
                lower[j + 1 :, j] = rest / lower[j, j]
    return lower


def solve_lower(lower: Floats, right: Floats) -> Floats:
    """Solve ``L x = right`` for (n, n, B) lower factors and (n, ..., B) right-hand sides."""
    out = np.empty_like(right)
    for i in range(len(lower)):
        rest = right[i].copy()
        for k in range(i):
            rest -= lower[i, k] * out[k]
        out[i] = rest / lower[i, i]
    return out


def solve_lower_transposed(lower: Floats, right: Floats) -> Floats:
    """Solve ``L^T x = right`` for (n, n, B) lower factors and (n, ..., B) right-hand sides."""
    out = np.empty_like(right)
    for i in range(len(lower) - 1, -1, -1):
        rest = right[i].copy()
        for k in range(i + 1, len(lower)):
            rest -= lower[k, i] * out[k]
        out[i] = rest / lower[i, i]
    return out


def solve_each(matrix: Floats, right: Floats) -> Floats:
    """Solve B systems of n unknowns, with one or several right-hand sides; NaN if it is singular.

    Parameters
    ----------
    matrix
        (B, n, n) positive definite.
    right
        (B, n) or (B, n, m).
    """
    if len(matrix) < MIN_BATCH:
        columns = right if right.ndim == matrix.ndim else right[..., None]
        with suppress(np.linalg.LinAlgError):  # a singular system must not stop the others
            return np.asarray(np.linalg.solve(matrix, columns)).reshape(right.shape)
    lower = cholesky(np.ascontiguousarray(np.moveaxis(matrix, 0, -1)))
    with np.errstate(invalid="ignore", divide="ignore"):
        solved = solve_lower(lower, np.ascontiguousarray(np.moveaxis(right, 0, -1)))
        return np.moveaxis(solve_lower_transposed(lower, solved), -1, 0)


def invert_each(matrix: Floats) -> Floats:
    """Invert B positive definite matrices (B, n, n); NaN where one is singular."""
    return solve_each(matrix, np.broadcast_to(np.eye(matrix.shape[1]), matrix.shape))


MAX_ITERATIONS = 60
DAMPING, MIN_DAMPING, MAX_DAMPING = 1e-3, 1e-15, 1e10

MIN_REDUCTION = 1e-10
"""Expected reduction of the sum of squares by the last step: 1e-5 sigma of any unknown."""

ROUNDING_SHARE = 1e-14
"""Share of the sum of squares below which its reduction disappears in rounding."""

MIN_VISIBLE_REDUCTION = 1e-10
"""Expected reduction below which rounding decides whether the sum of squares falls: such a step is
always taken, for it is as good as Newton's."""

MAX_GRADIENT = 1e-4
"""Squared gradient, in sigmas, up to which a problem that no step improves counts as solved."""

MIN_DIAGONAL_SHARE = 1e-12
"""Share of the normal matrix's trace that keeps a system solvable in spite of an undetermined
unknown."""

TRIMMINGS, TRIMMED_STEPS, STILL_FALLS = 8, 2, 0.995
"""Largest number of selections of observations; steps after each; ratio of medians above which a
selection is no progress."""

State = tuple[Floats, ...]
"""Unknowns of b problems, one array for each kind."""


class Linearisation(NamedTuple):
    """Linearisation of b problems at a state.

    Attributes
    ----------
    cost
        (b,) sums of squares; NaN or infinite if the state is impossible.
    normal, gradient
        (b, u, u), (b, u) J^T J and J^T r of the u unknowns that remain after elimination.
    rest
        Arrays over the b problems from which the problem computes the steps of the eliminated
        unknowns.
    compared
        (b,) the sum of squares with the weights of the previous state, if weights depend on the
        state; None: the cost itself.
    """

    cost: Floats
    normal: Floats
    gradient: Floats
    rest: tuple[Floats, ...] = ()
    compared: Floats | None = None


class BatchedProblem(Protocol):
    """Interface of B problems with u unknowns each."""

    @property
    def axis(self) -> int:
        """Axis of states and of `Linear.rest` that counts the problems: 0 or -1."""
        ...

    def linearise(self, which: Ints, state: State) -> Linearisation:
        """Linearise problems `which` (b,) at a state of these b."""
        ...

    def move(self, state: State, linear: Linearisation, step: Floats) -> State:
        """Apply steps, also to the eliminated unknowns.

        Parameters
        ----------
        state
            State of b problems.
        linear
            Linearisation at this state.
        step
            (b, u) steps.
        """
        ...


@dataclass(frozen=True, eq=False)
class ExplicitProblem:
    """Problems given by their residuals and Jacobians, without elimination.

    Attributes
    ----------
    rows
        Function from problems (b,) and their state to residuals (b, r) and Jacobians (b, r, u).
    update
        Function from a state and steps (b, u) to the state after them.
    """

    rows: Callable[[Ints, State], tuple[Floats, Floats]]
    update: Callable[[State, Floats], State]
    axis: int = 0

    def linearise(self, which: Ints, state: State) -> Linearisation:
        """Multiply the Jacobians of problems `which` (b,) at a state."""
        return compute_normal_equations(*self.rows(which, state))

    def move(self, state: State, linear: Linearisation, step: Floats) -> State:  # noqa: ARG002
        """Apply steps.

        Parameters
        ----------
        state
            State of b problems.
        linear
            Linearisation at this state.
        step
            (b, u) steps.
        """
        return self.update(state, step)


def compute_normal_equations(residual: Floats, jacobian: Floats) -> Linearisation:
    """Compute the normal equations of residuals (b, r) and Jacobians (b, r, u)."""
    transposed = jacobian.swapaxes(1, 2)
    return Linearisation(
        np.einsum("br,br->b", residual, residual),
        transposed @ jacobian,
        (transposed @ residual[..., None])[..., 0],
    )


class Minima(NamedTuple):
    """Results of B minimisations.

    Attributes
    ----------
    state
        Unknowns.
    cost
        (B,) sum of squares; infinite if the start was impossible.
    normal
        (B, u, u) inverse of the covariance of the unknowns.
    converged
        (B,) whether no further reduction was possible.
    steps
        (B,) number of steps tried.
    """

    state: State
    cost: Floats
    normal: Floats
    converged: Bools
    steps: Ints

    def put(self, rows: Ints, other: Minima, axis: int) -> None:
        """Replace the results of some problems; the steps add up.

        Parameters
        ----------
        rows
            (b,) indices of these problems.
        other
            Their new results.
        axis
            Axis of the state: `Problem.axis`.
        """
        for whole, part in zip(self.state, other.state, strict=True):
            _put_problems_first(whole, axis)[rows] = _put_problems_first(part, axis)
        self.cost[rows], self.normal[rows] = other.cost, other.normal
        self.converged[rows] = other.converged
        self.steps[rows] += other.steps

    def lowest_first(self, starts: int) -> Minima:
        """Sort each group of `starts` neighbouring minima by cost: (B / starts, starts, ...)."""
        groups = len(self.cost) // starts
        order = np.argsort(self.cost.reshape(groups, starts), axis=1, kind="stable")
        at = np.arange(groups)[:, None] * starts + order
        return Minima(
            tuple(part[at] for part in self.state),
            self.cost[at],
            self.normal[at],
            self.converged[at],
            self.steps[at],
        )


def minimise_each(
    problem: BatchedProblem,
    start: State,
    iterations: int = MAX_ITERATIONS,
    *,
    settled: float = MIN_REDUCTION,
    damping: float = DAMPING,
    descending: bool = True,
) -> Minima:
    """Minimise the sum of squares of each problem from its start.

    Parameters
    ----------
    problem
        B problems.
    start
        State of all B.
    iterations
        Largest number of steps of each problem, tried or taken; a problem that needs more is not
        converged.
    settled
        Expected reduction of the sum of squares below which a step is the last.
    damping
        Initial damping: small if the starts are so good that Newton's steps lead to the minimum.
    descending
        Whether every step has to reduce the sum of squares. If much is eliminated, Newton's steps
        are faster without that.

    Notes
    -----
    Marquardt 1963: the damping is in each unknown's own scale. A step that should reduce the sum of
    squares by less than `settled` is taken without evaluation.
    """
    axis = problem.axis
    end = tuple(part.copy() for part in start)
    count = start[0].shape[axis]
    active = np.arange(count)
    here = tuple(part.copy() for part in start)
    linear = problem.linearise(active, here)
    size = linear.gradient.shape[1]
    cost, normal = np.full(count, np.inf), np.full((count, size, size), np.nan)
    converged, steps = np.zeros(count, dtype=np.bool_), np.zeros(count, dtype=np.int64)
    scale = np.full(count, damping)

    def put(done: Bools, state: State) -> None:
        rows = active[done]
        for whole, part in zip(end, state, strict=True):
            _put_problems_first(whole, axis)[rows] = _put_problems_first(part, axis)[done]
        cost[rows], normal[rows] = linear.cost[done], linear.normal[done]

    kept = np.isfinite(linear.cost)
    normal[~kept] = linear.normal[~kept]
    for iteration in range(iterations + 1):
        if not kept.all():
            rows = np.flatnonzero(kept)
            active, scale, here = active[rows], scale[rows], _select(here, rows, axis)
            linear = _select_linear(linear, rows, axis)
        if not len(active):
            break
        if iteration == iterations:
            put(np.ones(len(active), dtype=np.bool_), here)
            break
        step, fall = _damped_steps(linear, scale)
        # Squared gradient in sigmas, estimated from the damped reduction.
        gain = fall * (1.0 + scale)
        rests = _mark_last(linear, scale, step, fall, settled)
        steps[active] += 1
        there = problem.move(here, linear, step)
        stuck = ~rests & (scale > MAX_DAMPING)
        if rests.any() or stuck.any():
            put(rests, there)
            put(stuck, here)
            converged[active] = rests | (stuck & (gain < MAX_GRADIENT))
            rows = np.flatnonzero(~(rests | stuck))
            active, scale, gain = active[rows], scale[rows], gain[rows]
            here, there = _select(here, rows, axis), _select(there, rows, axis)
            linear = _select_linear(linear, rows, axis)
            if not len(active):
                break
        found = problem.linearise(active, there)
        compared = found.cost if found.compared is None else found.compared
        better = compared <= linear.cost
        better |= np.isfinite(found.cost) & ((gain < MIN_VISIBLE_REDUCTION) | (not descending))
        # Less damping after a success, more after a failure.
        scale = np.where(better, np.maximum(scale / 8.0, MIN_DAMPING), 5.0 * scale)
        here = _choose(better, there, here, axis)
        linear = _linearise(
            _choose(better, found[:3], linear[:3], 0),
            _choose(better, found.rest, linear.rest, axis),
        )
        kept = np.isfinite(linear.cost)
    return Minima(end, cost, normal, converged, steps)


def minimise_trimmed(
    misses: Callable[[State], Floats],
    weighted: Callable[[Floats], BatchedProblem],
    start: State,
    limit: float,
) -> tuple[State, Floats]:
    """Fit B problems to the observations that nearly agree (least trimmed squares).

    Rousseeuw and Van Driessen 2006, "Computing LTS regression for large data sets": fit the
    observations with small residuals, and select again, as long as the median of the residuals
    falls.

    Parameters
    ----------
    misses
        Function from a state to the sizes (B, n) of all residuals.
    weighted
        Function from weights (B, n) of the observations to the problem.
    start
        State of all B.
    limit
        Residual in units of the median up to which an observation takes part.

    Returns
    -------
    state, median
        State with the smallest median (B,) of the residuals, and that median.
    """
    best = tuple(part.copy() for part in start)
    here, least = start, np.full(len(start[0]), np.inf)
    for _ in range(TRIMMINGS):
        miss = misses(here)
        median = np.median(miss, axis=1)
        better = median <= STILL_FALLS * least
        if not better.any():
            break
        least[better] = median[better]
        for whole, part in zip(best, here, strict=True):
            whole[better] = part[better]
        middle = median[:, None] + 1e-12
        weight = np.where(miss <= limit * middle, 1.0 / middle, 0.0)
        here = minimise_each(weighted(weight), here, TRIMMED_STEPS).state
    return best, least


def _damped_steps(linear: Linearisation, damping: Floats) -> tuple[Floats, Floats]:
    """Compute steps (b, u), and their expected reductions (b,) of the sums of squares."""
    # Scale to a unit diagonal, so that the damping is in each unknown's own scale.
    own = np.einsum("bii->bi", linear.normal)
    scale = 1.0 / np.sqrt(
        np.maximum(own, MIN_DIAGONAL_SHARE * own.sum(axis=1, keepdims=True) + 1e-300)
    )
    whitened = linear.normal * (scale[:, :, None] * scale[:, None, :])
    size = whitened.shape[1]
    whitened.reshape(len(whitened), -1)[:, :: size + 1] += (damping + MIN_DIAGONAL_SHARE)[:, None]
    step = -scale * solve_each(whitened, linear.gradient * scale)
    return step, -np.einsum("bi,bi->b", step, linear.gradient)


def _mark_last(
    linear: Linearisation, damping: Floats, step: Floats, fall: Floats, settled: float
) -> Bools:
    """Mark the steps (b, u) that are the last; these are replaced by undamped ones.

    A damped step along a hardly determined direction is short everywhere.
    """
    limit = np.maximum(settled, ROUNDING_SHARE * linear.cost)
    rests = fall < limit
    rows = np.flatnonzero(rests & (damping > MIN_DAMPING))
    if len(rows):
        few = _linearise(_select(linear[:3], rows, 0), ())
        newton, fall = _damped_steps(few, np.full(len(rows), MIN_DAMPING))
        rests[rows] = fall < limit[rows]
        last = rests[rows]
        step[rows[last]] = newton[last]
    return rests


def _put_problems_first(array: Floats, axis: int) -> Floats:
    """Return a view of an array with its problems along the first axis."""
    return array if axis == 0 else np.moveaxis(array, axis, 0)


def _select(arrays: State, rows: Ints, axis: int) -> State:
    return tuple(array.take(rows, axis=axis) for array in arrays)


def _select_linear(linear: Linearisation, rows: Ints, axis: int) -> Linearisation:
    """Return the normal equations of some problems."""
    return _linearise(_select(linear[:3], rows, 0), _select(linear.rest, rows, axis))


def _linearise(equations: State, rest: State) -> Linearisation:
    cost, normal, gradient = equations
    return Linearisation(cost, normal, gradient, rest)


def _choose(better: Bools, new: State, old: State, axis: int) -> State:
    """Return the new arrays of problems that became better (b,), the old ones of all others."""
    if better.all():
        return new
    rows = np.flatnonzero(better)
    for whole, part in zip(old, new, strict=True):
        _put_problems_first(whole, axis)[rows] = _put_problems_first(part, axis)[rows]
    return old
