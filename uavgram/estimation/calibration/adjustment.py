"""Maximum-likelihood adjustment of a calibration: intrinsics, distortion, bow and board poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.estimation.calibration.normals import (
    Normals,
    Products,
    UndeterminedError,
    departure,
    invert_border,
    prior_normal,
    unit_diagonal,
)
from uavgram.estimation.calibration.problem import POSE, Corners, Lens, Linear, State, linearise
from uavgram.model.arrays import Floats

CONVERGED = 1e-14
"""Predicted fall of the weighted sum of squares at which the rest is rounding."""

MAX_ITERATIONS = 100
MAX_DAMPING = 1e12


@dataclass(frozen=True, eq=False)
class Fit:
    """An adjusted calibration.

    Attributes
    ----------
    lens, corners, state
        What was estimated, from what, and the result.
    linear
        Residuals and Jacobians there, whitened with the corners' weights.
    normals
        Normal equations there.
    border_covariance
        (q, q) of the free parameters and the bow, for the sigmas as given.
    cost
        Weighted sum of squares, priors included.
    iterations, converged
        Steps tried; whether they came to rest.
    """

    lens: Lens
    corners: Corners
    state: State
    linear: Linear
    normals: Normals
    border_covariance: Floats
    cost: float
    iterations: int
    converged: bool

    @property
    def corner_cost(self) -> float:
        """Weighted sum of squares of the corners alone."""
        return float(np.sum(self.linear.residual**2))

    @property
    def degrees_of_freedom(self) -> int:
        """Observations and priors, less unknowns."""
        photos = int(np.count_nonzero(self.corners.count))
        known = _rank(prior_normal(self.lens))
        return int(2 * self.corners.count.sum()) + known - POSE * photos - self.lens.size

    @property
    def corner_redundancy(self) -> float:
        """Share of the corners in the degrees of freedom: the rest is the priors'."""
        known = float(np.trace(prior_normal(self.lens) @ self.border_covariance))
        photos = int(np.count_nonzero(self.corners.count))
        return float(2 * self.corners.count.sum()) - POSE * photos - self.lens.size + known

    def parameter_covariance(self, factor: float = 1.0) -> Floats:
        """(P + k, P + k) of camera and bow; zero where nothing is estimated.

        Parameters
        ----------
        factor
            Of the variances of all corners; those of the priors stay.
        """
        normal = self.normals.photo_border.sum(axis=0) / factor + prior_normal(self.lens)
        basis = self.lens.full_basis
        return np.asarray(basis @ invert_border(normal, self.lens) @ basis.T)


def adjust(lens: Lens, corners: Corners, start: State) -> Fit:
    """Minimise the weighted sum of squares from first values.

    Parameters
    ----------
    lens, corners
        What is sought, and the observations.
    start
        First values.

    Raises
    ------
    UndeterminedError
        The photos leave a parameter free; or the first values put the board behind a camera.
    """
    linear = linearise(lens, corners, start)
    if linear is None:
        raise UndeterminedError("the board lies behind the camera in the first values of a photo")
    state, cost = start, _cost(lens, linear, start)
    damping, growth = 1e-3, 2.0
    iteration, converged = 0, False
    products = Products.of(lens, linear, state)
    while iteration < MAX_ITERATIONS and damping < MAX_DAMPING:
        iteration += 1
        border, pose, predicted = products.step(damping)
        if predicted < CONVERGED * max(cost, 1.0):
            converged = True
            break
        trial = state.moved(lens, border, pose)
        trial_linear = linearise(lens, corners, trial)
        trial_cost = np.inf if trial_linear is None else _cost(lens, trial_linear, trial)
        gain = (cost - trial_cost) / predicted
        if trial_linear is not None and gain > 0:
            state, linear, cost = trial, trial_linear, trial_cost
            products = Products.of(lens, linear, state)
            # Nielsen 1999, "Damping parameter in Marquardt's method", eq. 2.5; quicker to let go
            damping *= max(0.1, 1.0 - (2.0 * gain - 1.0) ** 3)
            growth = 2.0
        else:
            damping *= growth
            growth *= 2.0
    normals = products.normals()
    return Fit(
        lens,
        corners,
        state,
        linear,
        normals,
        invert_border(normals.border, lens),
        cost,
        iteration,
        converged or damping >= MAX_DAMPING,
    )


def fit_poses(lens: Lens, corners: Corners, start: State) -> tuple[State, Floats]:
    """Poses of every photo on its own, the camera and the board held fixed.

    Parameters
    ----------
    lens, corners
        The lens (its free parameters are held), and the observations of M photos.
    start
        Camera, board, and first poses.

    Returns
    -------
    state
        With the best poses that were reached.
    cost : (M,)
        Weighted sum of squares of each photo; infinite where a corner lies behind the camera.
    """
    fixed = lens.without_border()
    state, linear = start, linearise(fixed, corners, start)
    if linear is None:
        return start, np.full(len(start.middle_camera_m), np.inf)
    cost = np.sum(linear.residual**2, axis=1)
    damping = np.full(len(cost), 1e-3)
    for _ in range(MAX_ITERATIONS):
        normal = np.swapaxes(linear.pose, 1, 2) @ linear.pose
        gradient = np.einsum("mri,mr->mi", linear.pose, linear.residual)
        scaled, scale = unit_diagonal(normal)
        scaled += damping[:, None, None] * np.eye(POSE)
        step = -np.linalg.solve(scaled, (gradient / scale)[..., None])[..., 0] / scale
        # Newton's decrement: at rest where the step would change nothing to speak of.
        if (-np.sum(step * gradient, axis=1) < CONVERGED * np.maximum(cost, 1.0)).all():
            break
        trial = state.moved(fixed, np.zeros(0), step)
        trial_linear = linearise(fixed, corners, trial)
        if trial_linear is None:
            damping *= 10.0
            continue
        trial_cost = np.sum(trial_linear.residual**2, axis=1)
        better = trial_cost <= cost
        damping = np.where(better, damping * 0.1, np.minimum(damping * 10.0, MAX_DAMPING))
        state = trial.where(better, state)
        linear = Linear(
            np.where(better[:, None], trial_linear.residual, linear.residual),
            np.where(better[:, None, None], trial_linear.pose, linear.pose),
            linear.border,
        )
        cost = np.where(better, trial_cost, cost)
    return state, cost


def _rank(normal: Floats) -> int:
    """Rank of a normal matrix, whatever its units."""
    return int(np.linalg.matrix_rank(unit_diagonal(normal)[0]))


def _cost(lens: Lens, linear: Linear, state: State) -> float:
    away = departure(lens, state)
    prior = float(away @ lens.prior_information @ away)
    return float(np.sum(linear.residual**2)) + prior
