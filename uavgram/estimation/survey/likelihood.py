"""The one likelihood: every observation of a survey as whitened residuals with Jacobians.

Residuals are predicted minus observed, over the observation's standard deviation. Each prior enters
once: the telemetry of a frame against its prediction from the shared unknowns (boresight, lever
arm, biases, clock), and each shared unknown against its own prior.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.ground_planes import GroundPlanes
from uavgram.estimation.survey.known_kinds import ALL_KINDS
from uavgram.estimation.survey.observations.ground import ThirdCoordinate
from uavgram.estimation.survey.observations.kinds import list_observations
from uavgram.estimation.survey.observations.known import find_things_of_rows
from uavgram.estimation.survey.observations.lengths import TapedLengths, find_tape_rows, list_tapes
from uavgram.estimation.survey.observations.telemetry import compute_telemetry_prior
from uavgram.estimation.survey.unknowns import Layout, State, make_layout
from uavgram.geometry.motion.rotation import lengths_of
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey import Survey


class SurveyProblem:
    """Residuals and Jacobians of a survey.

    Parameters
    ----------
    survey
        Observations.
    pivot_m
        (A, 2), or (2,) for all areas: east and north of the places about which the slopes of each
        area's plane turn, the centroids of its points.
    line_used
        (L,) mask of the lengths that are observations.
    """

    def __init__(self, survey: Survey, pivot_m: Floats, line_used: Bools) -> None:
        self.survey = survey
        self.ground = GroundPlanes(survey, pivot_m)
        self.third = ThirdCoordinate.of(survey)
        self.line_index = np.flatnonzero(line_used)
        self.known = tuple(t for t in survey.known if ALL_KINDS[t.kind].is_observation(survey, t))
        self.intrinsic_basis = compute_covariance_root(survey.calibration.covariance)
        self.tapes = list_tapes(survey, self.line_index)
        point_size = 3 if self.third.is_unknown or survey.ties.points else 2
        intrinsics = self.intrinsic_basis.shape[1]
        self.layout: Layout = make_layout(survey, point_size, intrinsics, len(self.tapes))
        telemetry = survey.telemetry
        if telemetry is not None:
            self.telemetry_whitening = np.linalg.inv(np.linalg.cholesky(telemetry.covariance))
            self.telemetry_mean, self.telemetry_sigma = compute_telemetry_prior(telemetry)
        self.observations = list_observations(self)

    @property
    def pivot_m(self) -> Floats:
        """(A, 2) east and north of the point about which the slopes of each area turn."""
        return self.ground.pivot_m

    def intrinsics(self, state: State) -> Floats:
        """Return the (..., P) interior orientation of a state."""
        stated = self.survey.calibration.parameters
        change = state.intrinsic @ self.intrinsic_basis.T
        if self.survey.calibration.is_unknown:
            change[..., :2] = stated[:2] * (self.focal_growth(state) - 1.0)
        return np.asarray(stated + change)

    def focal_growth(self, state: State) -> Floats:
        """Compute (..., 2) derivatives of the focal lengths by the linear unknowns.

        The logarithms of unknown focal lengths have a normal prior, so that none is near zero:
        photos that look straight down fit any ratio of focal length and height.
        """
        stated = self.survey.calibration.parameters[:2]
        change = state.intrinsic @ self.intrinsic_basis[:2].T
        if not self.survey.calibration.is_unknown:
            return np.ones_like(change)
        with np.errstate(over="ignore"):  # a step too far is refused
            return np.asarray(np.exp(change / stated))

    def intrinsic_root(self, state: State) -> Floats:
        """Return the (P, I) derivatives of the interior orientation by its unknowns."""
        root = self.intrinsic_basis.copy()
        root[:2] *= self.focal_growth(state)[:, None]
        return root

    def world_points(self, state: State, label: Ints) -> tuple[Floats, Floats, Floats]:
        """Compute world coordinates (n, 3) of labels, and their Jacobians.

        Returns
        -------
        point_world : (n, 3)
        d_point : (n, 3, point_size)
            By the point's own unknowns.
        d_plane : (n, 3, w)
            By the plane and the relief of its area, the unknowns `plane_columns`.
        """
        return self.place_points(state, state.point[..., label, :], label)

    def place_points(self, state: State, own: Floats, label: Ints) -> tuple[Floats, Floats, Floats]:
        """Compute world coordinates of points from their own unknowns, as `world_points` of labels.

        Parameters
        ----------
        state
            Values of the unknowns that all points share.
        own
            (n, point_size) unknowns of each point.
        label
            (n,) label that gives the area of each point, and its height above the ground.
        """
        world, d_point, d_plane = self._on_ground(state, own, label)
        # up = ground(east, north) + stated height + departure, if the point has one.
        world[..., 2] += self.survey.height_above_m[label]
        if self.layout.point_size == 3:
            departs = self.third.departs[label]
            world[..., 2] += np.where(departs, own[..., 2], 0.0)
            d_point[..., 2, 2] = departs
        return world, d_point, d_plane

    def ground_points(self, state: State, label: Ints) -> tuple[Floats, Floats, Floats]:
        """Compute places (n, 3) on the smooth ground straight below labels, and their Jacobians.

        Plane and relief, without the departure of points on rough ground. Shapes and unknowns are
        those of `world_points`.
        """
        return self._on_ground(state, state.point[..., label, :], label)

    def _on_ground(self, state: State, own: Floats, label: Ints) -> tuple[Floats, Floats, Floats]:
        surface = self.ground.at(state.plane, state.relief, label, own[..., :2])
        each = own.shape[:-1]
        d_point = np.zeros((*each, 3, self.layout.point_size))
        d_point[..., 0, 0] = d_point[..., 1, 1] = 1.0
        d_point[..., 2, :2] = surface.slope
        d_plane = np.zeros((*each, 3, surface.by_unknowns.shape[-1]))
        d_plane[..., 2, :] = surface.by_unknowns
        world = np.empty((*each, 3))
        world[..., :2], world[..., 2] = own[..., :2], surface.height_m
        return world, d_point, d_plane

    def plane_columns(self, label: Ints) -> Ints:
        """Return the (n, w) unknowns of the ground of n labels."""
        return self.layout.first_plane + self.ground.columns(label)

    def evaluate(self, state: State) -> dict[str, Block] | None:
        """Compute whitened residuals and derivatives of every kind of observation, by group.

        None if a picked point is behind its camera, or the lens would have no focal length. For
        many states at once, whose arrays have a leading axis, residuals have it too, and so do
        derivatives that differ from state to state; None if one of the states is impossible.
        """
        if self.intrinsics(state)[..., :2].min() <= 0:
            return None
        blocks = {}
        for name, observation in self.observations.items():
            block = observation.rows(state)
            if block is None:
                return None
            blocks[name] = block
        return blocks

    @cached_property
    def known_thing(self) -> Ints:
        """(R,) index of the known thing of each row of their group, among those that take part."""
        return find_things_of_rows(self.survey, self.known)

    def readings(self, state: State, taped: TapedLengths) -> tuple[Floats, Floats, Ints]:
        """Predict tape readings (n,), with gradients (n, k) and the unknowns' columns (n, k).

        A tape that takes no part in the adjustment is assumed to be correct.
        """
        return *self.read(state, taped), self.columns_of_readings(taped)

    def read(self, state: State, taped: TapedLengths) -> tuple[Floats, Floats]:
        """Predict tape readings (n,), with gradients (n, k)."""
        length, jacobian = self._between(state, taped.start, taped.end, taped.level)
        if not self.tapes:
            return length, jacobian
        row = find_tape_rows(self.tapes, taped.tape)
        there = row >= 0
        # reading = length / (1 + scale); its derivative by the scale is -length / (1 + scale)^2.
        ratio = 1.0 / (1.0 + np.where(there, state.tape[..., row], 0.0))
        by_scale = np.where(there, -length * ratio**2, 0.0)
        gradient = np.concatenate([jacobian * ratio[..., None], by_scale[..., None]], axis=-1)
        return length * ratio, gradient

    def columns_of_readings(self, taped: TapedLengths) -> Ints:
        """Return the (n, k) unknowns of tape readings."""
        columns = self._end_columns(taped.start, taped.end)
        if not self.tapes:
            return columns
        row = np.maximum(find_tape_rows(self.tapes, taped.tape), 0)
        return np.concatenate([columns, (self.layout.first_tape + row)[:, None]], axis=1)

    def lengths_between(
        self, state: State, start: Ints, end: Ints, *, level: Bools | None = None
    ) -> tuple[Floats, Floats, Ints]:
        """Compute true lengths (n,) between labels, gradients (n, k) and the unknowns' columns.

        Parameters
        ----------
        state
            Values of the unknowns.
        start, end
            (n,) labels by index.
        level
            (n,) mask of the distances in the horizontal plane; None: all are 3-D.
        """
        return *self._between(state, start, end, level), self._end_columns(start, end)

    def _between(
        self, state: State, start: Ints, end: Ints, level: Bools | None
    ) -> tuple[Floats, Floats]:
        n = len(start)
        world, d_point, d_plane = self.world_points(state, np.concatenate([start, end]))
        along = world[..., n:, :] - world[..., :n, :]
        if level is not None:
            along[..., level, 2] = 0.0
        length = lengths_of(along)
        # Gradient of a length: the unit vector along it, minus at the start and plus at the end.
        unit = (along / np.where(length > 0, length, 1.0)[..., None])[..., None, :]
        start_by, end_by = d_point[..., :n, :, :], d_point[..., n:, :, :]
        start_ground, end_ground = d_plane[..., :n, :, :], d_plane[..., n:, :, :]
        jacobian = np.concatenate(
            [-unit @ start_by, unit @ end_by, -unit @ start_ground, unit @ end_ground],
            axis=-1,
        )[..., 0, :]
        return length, jacobian

    def _end_columns(self, start: Ints, end: Ints) -> Ints:
        points = self.layout.point_columns(start), self.layout.point_columns(end)
        return np.concatenate([*points, self.plane_columns(start), self.plane_columns(end)], axis=1)


def compute_covariance_root(covariance: Floats) -> Floats:
    """Compute a (P, r) matrix L with L L^T = covariance; r leaves out exactly known parameters.

    The eigenvalues are those of the correlation matrix, so that pixels and distortion coefficients
    have equal weight when the rank is decided.
    """
    sigma = np.sqrt(np.diag(covariance))
    scale = np.where(sigma > 0, sigma, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    kept = values > 1e-12
    return np.asarray(scale[:, None] * vectors[:, kept] * np.sqrt(values[kept]))
