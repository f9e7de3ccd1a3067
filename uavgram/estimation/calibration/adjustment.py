"""Maximum-likelihood adjustment of a calibration: intrinsics, distortion, bow and board poses."""

from __future__ import annotations

from dataclasses import dataclass, replace

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
from uavgram.estimation.solver.batched import Explicit, minimise_each
from uavgram.estimation.solver.batched import State as Unknowns
from uavgram.model.arrays import Floats, Ints

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

    def state_of(poses: Unknowns) -> State:
        return replace(start, camera_from_board=poses[0], middle_camera_m=poses[1])

    def rows(which: Ints, poses: Unknowns) -> tuple[Floats, Floats]:
        linear = linearise(fixed, corners.take(which), state_of(poses), partial=True)
        assert linear is not None  # noqa: S101  (of some photos, it is NaN)
        return linear.residual, linear.pose

    def update(poses: Unknowns, step: Floats) -> Unknowns:
        there = state_of(poses).moved(fixed, np.zeros(0), step)
        return there.camera_from_board, there.middle_camera_m

    ends = minimise_each(
        Explicit(rows, update), (start.camera_from_board, start.middle_camera_m), MAX_ITERATIONS
    )
    return state_of(ends.state), ends.cost


def _rank(normal: Floats) -> int:
    """Rank of a normal matrix, whatever its units."""
    return int(np.linalg.matrix_rank(unit_diagonal(normal)[0]))


def _cost(lens: Lens, linear: Linear, state: State) -> float:
    away = departure(lens, state)
    prior = float(away @ lens.prior_information @ away)
    return float(np.sum(linear.residual**2)) + prior
