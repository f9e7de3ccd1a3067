"""Levenberg-Marquardt of many poses at once, each with its own damping.

The survey's own loop (`estimation.solver`) minimises one sparse problem; here each has six unknowns
(and points that are eliminated), and there are thousands.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from uavgram.geometry.motion.rotation import exp_so3
from uavgram.model.arrays import Bools, Floats, Ints

ITERATIONS = 40
DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-3, 1e-9, 1e9
SETTLED = 1e-7
"""Expected fall of the sum of squares that needs no other step: 3e-4 sigma of any unknown."""

State = tuple[Floats, ...]
"""Centres (b, 3) [m], rotations (b, 3, 3) world from camera, and what else is unknown (b, ...)."""


class Linear(NamedTuple):
    """b problems about a state: sums of squares, normal matrices and their right sides.

    Attributes
    ----------
    cost
        (b,); NaN or inf where there is no such pose.
    normal, slope
        (b, 6, 6), (b, 6) by centre [m] and rotation behind that of the photo [rad]; all else is
        eliminated.
    rest
        (b, ...) arrays from which the step of all else follows.
    """

    cost: Floats
    normal: Floats
    slope: Floats
    rest: tuple[Floats, ...] = ()


class Problem(Protocol):
    """Many problems with six unknowns each."""

    def linearised(self, which: Ints, state: State) -> Linear:
        """Problems `which` (b,) about a state of b rows."""
        ...

    def moved(self, state: State, linear: Linear, step: Floats) -> State:
        """The state after steps of the poses.

        Parameters
        ----------
        state
            Of b problems.
        linear
            As it was linearised there.
        step
            (b, 6) of centre [m] and rotation [rad].
        """
        ...


class Ends(NamedTuple):
    """Where B minimisations ended.

    Attributes
    ----------
    center, rotation
        (B, 3) [m], (B, 3, 3) world from camera.
    cost
        (B,) sum of squares; inf where the start was no pose.
    normal
        (B, 6, 6) inverse of the covariance of (centre [m], rotation [rad]).
    converged
        (B,) whether nothing was left to gain.
    """

    center: Floats
    rotation: Floats
    cost: Floats
    normal: Floats
    converged: Bools


def pose_moved(state: State, step: Floats) -> tuple[Floats, Floats]:
    """Centres and rotations after steps (b, 6)."""
    return state[0] + step[:, :3], state[1] @ exp_so3(step[:, 3:])


def minimised(problem: Problem, start: State, iterations: int = ITERATIONS) -> Ends:
    """Minimise the sum of squares of each problem from its start.

    Parameters
    ----------
    problem
        B problems.
    start
        State of B rows.
    iterations
        At most so many steps, tried or taken; what has not settled by then is not converged.
    """
    count = len(start[0])
    state = tuple(part.copy() for part in start)
    first = problem.linearised(np.arange(count), state)
    cost = np.where(np.isfinite(first.cost), first.cost, np.inf)
    own = (first.normal, first.slope, *first.rest)
    damping = np.full(count, DAMPING)
    converged = np.zeros(count, dtype=np.bool_)
    for _ in range(iterations):
        active = np.flatnonzero(np.isfinite(cost) & ~converged)
        if not len(active):
            break
        here = Linear(
            cost[active], own[0][active], own[1][active], tuple(a[active] for a in own[2:])
        )
        step = _steps(here, damping[active])
        there = problem.moved(tuple(part[active] for part in state), here, step)
        found = problem.linearised(active, there)
        better = found.cost <= here.cost  # NaN is not
        taken = active[better]
        for kept, new in zip(state, there, strict=True):
            kept[taken] = new[better]
        for kept, new in zip(own, (found.normal, found.slope, *found.rest), strict=True):
            kept[taken] = new[better]
        cost[taken] = found.cost[better]
        factor = np.where(better, 0.1, 10.0)
        damping[active] = np.clip(damping[active] * factor, LEAST_DAMPING, MOST_DAMPING)
        fall = -np.einsum("bi,bi->b", step, here.slope)
        # Where rounding alone is left no step lowers the sum any more.
        converged[active[(fall < SETTLED) & (better | (damping[active] >= MOST_DAMPING))]] = True
        converged[active[(fall < SETTLED * 1e-3)]] = True
    return Ends(state[0], state[1], cost, own[0], converged)


def _steps(linear: Linear, damping: Floats) -> Floats:
    """(b, 6) damped steps; the damping counts in each unknown's own scale (Marquardt 1963)."""
    own = np.maximum(np.einsum("bii->bi", linear.normal), 1e-12)
    whitened = linear.normal / np.sqrt(own[:, :, None] * own[:, None, :])
    whitened += (damping + 1e-13)[:, None, None] * np.eye(6)
    scaled = np.linalg.solve(whitened, (linear.slope / np.sqrt(own))[..., None])[..., 0]
    return np.asarray(-scaled / np.sqrt(own))
