"""Adjusted survey: estimates, covariance, left-out observations and heights over the ground."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Literal, NamedTuple

import numpy as np
from scipy.special import softmax

from uavgram.estimation.solver.levenberg_marquardt import Minimum
from uavgram.estimation.solver.normal_equations import Covariance, Factor
from uavgram.estimation.survey.ground_planes import compute_relief_basis
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.observations.lengths import TapedLengths, compute_unlearnt
from uavgram.estimation.survey.observations.observation import Suspicion
from uavgram.estimation.survey.observations.sightings import compute_readout_motion
from uavgram.estimation.survey.unknowns import State
from uavgram.geometry.ground.row_projection import RowPoses, project_rows
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.message import Message
from uavgram.model.result.reliability import Noise
from uavgram.model.survey import Cause, Survey

# Relative singular value below which a motion is no motion: a turn about the line on which all
# points are, or about the only point.
_NO_MOTION = 1e-6


class Placed(NamedTuple):
    """K points of D coordinates, their derivatives by unknowns, and the columns of these.

    `position` (K, D); `gradient` (K, D, k); `columns` (K, k).
    """

    position: Floats
    gradient: Floats
    columns: Ints


def compute_relative_covariance(factor: Factor, points: Placed, rows: Ints, own: Floats) -> Floats:
    """Compute covariances (n, D, D) of some points without the common shift and turn of all points.

    The shape of the scene is independent of its position and heading, which receivers and compasses
    determine.

    Parameters
    ----------
    factor
        Factor of the normal matrix.
    points
        All points, in the plane or in space.
    rows
        (n,) points whose covariances are returned.
    own
        (n, D, D) their covariances.

    Notes
    -----
    S-transformation to the datum of all points (Baarda 1973, "S-transformations and criterion
    matrices"; inner constraints): with U an orthonormal basis of the shifts and turns of all
    points, and Q their covariance, the blocks of (I - U U^T) Q (I - U U^T). A single point has no
    shape: 0.
    """
    count, size = points.position.shape
    basis = _motions(points.position)
    if basis.shape[2] == count * size:
        return np.zeros_like(own)
    # With the points' Jacobian G: N^-1 G^T U, and from it the columns Q U of the covariance.
    right = np.zeros((factor.size, basis.shape[2]))
    np.add.at(right, points.columns, np.einsum("kdi,kdm->kim", points.gradient, basis))
    solved = factor.solve(right)
    cross = np.einsum("ndi,nim->ndm", points.gradient[rows], solved[points.columns[rows]])
    # Blocks of Q - Q U U^T - U U^T Q + U (U^T Q U) U^T.
    mixed = np.einsum("nim,njm->nij", cross, basis[rows])
    spread = np.einsum("nim,ml,njl->nij", basis[rows], right.T @ solved, basis[rows])
    return np.asarray(own - mixed - np.swapaxes(mixed, 1, 2) + spread)


def _motions(position: Floats) -> Floats:
    """Compute a (K, D, m) orthonormal basis of the common shifts and turns of all points (K, D)."""
    count, size = position.shape
    shifts = np.tile(np.eye(size), (count, 1, 1))
    off = position - position.mean(axis=0)
    if size == 2:
        turns = np.stack([-off[:, 1], off[:, 0]], axis=1)[:, :, None]
    else:
        turns = -np.cross(off[:, None, :], np.eye(3)).swapaxes(1, 2)  # e x r, of each axis e
    free = np.concatenate([shifts, turns], axis=2).reshape(count * size, -1)
    basis, reach, _ = np.linalg.svd(free, full_matrices=False)
    return np.asarray(basis[:, reach > _NO_MOTION * reach[0]]).reshape(count, size, -1)


@dataclass(frozen=True, eq=False)
class Adjustment:
    """Adjusted survey.

    Attributes
    ----------
    problem
        Likelihood, which holds the survey, the layout of the unknowns and the pivot of the slopes.
    minimum
        State, residual blocks, factorised normal matrix.
    covariance
        Covariances of all unknowns that share an observation; joint covariances of others come from
        the factor.
    """

    problem: SurveyProblem
    minimum: Minimum[State]
    covariance: Covariance

    @property
    def survey(self) -> Survey:
        """Observations."""
        return self.problem.survey

    @property
    def state(self) -> State:
        """Estimates of the unknowns."""
        return self.minimum.state

    @property
    def degrees_of_freedom(self) -> int:
        """Number of observations and priors minus that of the unknowns."""
        observations = sum(block.residual.size for block in self.minimum.blocks.values())
        return observations - self.problem.layout.size

    @property
    def variance_factor(self) -> float:
        """Weighted sum of squares over the degrees of freedom; NaN without redundancy."""
        degrees = self.degrees_of_freedom
        return self.minimum.cost / degrees if degrees > 0 else float("nan")

    def label_index(self, label: str) -> int:
        """Return the position of a label; -1 if it is not among the adjusted points."""
        return int(self.label_rows([label])[0])

    def label_rows(self, labels: Iterable[str]) -> Ints:
        """Return (n,) positions of labels; -1 if one is not among the adjusted points."""
        place = self.survey.row_of_label
        return np.array([place.get(label, -1) for label in labels], dtype=np.int64)

    def pixels(self, frame: Ints, label: Ints) -> Floats:
        """Compute (n, 2) pixels at which labels appear in frames [px]; NaN behind the camera."""
        state = self.state
        world, _, _ = self.problem.world_points(state, label)
        poses = RowPoses(state.center[frame], state.rotation[frame], self.sweep()[frame])
        return project_rows(self.survey.calibration, self.problem.intrinsics(state), poses, world)

    def sweep(self) -> Floats:
        """Compute (F, 6) motions of the camera during the readout of each photo: see `RowPoses`."""
        return compute_readout_motion(self.survey, self.state)

    def relief_m(self, area: int) -> float:
        """Compute the RMS of an area's smooth departures from its plane, at its points [m]."""
        relief, own = self.survey.grounds[area].relief, self.survey.area == area
        if relief is None or not own.any():
            return 0.0
        coefficient = self.state.relief[self.problem.ground.relief_rows(area)]
        height = compute_relief_basis(relief, self.state.point[own, :2]).value @ coefficient
        return float(np.sqrt(np.mean(height**2)))

    def departure_m(self, area: int) -> float:
        """Compute the typical departure of an area from its plane: roughness and relief [m]."""
        return float(np.hypot(self.survey.grounds[area].roughness_sigma_m, self.relief_m(area)))

    def frame_covariance(self) -> Floats:
        """Return (F, 6, 6) covariances of (δcentre world, δθ camera)."""
        frames = np.arange(self.problem.layout.frames)
        return self.covariance.blocks(self.problem.layout.frame_columns(frames))

    def points(self) -> tuple[Floats, Floats]:
        """Return positions (K, 3) and covariances (K, 3, 3) of all points, east, north, up."""
        layout = self.problem.layout
        label = np.arange(layout.points)
        world, jacobian, columns = self.points_with_jacobian(label)
        joint = self.covariance.blocks(columns)
        return world, np.einsum("nij,njk,nlk->nil", jacobian, joint, jacobian, optimize=True)

    def relative_points(self) -> Floats:
        """Compute covariances (K, 2, 2) of east, north by `compute_relative_covariance`."""
        layout = self.problem.layout
        label = np.arange(layout.points)
        planar = layout.point_columns(label)[:, :2]
        gradient = np.broadcast_to(np.eye(2), (layout.points, 2, 2))
        points = Placed(self.state.point[:, :2], gradient, planar)
        own = self.covariance.blocks(planar)
        return compute_relative_covariance(self.minimum.factor, points, label, own)

    def relative_points_in_space(self, label: Ints) -> Floats:
        """Compute covariances (n, 3, 3) of east, north and up of some points within the survey.

        The turn of all points in space, that is the tilt of the whole scene, is removed as well.
        """
        points = Placed(*self.points_with_jacobian(np.arange(self.problem.layout.points)))
        gradient = points.gradient[label]
        joint = self.covariance.blocks(points.columns[label])
        own = np.einsum("nij,njk,nlk->nil", gradient, joint, gradient, optimize=True)
        return compute_relative_covariance(self.minimum.factor, points, label, own)

    def joint_points(self, label: Ints) -> tuple[Floats, Floats]:
        """Compute positions (n, 3) of some points, and their joint covariance (3n, 3n)."""
        world, jacobian, columns = self.points_with_jacobian(label)
        unknowns, place = np.unique(columns, return_inverse=True)
        place = place.reshape(columns.shape)
        dense = np.zeros((len(label), 3, len(unknowns)))
        rows = np.arange(len(label))[:, None, None]
        np.add.at(dense, (rows, np.arange(3)[:, None], place[:, None, :]), jacobian)
        flat = dense.reshape(3 * len(label), len(unknowns))
        return world, flat @ self.minimum.factor.joint(unknowns) @ flat.T

    def shared_covariance(self, first: int, count: int) -> Floats:
        """Return the (count, count) covariance of adjacent shared unknowns."""
        return self.minimum.factor.joint(first + np.arange(count))

    def sight_covariance(self, frame: Ints) -> Floats:
        """Compute joint covariances (n, 9 + P, 9 + P) of the values that place a frame's pixels.

        Rows: pose (δcentre world [m], δθ camera [rad]), interior orientation (P), and the first
        area's plane (height [m], slopes), which is known where it is the gauge. One more row is the
        readout time [s], where that is an unknown.
        """
        layout, lens = self.problem.layout, self.problem.intrinsic_root(self.state)
        plane = 0 if layout.free_gauge else 3
        shared = np.concatenate(
            [
                layout.first_intrinsic + np.arange(layout.intrinsics),
                layout.first_plane + np.arange(plane),
                layout.first_readout + np.arange(layout.readout),
            ]
        )
        # Matrix from the estimated unknowns to the rows: identity for the pose and the plane, the
        # calibration's root for the lens; zero rows for a plane that is the gauge.
        to_lens = np.zeros((9 + len(lens) + layout.readout, 6 + len(shared)))
        to_lens[:6, :6] = np.eye(6)
        to_lens[6 : 6 + len(lens), 6 : 6 + layout.intrinsics] = lens
        rest = np.eye(3 + layout.readout)
        known = [] if plane else [0, 1, 2]
        to_lens[6 + len(lens) :, 6 + layout.intrinsics :] = np.delete(rest, known, axis=1)
        # Columns of the covariance of all shared unknowns, by one solution.
        right = np.zeros((layout.size, len(shared)))
        right[shared, np.arange(len(shared))] = 1.0
        with_shared = self.minimum.factor.solve(right)
        columns = layout.frame_columns(frame)
        joint = np.empty((len(frame), to_lens.shape[1], to_lens.shape[1]))
        joint[:, :6, :6] = self.covariance.blocks(columns)
        joint[:, :6, 6:] = with_shared[columns]
        joint[:, 6:, :6] = joint[:, :6, 6:].swapaxes(1, 2)
        joint[:, 6:, 6:] = with_shared[shared]
        return np.asarray(to_lens @ joint @ to_lens.T)

    def readings(self, taped: TapedLengths) -> tuple[Floats, Floats]:
        """Predict tape readings (n,) and their standard deviations, those of scales included."""
        reading, gradient, unknowns = self.problem.readings(self.state, taped)
        variance = self.minimum.factor.variances(unknowns, gradient)
        return reading, np.sqrt(variance + (self.unlearnt(taped, reading) ** 2).sum(axis=1))

    def unlearnt(self, taped: TapedLengths, reading_m: Floats) -> Floats:
        """Return (n, U) errors of readings by tapes without an adjusted length (see `tapes`)."""
        return compute_unlearnt(self.problem.tapes, taped, reading_m, self.survey.scale_sigma_of)

    def points_with_jacobian(self, label: Ints) -> tuple[Floats, Floats, Ints]:
        """Return points (n, 3), their Jacobians (n, 3, k), and the k unknowns (n, k) of each."""
        return self._join_derivatives(label, *self.problem.world_points(self.state, label))

    def ground_with_jacobian(self, label: Ints) -> tuple[Floats, Floats, Ints]:
        """Return the same for the places on the smooth ground straight below points."""
        return self._join_derivatives(label, *self.problem.ground_points(self.state, label))

    def _join_derivatives(
        self, label: Ints, world: Floats, d_point: Floats, d_plane: Floats
    ) -> tuple[Floats, Floats, Ints]:
        problem = self.problem
        columns = np.concatenate(
            [problem.layout.point_columns(label), problem.plane_columns(label)], axis=1
        )
        return world, np.concatenate([d_point, d_plane], axis=2), columns


class LeftOutCause(Enum):
    """Reason why a pick takes no part in an adjustment."""

    BEYOND_LENS = "beyond-lens"
    NO_GROUND = "no-ground"
    NOT_JOINED = "not-joined"
    UNDETERMINED = "undetermined"
    MISPLACED_FRAME = "misplaced-frame"
    GROSS = "gross"

    @property
    def is_of_frame(self) -> bool:
        """Return whether it concerns the pick's whole frame, and not the pick alone."""
        return self in (
            LeftOutCause.NOT_JOINED,
            LeftOutCause.UNDETERMINED,
            LeftOutCause.MISPLACED_FRAME,
        )


@dataclass(frozen=True)
class LeftOut:
    """Reason why a pick takes no part in an adjustment: as data, and as part of a sentence."""

    cause: LeftOutCause
    text: str


class LeftOutRows(NamedTuple):
    """Observation that takes no part, compared with the prediction of the adjustment.

    Attributes
    ----------
    error, sigma
        (R,) predicted minus observed, and standard deviations of the observed numbers.
    gradient, columns
        (R, m) derivatives of the predictions by the unknowns, and the columns of these.
    """

    error: Floats
    sigma: Floats
    gradient: Floats
    columns: Ints


@dataclass(frozen=True, eq=False)
class Removal:
    """Observation that was left out because it does not fit, or a correction that was made instead.

    Attributes
    ----------
    kind, index
        ``pick`` or ``line`` with the index in the survey handed in; or ``known``, by its number;
        ``mend`` (-1).
    suspicion
        Its test statistic at that time, and the observations that no test could separate from it.
    before
        Survey adjusted with it; None if it would have distorted all other estimates, so that it was
        left out beforehand (`suspicion` has then no row).
    cause, mended
        For a mend: the error, and the description of the change, before and after.
    rows
        For a length or known thing that was left out beforehand, its rows in the adjustment without
        it; None if that does not have all of its points.
    """

    kind: Literal["pick", "line", "known", "mend"]
    index: int
    suspicion: Suspicion
    before: Refined | None
    cause: Cause | None = None
    mended: tuple[str, str] = ("", "")
    rows: LeftOutRows | None = None

    @property
    def w(self) -> float:
        """Absolute test statistic before it was left out."""
        return abs(self.suspicion.w)


class Explanation(NamedTuple):
    """Another explanation of the observations: a minimum, or a mistake that is put right.

    `log_odds` is the logarithm of its odds against the result.
    """

    adjustment: Adjustment
    log_odds: float


class Reading(NamedTuple):
    """A click, a length, a known thing or a control point, by its names.

    `kind` is its group in the likelihood; `words` describe it in a sentence.
    """

    kind: str
    name: str
    words: str
    labels: tuple[str, ...]
    frames: tuple[str, ...] = ()


class Rival(NamedTuple):
    """Readings that may be wrong in place of some that were left out.

    The rest fits as well without them. `explanation` is the adjustment without them; None where it
    is one of the alternatives of the result.
    """

    readings: tuple[Reading, ...]
    instead_of: tuple[Reading, ...]
    explanation: Explanation | None = None


@dataclass(frozen=True, eq=False)
class Refined:
    """Result of the refine stage.

    Attributes
    ----------
    adjustment
        Final adjustment.
    pick_index, line_index
        Indices of the picks and lines of `adjustment` in the survey that was handed in.
    pick_removed, line_removed
        (P,), (L,) masks of the survey handed in: removed as blunders.
    known_removed
        Numbers of the known things that were removed.
    pose_widened
        Factors by which the sigmas of wrong poses of the log were enlarged, by photo.
    pick_reason
        Reasons why picks (index into the survey handed in) were left out beforehand.
    undetermined
        Those of them that were left out because they depend on undetermined unknowns.
    alternatives
        Other minima that explain the lengths as well.
    noise
        Error sizes estimated from the residuals; None if they were not estimated.
    stated
        Same survey adjusted with the stated sigmas, if that is another adjustment.
    compared
        Adjustment with the sigmas of `alternatives`, with which these are compared; None:
        `adjustment`.
    off_ground
        Names of the labels whose heights are estimated, although they were not stated to be off the
        ground.
    left_out
        Readings that were left out as gross errors.
    rivals
        Readings that explain the misfit as well as some of these.
    causes
        Explanations of the misfits, likeliest first.
    possible
        Mistakes that explain about as much as what was left out, likeliest first.
    explanations
        Solutions without the mistakes that the result does not take into account, those that
        exclude each other in one group; and the solution with all photos mirrored, if the log does
        not rule it out.
    forbidding
        Codes of mistakes that forbid the use of the values which they contradict, each with the
        solutions without it; several may have one code, as of several tapes.
    matches_left_out
        Rows of the project's picks: matches that do not fit the sightings in other photos.
    """

    adjustment: Adjustment
    pick_index: Ints
    line_index: Ints
    removals: tuple[Removal, ...]
    pick_removed: Bools
    line_removed: Bools
    pick_reason: Mapping[int, LeftOut]
    alternatives: tuple[Adjustment, ...]
    undetermined: frozenset[int] = frozenset()
    known_removed: frozenset[int] = frozenset()
    pose_widened: Mapping[str, float] = field(default_factory=dict)
    noise: Noise | None = None
    stated: Adjustment | None = None
    compared: Adjustment | None = None
    off_ground: frozenset[str] = frozenset()
    left_out: tuple[Reading, ...] = ()
    rivals: tuple[Rival, ...] = ()
    causes: tuple[Cause, ...] = ()
    possible: tuple[Message, ...] = ()
    explanations: tuple[tuple[Explanation, ...], ...] = ()
    forbidding: tuple[tuple[str, tuple[Explanation, ...]], ...] = ()
    matches_left_out: frozenset[int] = frozenset()

    @property
    def is_log_left_out(self) -> bool:
        """Whether all poses of the log were left out, as wrong as a whole."""
        prior = self.adjustment.survey.telemetry
        return prior is not None and len(self.pose_widened) >= len(prior.frame_index)

    @property
    def settled(self) -> frozenset[str]:
        """Names of lengths and frames whose misfit a cause explains."""
        return frozenset().union(*(cause.settles for cause in self.causes))

    @property
    def contested(self) -> tuple[Reading, ...]:
        """Left-out readings in whose place others, or other mistakes, may be wrong."""
        found = [one for rival in self.rivals for one in rival.instead_of]
        if self.possible:
            found += [one for one in self.left_out if one.kind in {"pixels", "lengths"}]
        return tuple(one for one in self.left_out if one in found)

    def is_contested(self, kind: str, name: str) -> bool:
        """Return whether another reading may be wrong in place of a left-out one."""
        return any((one.kind, one.name) == (kind, name) for one in self.contested)

    def list_explanations(self) -> tuple[tuple[Adjustment, float], ...]:
        """List all other explanations of the observations, and the probability of each.

        The question which minimum is right is independent of the question which mistake was made.
        """
        here = self.compared or self.adjustment
        rivals = (one.explanation for one in self.rivals if one.explanation is not None)
        minima = (*(explain(here, one) for one in self.alternatives), *rivals)
        return tuple(
            (one.adjustment, float(probability))
            for group in (minima, *self.explanations)
            for one, probability in zip(
                group, softmax([0.0, *(one.log_odds for one in group)])[1:], strict=True
            )
        )


def explain(here: Adjustment, other: Adjustment, prior_log_odds: float = 0.0) -> Explanation:
    """Compute the odds of another minimum: the likelihood ratio times the prior odds.

    Without the same observations the costs do not compare, and the ratio is taken as one.

    Parameters
    ----------
    here, other
        The result, and the other minimum, with the same sigmas.
    prior_log_odds
        Logarithm of the odds of the other one before the observations.
    """
    is_same = _count_residuals(here.minimum) == _count_residuals(other.minimum)
    ratio = 0.5 * (here.minimum.cost - other.minimum.cost) if is_same else 0.0
    return Explanation(other, ratio + prior_log_odds)


def _count_residuals(minimum: Minimum[State]) -> int:
    """Count the observed numbers that take part."""
    return sum(block.residual.size for block in minimum.blocks.values())


def compute_departures(adjustment: Adjustment) -> tuple[Floats, Floats]:
    """Compute the heights of the ground under all points over the plane of their area.

    Roughness and relief together: heights of the points over the plane, minus the stated heights.

    Returns
    -------
    departure_m, sigma_m : (K,)
        Both 0 where the ground is a plane.
    """
    layout, state, ground = adjustment.problem.layout, adjustment.state, adjustment.problem.ground
    if layout.point_size < 3 and not layout.relief:
        return np.zeros(layout.points), np.zeros(layout.points)
    label = np.arange(layout.points)
    relief = ground.at(np.zeros_like(state.plane), state.relief, label, state.point[:, :2])
    rough = np.zeros_like(state.point[:, 2:])
    rough[adjustment.problem.third.rough] = 1.0
    departure = relief.height_m + np.sum(rough * state.point[:, 2:], axis=1)
    unknowns = adjustment.problem.plane_columns(label)
    # Only relief and roughness count: the plane's own unknowns get no derivative.
    by_relief = np.where(unknowns >= layout.first_relief, relief.by_unknowns, 0.0)
    gradient = np.concatenate([relief.slope, rough, by_relief], axis=1)
    columns = np.concatenate([layout.point_columns(label), unknowns], axis=1)
    joint = adjustment.covariance.blocks(columns)
    # Error propagation: g^T C g for each point.
    variance = np.einsum("ni,nij,nj->n", gradient, joint, gradient, optimize=True)
    return departure, np.sqrt(np.maximum(variance, 0.0))


def compute_heights(adjustment: Adjustment) -> tuple[Floats, Floats]:
    """Compute the heights of all points over the smooth ground below, as stated or estimated.

    The ground right below a point may depart from the smooth one by its roughness, which the sigma
    of an estimated height contains.

    Returns
    -------
    height_m, sigma_m : (K,)
        Both 0 for points on the ground.
    """
    survey, problem = adjustment.survey, adjustment.problem
    height, sigma = compute_heights_at(adjustment, adjustment.state), np.zeros(len(survey.label))
    roughness = np.array([ground.roughness_sigma_m for ground in survey.grounds])[survey.area]
    own = np.union1d(problem.third.stated, problem.third.free)
    if len(own):
        column = problem.layout.point_columns(own)[:, 2:]
        variance = adjustment.covariance.blocks(column)[:, 0, 0]
        sigma[own] = np.sqrt(variance + roughness[own] ** 2)
    return height, sigma


def compute_heights_at(adjustment: Adjustment, state: State) -> Floats:
    """Return the (K,) heights over the smooth ground below, at a state of the unknowns."""
    height = np.array(adjustment.survey.height_above_m)
    own = np.union1d(adjustment.problem.third.stated, adjustment.problem.third.free)
    if len(own):
        height[own] += state.point[own, 2]
    return height
