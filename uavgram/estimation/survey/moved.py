"""Readjust observations that moved a little, by kept factors or in full.

Gauss-Newton steps with the normal matrix of the first adjustment ("simplified Newton") cost an
evaluation and a back substitution each. Where they do not come to rest fast, because the normal
matrix has turned too far, the full iteration goes on from there.

Gauss-Newton steps with the factor of the first adjustment ("simplified Newton"), of many such
movements at once. Near by the likelihood is evaluated at every step; of what lies farther away the
linear model is kept. With x = x0 + s + d, where s is what first order makes of the movement,

    d = - N^-1 sum over rows near by of  J(x)^T (r(x) - e) - J0^T (r0 + J0 d).

What is asked sees the next step without a solution of the normal equations: S g, the columns of
the covariance behind its gradient g, are known.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array, vstack

from uavgram.estimation.solver.levenberg_marquardt import AT_REST, CONVERGED, minimise
from uavgram.estimation.solver.normal_equations import (
    Block,
    Factor,
    SingularError,
    gathered,
    gradient_of,
)
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.neighbours import Neighbourhood
from uavgram.estimation.survey.unknowns import State, advance, some
from uavgram.model.arrays import Bools, Floats, Ints

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


STRAIGHT = 0.005
"""Squared length, in sigmas, of what observations depart from the linear model, up to which the
first step is the last: further ones would change what is asked by about as many of its sigmas."""

UNFELT = 0.005
"""By how many of its sigmas a step that is the last may still move what is asked."""

NEAR = 0.01
"""Squared length, in sigmas, of a step that may be the last."""

MOVED_AT_REST = 1e-3
"""Squared length, in sigmas, of the last step of the whole survey's adjustment anew."""

CROOKED = 2.0
"""The same, from which on such steps lead nowhere: what is so far from linear is adjusted whole."""

LOST = 100.0
"""The same on the way: steps may lead astray once, and mixed with others back."""

MOST = 20
"""Steps that are taken at most."""

HISTORY = 6
"""Steps that are mixed."""

REPEATED = 1e-10
"""Share of their lengths by which steps that are mixed count as different."""

TINY = 1e-300
"""Squared length of a step that is none."""

ENTRIES = 250_000
"""Numbers in the derivatives of all states that are evaluated together: 2 MB, which caches hold."""


@dataclass(frozen=True, eq=False)
class Moved:
    """Where m adjustments of moved observations end.

    Attributes
    ----------
    states
        Unknowns near by; None where no end was found.
    rest
        (m, r) by how much the last step moves what is asked, which is not taken in `states`.
    """

    states: list[State | None]
    rest: Floats


@dataclass(frozen=True, eq=False)
class Asked:
    """What is asked of the unknowns near by.

    Attributes
    ----------
    gradient
        (r, n) in sigmas of each.
    solved
        (r, n) the covariance of the unknowns times it.
    of
        (m, r) which of it is asked of each movement.
    """

    gradient: Floats
    solved: Floats
    of: Bools


def moved(near: Neighbourhood, factor: Factor, steps: Floats, asked: Asked) -> Moved:
    """Adjust observations that moved as `steps` would move them.

    Parameters
    ----------
    near
        The unknowns near by.
    factor
        Of the whole survey.
    steps
        (m, n) of the unknowns near by.
    asked
        What has to come to rest.
    """
    count, base = len(steps), near.problem.evaluate(near.state)
    assert base is not None  # noqa: S101  (the adjustment stands there)
    plane = _Plane.of(base, steps.shape[1])
    found: list[State | None] = [None] * count
    rest = np.full((count, len(asked.gradient)), np.nan)
    left, way = np.arange(count), _Way.from_here(steps.shape)
    for taken in range(MOST):
        states = advance(near.problem.layout, near.state, steps[left] + way.beyond)
        gradient, bent = _unexplained(near, plane, states, steps[left], way.beyond)
        ahead = -gradient @ asked.solved.T - way.beyond @ asked.gradient.T
        # What is nearly straight ends at once; what is far from it, or impossible, leads nowhere.
        is_last = (bent < STRAIGHT) & (taken == 0)
        further = np.flatnonzero(~is_last & (bent < (LOST if taken else CROOKED)))
        drive = gradient[further] + way.force[further]
        right = np.zeros((factor.size, len(further)))
        right[near.columns] = -drive.T
        step = factor.solve(right)[near.columns].T
        felt = np.abs(np.where(asked.of[left[further]], ahead[further], 0.0)).max(axis=1)
        rests = (felt < UNFELT) & (-(drive * step).sum(axis=1) < NEAR) & (taken > 0)
        is_last[further[rests]] = True
        for row in np.flatnonzero(is_last).tolist():
            found[left[row]] = some(states, row)
        rest[left[is_last]] = ahead[is_last]
        if rests.all():
            break
        way = way.further(further[~rests], drive[~rests], step[~rests])
        left = left[further[~rests]]
    return Moved(found, rest)


class _Way(NamedTuple):
    """Where m iterations stand, and how they came there.

    Attributes
    ----------
    beyond
        (m, n) by how much each has gone beyond its first step.
    force
        (m, n) the normal matrix times that; zero but near by, as the whole step comes from there.
    past
        Of the last iterations, oldest first: `beyond`, `force`, what drove the step (the gradient),
        and the step.
    """

    beyond: Floats
    force: Floats
    past: tuple[tuple[Floats, ...], ...]

    @classmethod
    def from_here(cls, shape: tuple[int, ...]) -> _Way:
        """The first step alone."""
        return cls(np.zeros(shape), np.zeros(shape), ())

    def further(self, rows: Ints, drive: Floats, step: Floats) -> _Way:
        """Where some of them go next, by their steps (r, n) and what drives these (r, n).

        To that mixture of the last steps' ends whose remaining step would be shortest, in sigmas,
        were all linear (Anderson 1965, Iterative procedures for nonlinear integral equations;
        Walker & Ni 2011). Plain steps diverge where the normal matrix has turned.
        """
        before = (tuple(one[rows] for one in each) for each in self.past)
        past = (*before, (self.beyond[rows], self.force[rows], drive, step))[-HISTORY:]
        beyond, force = self.beyond[rows] + step, self.force[rows] - drive
        if len(past) > 1:
            by = [np.diff(np.stack(each, axis=1), axis=1) for each in zip(*past, strict=True)]
            by_beyond, by_force, by_drive, by_step = by
            # s^T N s' of steps s = -N^-1 g: -g^T s'
            joint = -by_step @ np.swapaxes(by_drive, 1, 2)
            part = _solved(0.5 * (joint + np.swapaxes(joint, 1, 2)), -by_drive @ step[..., None])
            beyond = beyond - (part * (by_beyond + by_step)).sum(axis=1)
            force = force - (part * (by_force - by_drive)).sum(axis=1)
        return _Way(beyond, force, past)


def _solved(joint: Floats, right: Floats) -> Floats:
    """Solutions (m, h, 1) of small systems (m, h, h), also where steps repeat each other."""
    scale = 1.0 / np.sqrt(np.maximum(np.einsum("mii->mi", joint), TINY))[..., None]
    scaled = joint * scale * np.swapaxes(scale, 1, 2) + REPEATED * np.eye(joint.shape[1])
    return np.asarray(np.linalg.solve(scaled, right * scale) * scale)


class _Plane(NamedTuple):
    """The linear model of all rows near by, group by group.

    Attributes
    ----------
    residual
        (R,) at its middle.
    jacobian
        (R, n) by the unknowns near by.
    observed
        (R,) 1, but 0 of the gauge, which is no observation, and stays.
    """

    residual: Floats
    jacobian: csr_array
    observed: Floats

    @classmethod
    def of(cls, blocks: Mapping[str, Block], size: int) -> _Plane:
        """That of an adjustment's blocks."""
        observed = [np.full(b.residual.size, float(name != "gauge")) for name, b in blocks.items()]
        return cls(
            np.concatenate([block.residual.ravel() for block in blocks.values()]),
            csr_array(vstack([block.sparse(size) for block in blocks.values()])),
            np.concatenate(observed),
        )

    def times(self, steps: Floats) -> Floats:
        """(m, R) by which steps (m, n) move the rows."""
        return np.asarray((self.jacobian @ steps.T).T)


def _unexplained(
    near: Neighbourhood, plane: _Plane, states: State, steps: Floats, beyond: Floats
) -> tuple[Floats, Floats]:
    """What the linear model does not say of m states: gradients (m, n), and how much it is (m,).

    That is the squared length of what the residuals depart from it; NaN where a state is
    impossible.
    """
    count = len(steps)
    gradient, bent = np.full(steps.shape, np.nan), np.full(count, np.nan)
    at_once = max(1, ENTRIES // plane.jacobian.nnz)
    waiting = [np.arange(first, min(first + at_once, count)) for first in range(0, count, at_once)]
    while waiting:
        rows = waiting.pop()
        there = near.problem.evaluate(some(states, rows))
        if there is not None:
            gradient[rows], bent[rows] = _off_linear(plane, there, steps[rows], beyond[rows])
        elif len(rows) > 1:  # one of them is impossible
            waiting += [rows[: len(rows) // 2], rows[len(rows) // 2 :]]
    return gradient, bent


def _off_linear(
    plane: _Plane, there: Mapping[str, Block], steps: Floats, beyond: Floats
) -> tuple[Floats, Floats]:
    """Gradients (m, n) of what the linear model does not say, and its squared length (m,)."""
    count, size = steps.shape
    moved_by = plane.observed * plane.times(steps)
    expected = plane.residual + plane.times(beyond)
    found = np.concatenate([b.residual.reshape(count, -1) for b in there.values()], axis=1)
    found -= moved_by
    gradient, first = -(plane.jacobian.T @ expected.T).T, 0
    for block in there.values():
        n, r = block.residual.shape[1:]
        own = found[:, first : first + n * r].reshape(count, n, r)
        gradient += gathered(block.columns, block.pulled(own), size)
        first += n * r
    off = found - expected
    return gradient, np.einsum("mr,mr->m", off, off)


def moved_alone(adjustment: Adjustment, step: Floats) -> State | None:
    """The whole survey adjusted to observations that moved as a step (size,) would move them."""
    errors = {
        name: np.einsum("nrk,nk->nr", block.jacobian, step[block.columns])
        for name, block in adjustment.minimum.blocks.items()
        if name != "gauge"
    }
    return refit(adjustment, errors, MOVED_AT_REST)
