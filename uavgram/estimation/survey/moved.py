"""The adjustment of observations that moved a little: where it ends near some points.

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

import numpy as np

from uavgram.estimation.solver.normal_equations import Block, Factor, gradient_of
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.neighbourhood import Neighbourhood
from uavgram.estimation.survey.refit import refit
from uavgram.estimation.survey.unknowns import State, advance, some
from uavgram.model.arrays import Bools, Floats, Ints

STRAIGHT = 0.01
"""Squared length, in sigmas, of what observations depart from the linear model, up to which the
first step is the last: what the next would change is of the order of a third of it."""

UNFELT = 0.005
"""By how many of its sigmas a step that is the last may still move what is asked."""

NEAR = 0.1
"""Squared length, in sigmas, of a step that may be the last."""

AT_REST = 1e-3
"""Squared length, in sigmas, of the last step of the whole survey's adjustment anew."""

CROOKED = 1.0
"""The same, from which on such steps lead nowhere: what is so far from linear is adjusted whole."""

MOST = 12
"""Steps that are taken at most."""

HISTORY = 6
"""Steps that are mixed."""

ENTRIES = 2_000_000
"""Numbers in the derivatives of all states that are evaluated together: 16 MB."""


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
    found: list[State | None] = [None] * count
    rest = np.full((count, len(asked.gradient)), np.nan)
    left = np.arange(count)
    way = _Way(steps.shape)
    for taken in range(MOST):
        states = advance(near.problem.layout, near.state, steps[left] + way.beyond)
        gradient, bent = _unexplained(near, base, states, steps[left], way.beyond)
        ahead = -gradient @ asked.solved.T - way.beyond @ asked.gradient.T
        # What is nearly straight ends here; what is far from it, or impossible, leads nowhere.
        is_last = np.full(len(left), False) if taken else bent < STRAIGHT
        further = np.flatnonzero(~is_last & (bent < CROOKED))
        drive = gradient[further] + way.force[further]
        right = np.zeros((factor.size, len(further)))
        right[near.columns] = -drive.T
        step = factor.solve(right)[near.columns].T
        if taken:
            felt = np.abs(np.where(asked.of[left[further]], ahead[further], 0.0)).max(axis=1)
            rests = (felt < UNFELT) & (-(drive * step).sum(axis=1) < NEAR)
            is_last[further[rests]] = True
            further, drive, step = further[~rests], drive[~rests], step[~rests]
        for row in np.flatnonzero(is_last).tolist():
            found[left[row]] = some(states, row)
        rest[left[is_last]] = ahead[is_last]
        if not len(further):
            break
        way, left = way.further(further, drive, step), left[further]
    return Moved(found, rest)


class _Way:
    """The way of m iterations so far, and where each goes next (Anderson 1965; Walker & Ni 2011).

    The next state is that mixture of the last steps' ends whose remaining step would be shortest,
    were all linear, in sigmas. All lengths are found near by: what drives steps is zero elsewhere.
    """

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.beyond, self.force = np.zeros(shape), np.zeros(shape)
        self._steps: list[Floats] = []
        self._drives: list[Floats] = []
        self._beyond: list[Floats] = []
        self._force: list[Floats] = []

    def further(self, rows: Ints, drive: Floats, step: Floats) -> _Way:
        new = _Way(step.shape)
        new._steps = [*(one[rows] for one in self._steps), step][-HISTORY:]
        new._drives = [*(one[rows] for one in self._drives), drive][-HISTORY:]
        new._beyond = [*(one[rows] for one in self._beyond), self.beyond[rows]][-HISTORY:]
        new._force = [*(one[rows] for one in self._force), self.force[rows]][-HISTORY:]
        end, force = self.beyond[rows] + step, self.force[rows] - drive
        if len(new._steps) > 1:
            by_step = np.diff(np.stack(new._steps, 1), axis=1)
            by_drive = np.diff(np.stack(new._drives, 1), axis=1)
            by_end = by_step + np.diff(np.stack(new._beyond, 1), axis=1)
            by_force = np.diff(np.stack(new._force, 1), axis=1) - by_drive
            joint = -by_step @ np.swapaxes(by_drive, 1, 2)
            joint = 0.5 * (joint + np.swapaxes(joint, 1, 2))
            right = -(by_drive @ step[:, :, None])
            scale = 1 / np.sqrt(np.maximum(np.einsum("mii->mi", joint), 1e-300))
            joint = joint * scale[:, :, None] * scale[:, None, :] + 1e-10 * np.eye(joint.shape[1])
            part = np.linalg.solve(joint, right * scale[:, :, None]) * scale[:, :, None]
            end = end - (part * by_end).sum(axis=1)
            force = force - (part * by_force).sum(axis=1)
        new.beyond, new.force = end, force
        return new


def _unexplained(
    near: Neighbourhood,
    base: Mapping[str, Block],
    states: State,
    steps: Floats,
    beyond: Floats,
) -> tuple[Floats, Floats]:
    """What the linear model does not say of m states: gradients (m, n), and how much it is (m,).

    That is the squared length of what the residuals depart from it; NaN where a state is
    impossible.
    """
    count = len(steps)
    gradient, bent = np.full(steps.shape, np.nan), np.full(count, np.nan)
    at_once = max(1, ENTRIES // sum(block.jacobian.size for block in base.values()))
    for first in range(0, count, at_once):
        rows = np.arange(first, min(first + at_once, count))
        blocks = near.problem.evaluate(some(states, rows))
        each: list[tuple[Ints, Mapping[str, Block] | None]] = [(rows, blocks)]
        if blocks is None and len(rows) > 1:  # one of them is impossible: each alone
            each = [
                (one, near.problem.evaluate(some(states, one))) for one in rows[:, None]
            ]
        for some_rows, there in each:
            if there is not None:
                gradient[some_rows], bent[some_rows] = _off_linear(
                    base, there, steps[some_rows], beyond[some_rows]
                )
    return gradient, bent


def _off_linear(
    base: Mapping[str, Block], there: Mapping[str, Block], steps: Floats, beyond: Floats
) -> tuple[Floats, Floats]:
    """Gradients (m, n) of what the linear model does not say, and its squared length (m,)."""
    gradient, bent = np.zeros(steps.shape), np.zeros(len(steps))
    size = steps.shape[1]
    for name, block in base.items():
        expected = block.residual + times(block, beyond)
        found = there[name].residual
        if name != "gauge":  # which is no observation, and stays
            found = found - times(block, steps)
        off = found - expected
        bent += (off * off).reshape(len(steps), -1).sum(axis=1)
        gradient += gradient_of([Block(found, block.columns, there[name].jacobian)], size)
        gradient -= gradient_of([Block(expected, block.columns, block.jacobian)], size)
    return gradient, bent


def times(block: Block, steps: Floats) -> Floats:
    """(m, n, r) by which whitened observations move with (m, size) steps; some rows at a time."""
    n, r, k = block.jacobian.shape
    moved_by = np.empty((len(steps), n, r))
    at_once = max(1, ENTRIES // (k * len(steps)))
    for first in range(0, n, at_once):
        rows = slice(first, first + at_once)
        moved_by[:, rows] = np.moveaxis(block.times(rows, steps.T), 2, 0)
    return moved_by


def moved_alone(adjustment: Adjustment, step: Floats) -> State | None:
    """The whole survey adjusted to observations that moved as a step (size,) would move them."""
    errors = {
        name: times(block, step[None])[0]
        for name, block in adjustment.minimum.blocks.items()
        if name != "gauge"
    }
    return refit(adjustment, errors, AT_REST)
