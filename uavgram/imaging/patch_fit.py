"""Least-squares fits of grey-value models to small windows of a photo.

Many windows are fitted at once, each with its own damping (Levenberg 1944, Marquardt 1963); windows
that have converged drop out.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Floats, Ints

Model = Callable[[Floats, Ints], tuple[Floats, Floats]]
"""Weighted residuals (n, k) of windows and their derivatives (n, p, k).

Arguments are the states (n, p) and the indices (n,) of the windows.
"""

_ROUNDS = 15
_CONVERGED_PX = 1e-3  # steps shrink fast: the next one would be far smaller
_MOST_DAMPING = 1e8
_MOST_CORRELATION = 0.9


class Fit(NamedTuple):
    """Fitted windows.

    Attributes
    ----------
    state
        (n, p) parameters.
    residual
        (n, k) weighted residuals.
    normal
        (n, p, p) normal matrix; singular where a window does not determine all parameters.
    """

    state: Floats
    residual: Floats
    normal: Floats

    @property
    def cost(self) -> Floats:
        """(n,) sum of the squared residuals."""
        return np.asarray((self.residual**2).sum(axis=1))

    @property
    def inverse(self) -> Floats:
        """(n, p, p) inverse normal matrix."""
        return np.asarray(np.linalg.inv(_regular(self.normal, np.zeros(len(self.normal)))))


def fit_windows(
    model: Model,
    start: Floats,
    *,
    bounds: tuple[Floats, Floats] | None = None,
    damping: float = 1e-2,
    places: int = 2,
    rounds: int = _ROUNDS,
) -> Fit:
    """Fit a model to windows.

    Parameters
    ----------
    model
        Residuals and derivatives; a window is given up where they are not finite, and its cost is
        not finite.
    start
        (n, p) start values of the states.
    bounds
        Least and largest value (p,) of the parameters.
    damping
        Damping of the first step; with 0 all steps are Gauss-Newton steps, taken whether the cost
        falls or not.
    places
        Number of leading parameters that are pixel coordinates: the others follow them, so a window
        has converged when these no longer move.
    rounds
        Largest number of steps.
    """
    state = start.copy()
    residual, jacobian = model(state, np.arange(len(state)))
    normal, gradient = _equations(residual, jacobian)
    cost = (residual**2).sum(axis=1)
    damped = np.full(len(state), damping)
    active = np.flatnonzero(np.isfinite(cost))
    for _ in range(rounds):
        if not len(active):
            break
        # Damped normal equations: (N + damping diag N) step = gradient.
        regular = _regular(normal[active], damped[active])
        step = np.linalg.solve(regular, gradient[active, :, None])[..., 0]
        trial = state[active] - step
        if bounds is not None:
            trial = trial.clip(*bounds)
        remains, jacobian = model(trial, active)
        after = (remains**2).sum(axis=1)
        # Accept steps that reduce the cost; otherwise increase the damping.
        better = ~((after >= cost[active]) & (damped[active] > 0))
        damped[active] *= np.where(better, 0.1, 10.0)
        taken = active[better]
        state[taken], cost[taken], residual[taken] = trial[better], after[better], remains[better]
        equations = _equations(remains, jacobian)
        normal[taken], gradient[taken] = (part[better] for part in equations)
        small = np.abs(step[:, :places]).max(axis=1) < _CONVERGED_PX
        active = active[~small & np.isfinite(after) & (damped[active] < _MOST_DAMPING)]
    return Fit(state, residual, normal)


def estimate_neighbour_correlation(residual: Floats, root: Floats) -> Floats:
    """Compute correlations (2, n) of residuals with neighbours along rows and columns, 0 to 0.9.

    Parameters
    ----------
    residual
        (n, h, w), each times the root of its weight.
    root
        (h, w) or (n, h, w) these roots; 0 where not used.
    """
    axes = (-2, -1)
    variance = np.maximum((residual**2).sum(axis=axes), 1e-12) / np.maximum(
        (root**2).sum(axis=axes), 1.0
    )
    here = np.s_[..., :-1], np.s_[..., :-1, :]
    following = np.s_[..., 1:], np.s_[..., 1:, :]
    alike = [
        (residual[a] * residual[b]).sum(axis=axes)
        / np.maximum((root[a] * root[b]).sum(axis=axes), 1.0)
        for a, b in zip(here, following, strict=True)
    ]
    return np.asarray((np.stack(alike) / variance).clip(0.0, _MOST_CORRELATION))


def compute_variance_growth(correlation: Floats) -> Floats:
    """Compute the growth (n,) of a mean's variance by correlations (2, n) of neighbours.

    It is the sum of all correlations of a first-order process along rows and along columns.
    """
    return np.asarray(((1.0 + correlation) / (1.0 - correlation)).prod(axis=0))


def _equations(residual: Floats, jacobian: Floats) -> tuple[Floats, Floats]:
    """Form normal matrices (n, p, p) and gradients (n, p)."""
    normal = jacobian @ np.swapaxes(jacobian, 1, 2)
    return normal, (jacobian @ residual[..., None])[..., 0]


def _regular(normal: Floats, damping: Floats) -> Floats:
    """Damp the diagonal of normal matrices; regular also where a window has no texture."""
    diagonal = np.diagonal(normal, axis1=1, axis2=2)
    floor = 1e-9 * diagonal.max(axis=1, keepdims=True) + 1e-12
    more = damping[:, None] * diagonal + floor
    return np.asarray(normal + more[..., None] * np.eye(normal.shape[1]))
