"""Maximum-likelihood adjustment of a calibration, and its cross-validation with unused photos."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.calibration.problem import (
    POSE_SIZE,
    Corners,
    Lens,
    Linearisation,
    State,
    linearise,
)
from uavgram.estimation.solver.batched import ExplicitProblem, minimise_each
from uavgram.estimation.solver.batched import State as Unknowns
from uavgram.estimation.solver.levenberg_marquardt import minimise
from uavgram.estimation.solver.normal_equations import (
    Block,
    Covariance,
    NormalEquations,
    compute_cost,
    compute_gradient,
)
from uavgram.estimation.solver.sparse.block_matrix import Structure
from uavgram.model.arrays import Floats, Ints
from uavgram.model.camera import parameter_names

MIN_REDUCTION = 1e-14
"""Predicted reduction of the weighted sum of squares at which the rest is rounding."""

MAX_ITERATIONS = 100

MIN_EIGENVALUE = 1e-13
"""Eigenvalue of the border's scaled normal matrix below which it is not determined."""

FACTOR_DAMPING = 1e-9
"""Damping that keeps the last factor solvable if photos leave a parameter undetermined: the
inversion of the border, which is not damped, then names that parameter."""


class UndeterminedError(GeometryError):
    """Photos that do not determine the camera."""


class Normals(NamedTuple):
    """Normal equations after elimination of the photos' poses.

    Schur complement: Triggs, McLauchlan, Hartley and Fitzgibbon 2000, "Bundle adjustment - a modern
    synthesis", sec. 6.1.

    Attributes
    ----------
    pose_inverse
        (M, 6, 6) inverses of the photos' own normal matrices; zero for a photo without corners.
    gain
        (M, 6, q): a change d of the border moves pose i by -gain[i] @ d.
    photo_border
        (M, q, q) normal matrix of the border by each photo once its pose is eliminated.
    border
        (q, q) their sum, and the priors.
    """

    pose_inverse: Floats
    gain: Floats
    photo_border: Floats
    border: Floats


@dataclass(frozen=True, eq=False)
class Fit:
    """Adjusted calibration.

    Attributes
    ----------
    lens, corners, state
        Estimated parameters, observations, and the result.
    linear
        Residuals and Jacobians at the result, whitened with the corners' weights.
    normals
        Normal equations at the result.
    border_covariance
        (q, q) of the free parameters and the bow, for the given sigmas.
    cost
        Weighted sum of squares, priors included.
    iterations, converged
        Number of steps tried; whether they converged.
    """

    lens: Lens
    corners: Corners
    state: State
    linear: Linearisation
    normals: Normals
    border_covariance: Floats
    cost: float
    iterations: int
    converged: bool

    @property
    def corner_block(self) -> Block:
        """Observations, a row of two for each corner: (M n, 2)."""
        photos, n = self.corners.weight.shape
        return Block(
            self.linear.residual.reshape(photos * n, 2),
            np.repeat(_columns(self.lens, photos), n, axis=0),
            self.linear.jacobian.reshape(photos * n, 2, -1),
        )

    @cached_property
    def covariance(self) -> Covariance:
        """Covariance of poses and border."""
        structure = _structure(self.lens, len(self.corners.weight))
        blocks = list(_blocks(self.lens, self.corners, self.state, self.linear).values())
        return NormalEquations(blocks, structure.size, structure).factor().covariance()

    @property
    def corner_cost(self) -> float:
        """Weighted sum of squares of the corners alone."""
        return float(np.sum(self.linear.residual**2))

    @property
    def degrees_of_freedom(self) -> int:
        """Observations and priors minus unknowns."""
        photos = int(np.count_nonzero(self.corners.count))
        known = _rank(compute_prior_normal(self.lens))
        return int(2 * self.corners.count.sum()) + known - POSE_SIZE * photos - self.lens.size

    @property
    def corner_redundancy(self) -> float:
        """Share of the corners in the degrees of freedom: the rest is that of the priors."""
        known = float(np.trace(compute_prior_normal(self.lens) @ self.border_covariance))
        photos = int(np.count_nonzero(self.corners.count))
        return float(2 * self.corners.count.sum()) - POSE_SIZE * photos - self.lens.size + known

    def parameter_covariance(self, factor: float = 1.0) -> Floats:
        """Compute (P + k, P + k) covariance of camera and bow; zero for fixed parameters.

        Parameters
        ----------
        factor
            Factor of the variances of all corners; those of the priors do not change.
        """
        normal = self.normals.photo_border.sum(axis=0) / factor + compute_prior_normal(self.lens)
        basis = self.lens.full_basis
        return np.asarray(basis @ invert_border(normal, self.lens) @ basis.T)


def adjust(lens: Lens, corners: Corners, start: State) -> Fit:
    """Minimise the weighted sum of squares from initial values.

    Parameters
    ----------
    lens, corners
        Lens to estimate, and the observations.
    start
        Initial values.

    Raises
    ------
    UndeterminedError
        The photos leave a parameter undetermined; or the initial values put the board behind a
        camera.
    """
    structure = _structure(lens, len(corners.weight))

    def evaluate(state: State) -> dict[str, Block] | None:
        linear = linearise(lens, corners, state)
        return None if linear is None else _blocks(lens, corners, state, linear)

    def update(state: State, step: Floats) -> State:
        poses, border = np.split(step, [structure.first_shared])
        return state.apply_step(lens, border, poses.reshape(-1, POSE_SIZE))

    if evaluate(start) is None:
        raise UndeterminedError("the board is behind the camera in the first values of a photo")
    end = minimise(
        start,
        evaluate,
        update,
        structure.size,
        structure,
        MAX_ITERATIONS,
        at_rest=MIN_REDUCTION,
        slack=FACTOR_DAMPING,
    )
    state, blocks, cost = end.state, end.blocks, end.cost
    if end.converged:  # a last step, whose effect on the cost is lost in rounding
        gradient = compute_gradient(blocks.values(), structure.size)
        state = update(state, -end.factor.solve(gradient))
        blocks = evaluate(state) or blocks
        cost = compute_cost(blocks.values())
    linear = Linearisation(blocks["corners"].residual, blocks["corners"].jacobian)
    normals = eliminate_poses(lens, linear)
    border = invert_border(normals.border, lens)
    return Fit(lens, corners, state, linear, normals, border, cost, end.iterations, end.converged)


def fit_poses(lens: Lens, corners: Corners, start: State) -> tuple[State, Floats]:
    """Estimate the pose of every photo separately, with camera and board held fixed.

    Parameters
    ----------
    lens, corners
        The lens (its free parameters are held), and the observations of M photos.
    start
        Camera, board, and initial poses.

    Returns
    -------
    state
        State with the best poses that were reached.
    cost : (M,)
        Weighted sum of squares of each photo; infinite if a corner is behind the camera.
    """
    fixed = lens.hold_fixed()

    def state_of(poses: Unknowns) -> State:
        return replace(start, camera_from_board=poses[0], middle_camera_m=poses[1])

    def rows(which: Ints, poses: Unknowns) -> tuple[Floats, Floats]:
        linear = linearise(fixed, corners.take(which), state_of(poses), partial=True)
        assert linear is not None  # noqa: S101  (of some photos, it is NaN)
        return linear.residual, linear.pose

    def update(poses: Unknowns, step: Floats) -> Unknowns:
        there = state_of(poses).apply_step(fixed, np.zeros(0), step)
        return there.camera_from_board, there.middle_camera_m

    ends = minimise_each(
        ExplicitProblem(rows, update),
        (start.camera_from_board, start.middle_camera_m),
        MAX_ITERATIONS,
    )
    return state_of(ends.state), ends.cost


def eliminate_poses(lens: Lens, linear: Linearisation) -> Normals:
    """Eliminate the poses of all photos at once."""
    product = np.swapaxes(linear.jacobian, 1, 2) @ linear.jacobian
    pose, cross = product[:, :POSE_SIZE, :POSE_SIZE], product[:, :POSE_SIZE, POSE_SIZE:]
    inverse = _invert_poses(pose)
    gain = inverse @ cross
    # Schur complement of each photo: N_bb - N_bp N_pp^-1 N_pb.
    photo = product[:, POSE_SIZE:, POSE_SIZE:] - np.swapaxes(cross, 1, 2) @ gain
    return Normals(inverse, gain, photo, photo.sum(axis=0) + compute_prior_normal(lens))


def scale_to_unit_diagonal(normal: Floats) -> tuple[Floats, Floats]:
    """Scale normal matrices (..., q, q) to unit diagonals; also return the (..., q) scales."""
    diagonal = np.einsum("...ii->...i", normal)
    scale = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    return normal / (scale[..., :, None] * scale[..., None, :]), scale


def _invert_poses(normal: Floats) -> Floats:
    """Invert (M, 6, 6); zero for a photo without corners."""
    empty = ~(np.einsum("mii->mi", normal) > 0).all(axis=1)
    scaled, scale = scale_to_unit_diagonal(normal)
    scaled[empty] = np.eye(POSE_SIZE)
    inverse = np.linalg.inv(scaled) / (scale[:, :, None] * scale[:, None, :])
    inverse[empty] = 0.0
    return np.asarray(inverse)


def invert_border(normal: Floats, lens: Lens) -> Floats:
    """Compute the covariance of the border; an error names an undetermined parameter."""
    if not len(normal):
        return normal
    scaled, scale = scale_to_unit_diagonal(normal)
    values, vectors = np.linalg.eigh(scaled)
    if values[0] < MIN_EIGENVALUE:
        unknown = int(np.argmax(np.abs(vectors[:, 0])))
        raise UndeterminedError(
            f"the photos do not determine {_name_unknown(lens, unknown)}: take more photos with "
            "the board tilted in different directions, or estimate fewer parameters"
        )
    root = vectors / np.sqrt(values) / scale[:, None]
    return np.asarray(root @ root.T)


def _name_unknown(lens: Lens, unknown: int) -> str:
    f = lens.basis.shape[1]
    if unknown >= f:
        return "the bow of the board"
    row = int(np.flatnonzero(lens.basis[:, unknown])[-1])
    return parameter_names(lens.model, len(lens.basis))[row]


def compute_prior_normal(lens: Lens) -> Floats:
    """Compute the (q, q) normal matrix of the border's prior."""
    basis = lens.full_basis
    return np.asarray(basis.T @ lens.prior_information @ basis)


def _rank(normal: Floats) -> int:
    """Compute the rank of a normal matrix, independent of its units."""
    return int(np.linalg.matrix_rank(scale_to_unit_diagonal(normal)[0]))


def _structure(lens: Lens, photos: int) -> Structure:
    """Return the structure of the unknowns: a block of six for each photo, then the border."""
    first = POSE_SIZE * photos
    return Structure(first + lens.size, 0, 1, POSE_SIZE, first)


def _columns(lens: Lens, photos: int) -> Ints:
    """Return the (M, 6 + q) unknowns of each photo's corners."""
    own = np.arange(POSE_SIZE * photos).reshape(photos, POSE_SIZE)
    border = POSE_SIZE * photos + np.arange(lens.size)
    return np.concatenate([own, np.broadcast_to(border, (photos, lens.size))], axis=1)


def _blocks(lens: Lens, corners: Corners, state: State, linear: Linearisation) -> dict[str, Block]:
    """Return blocks of corners, of priors, and of the held poses of photos without corners."""
    columns = _columns(lens, len(corners.weight))
    blocks = {"corners": Block(linear.residual, columns, linear.jacobian)}
    away = np.concatenate([state.parameters, state.bow_m]) - lens.prior_mean
    root = lens.prior_root
    if len(root) and lens.size:
        blocks["prior"] = Block(
            (root @ away)[None], columns[:1, POSE_SIZE:], (root @ lens.full_basis)[None]
        )
    held = columns[corners.count == 0, :POSE_SIZE]
    if len(held):
        blocks["held"] = Block(
            np.zeros(held.shape), held, np.tile(np.eye(POSE_SIZE), (len(held), 1, 1))
        )
    return blocks


MAX_FOLDS = 20
"""Largest number of adjustments of a cross-validation."""


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Photos predicted by a camera that was calibrated without them.

    Attributes
    ----------
    squares
        (M,) whitened sum of squares of each photo's residuals: with camera and board by the other
        photos, and the pose by its own corners. NaN if the others do not determine it.
    degrees
        (M,) 2 n - 6.
    """

    squares: Floats
    degrees: Floats

    @property
    def factor(self) -> float:
        """Mean square per degree of freedom: corners' noise and camera's error; inf if unknown.

        A model that needs some of the photos to be determined predicts nothing.
        """
        if not np.isfinite(self.squares).all():
            return np.inf
        return float(self.squares.sum() / max(self.degrees.sum(), 1.0))

    @property
    def by_photo(self) -> Floats:
        """(M,) mean square per degree of freedom of each photo."""
        return np.asarray(self.squares / np.maximum(self.degrees, 1.0))


def cross_validate(fit: Fit) -> HeldOut:
    """Leave photos out, one at a time (in at most 20 groups), and predict them."""
    photos = len(fit.corners.weight)
    squares = np.full(photos, np.nan)
    group = np.arange(photos) % min(photos, MAX_FOLDS)
    for fold in range(group.max() + 1):
        out = group == fold
        try:
            rest = adjust(fit.lens, fit.corners.take(~out), fit.state.take(~out))
        except UndeterminedError:
            continue
        seen = replace(
            fit.state.take(out), parameters=rest.state.parameters, bow_m=rest.state.bow_m
        )
        cost = fit_poses(fit.lens, fit.corners.take(out), seen)[1]
        squares[out] = np.where(np.isfinite(cost), cost, np.nan)
    return HeldOut(squares, np.maximum(2.0 * fit.corners.count - POSE_SIZE, 0.0))


def compute_information_criteria(fit: Fit) -> tuple[float, float]:
    """Compute Akaike's and the Bayesian information criterion, with unknown noise of the corners.

    Burnham and Anderson 2002, "Model selection and multimodel inference", sec. 2.2 and 6.4.1.
    """
    observations = 2.0 * float(fit.corners.count.sum())
    unknowns = fit.lens.size + POSE_SIZE * np.count_nonzero(fit.corners.count) + 1
    fitted = observations * np.log(fit.corner_cost / observations)
    return float(fitted + 2 * unknowns), float(fitted + unknowns * np.log(observations))


def choose_simplest(scores: list[HeldOut]) -> int:
    """Return the index of the first model (simplest first) that predicts as well as the best one.

    As well: within one standard error of the difference over photos (Hastie, Tibshirani and
    Friedman 2009, "The elements of statistical learning", sec. 7.10).
    """
    factors = [score.factor for score in scores]
    best = int(np.argmin(factors))
    for index in range(best):
        if not np.isfinite(factors[index]):
            continue
        difference = scores[index].by_photo - scores[best].by_photo
        if difference.mean() <= difference.std(ddof=1) / np.sqrt(len(difference)):
            return index
    return best
