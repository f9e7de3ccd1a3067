"""The one likelihood: every observation of a survey as whitened residuals with Jacobians.

Residuals are predicted minus observed, over the observation's standard deviation. Each prior
enters once: the telemetry of a frame against what the shared unknowns (boresight, lever arm,
biases, clock) predict for it, and each shared unknown against its own prior.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.ground_planes import GroundPlanes
from uavgram.estimation.survey.terms.identification import PickedPoints
from uavgram.estimation.survey.terms.known_terms import known_rows, says_something, things_of_rows
from uavgram.estimation.survey.terms.priors import independent_prior
from uavgram.estimation.survey.terms.sightings import (
    Seen,
    TiedPoints,
    rows_of_sightings,
    seen,
)
from uavgram.estimation.survey.terms.tapes import Taped, tape_rows, taped_lines, tapes_of
from uavgram.estimation.survey.terms.telemetry_terms import TelemetryTerms, telemetry_prior
from uavgram.estimation.survey.terms.third_coordinate import ThirdCoordinate
from uavgram.estimation.survey.unknowns import Layout, State, layout_of, unstacked
from uavgram.geometry.lengths import lengths_of
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey.survey import Survey

GAUGE_SIGMA = np.array([1e-4, 1e-4, 1e-6])
"""Of the three conditions that fix a free gauge [m, m, rad]: they are met exactly at the minimum,
so their size moves no estimate; small enough to add nothing to a covariance."""


class SurveyProblem:
    """Residuals and Jacobians of a survey.

    Parameters
    ----------
    survey
        The observations.
    pivot_m
        (A, 2), or (2,) for all areas: east and north of where the slopes of each area's plane
        turn, the centroids of its points.
    line_used
        (L,) which lengths are observations.
    """

    def __init__(self, survey: Survey, pivot_m: Floats, line_used: Bools) -> None:
        self.survey = survey
        self.ground = GroundPlanes(survey, pivot_m)
        self.third = ThirdCoordinate.of(survey)
        self.line_index = np.flatnonzero(line_used)
        self.known = tuple(thing for thing in survey.known if says_something(survey, thing))
        self.intrinsic_basis = covariance_root(survey.calibration.covariance)
        self.tapes = tapes_of(survey, self.line_index)
        point_size = 3 if self.third.is_unknown or survey.ties.points else 2
        intrinsics = self.intrinsic_basis.shape[1]
        self.layout: Layout = layout_of(survey, point_size, intrinsics, len(self.tapes))
        telemetry = survey.telemetry
        if telemetry is not None:
            self.telemetry_whitening = np.linalg.inv(np.linalg.cholesky(telemetry.covariance))
            self.telemetry_mean, self.telemetry_sigma = telemetry_prior(telemetry)
            self._telemetry = TelemetryTerms(survey, self.layout)

    @property
    def pivot_m(self) -> Floats:
        """(A, 2) east and north of the point about which the slopes of each area turn."""
        return self.ground.pivot_m

    def intrinsics(self, state: State) -> Floats:
        """(..., P) the interior orientation of a state."""
        return self.survey.calibration.parameters + state.intrinsic @ self.intrinsic_basis.T

    def world_points(self, state: State, label: Ints) -> tuple[Floats, Floats, Floats]:
        """World coordinates (n, 3) of labels, and their Jacobians.

        Returns
        -------
        point_world : (n, 3)
        d_point : (n, 3, point_size)
            By the point's own unknowns.
        d_plane : (n, 3, w)
            By the plane and the relief of its area, the unknowns `plane_columns`.
        """
        return self.placed(state, state.point[..., label, :], label)

    def placed(self, state: State, own: Floats, label: Ints) -> tuple[Floats, Floats, Floats]:
        """World coordinates of points by their own unknowns, as `world_points` of labels.

        Parameters
        ----------
        state
            Values of what all points share.
        own
            (n, point_size) unknowns of each point.
        label
            (n,) the label in whose area, and at whose height above the ground, it lies.
        """
        world, d_point, d_plane = self._on_ground(state, own, label)
        world[..., 2] += self.survey.height_above_m[label]
        if self.layout.point_size == 3:
            departs = self.third.departs[label]
            world[..., 2] += np.where(departs, own[..., 2], 0.0)
            d_point[..., 2, 2] = departs
        return world, d_point, d_plane

    def ground_points(self, state: State, label: Ints) -> tuple[Floats, Floats, Floats]:
        """Places (n, 3) on the smooth ground straight below labels, and their Jacobians.

        Plane and relief, without what a point on rough ground departs from them. Shapes and
        unknowns are those of `world_points`.
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
        """(n, w) unknowns of the ground on which each of n labels lies."""
        return self.layout.first_plane + self.ground.columns(label)

    def evaluate(self, state: State) -> dict[str, Block] | None:
        """All whitened residuals by group.

        None where a picked point lies behind its camera, or the lens would have no focal length.
        Of many states at once, whose arrays have a leading axis, residuals have it too, and
        derivatives that differ from state to state; None where one of the states is impossible.
        """
        if self.intrinsics(state)[..., :2].min() <= 0:
            return None
        sighted = self._sighted(state)
        if sighted is None:
            return None
        blocks = sighted | {"calibration": self._calibration(state)} | self._stated(state)
        blocks |= self._grounds(state) | self._picked.blocks(state)
        if self.survey.rolling is not None:
            known, first = self.survey.rolling.readout, self.layout.first_readout
            off = state.readout - known.value_s
            blocks["readout"] = independent_prior(off, np.array([known.sigma_s]), first)
        if self.layout.turning:
            blocks["turning"] = self._turning(state)
        if self.layout.free_gauge:
            blocks["gauge"] = self._gauge(state)
        if self.survey.telemetry is not None:
            try:
                blocks |= self._telemetry.blocks(state, self.telemetry_whitening)
            except ValueError:  # the clock correction leads out of the log
                return None
        return blocks

    def _stated(self, state: State) -> dict[str, Block]:
        """What people measured on the scene itself."""
        blocks = {}
        if len(self.line_index):
            blocks["lengths"] = self._lengths(state)
        if self.tapes:
            blocks["tape"] = self._tape(state)
        if self.known:
            blocks["known"] = self._known(state)
        if len(self.survey.control_label):
            blocks["control"] = self._control(state)
        return blocks

    def _known(self, state: State) -> Block:
        if state.plane.ndim == 1:
            return known_rows(self, state, self.known).block()
        each = [known_rows(self, one, self.known).block() for one in unstacked(state)]
        residual, jacobian = np.stack([b.residual for b in each]), [b.jacobian for b in each]
        return Block(residual, each[0].columns, np.stack(jacobian))

    @cached_property
    def known_thing(self) -> Ints:
        """(R,) which of the known things that take part each row of their group is of."""
        return things_of_rows(self.survey, self.known)

    def _sighted(self, state: State) -> dict[str, Block] | None:
        """Rows of picks, matches and ties; None where a point is not in front of its camera."""
        pixels = self._pixels(state)
        tied = {} if self._tied is None else self._tied.blocks(state)
        return None if pixels is None or tied is None else {"pixels": pixels} | tied

    def _pixels(self, state: State) -> Block | None:
        every = np.concatenate([state.point, state.picked], axis=-2)
        own = every[..., self._pick_point, :]
        world, d_point, d_plane = self.placed(state, own, self.survey.pick_label)
        to_camera = (state.center[..., self.survey.pick_frame, :] - world)[..., self._from_above, :]
        slope = d_point[..., self._from_above, 2, :2]
        above = to_camera[..., 2] - np.sum(slope * to_camera[..., :2], axis=-1)
        if above.size and above.min() <= 0:  # the ground is not seen from below
            return None
        return rows_of_sightings(self, state, self._picks, (world, d_point, d_plane))

    @cached_property
    def _from_above(self) -> Ints:
        """Picks of points on the ground: what rises above it may be seen from below."""
        return np.flatnonzero(~self.survey.off_ground[self.survey.pick_label])

    @cached_property
    def _pick_point(self) -> Ints:
        """(P,) which point each pick shows: the label's own, or K + which of those picked."""
        survey, found = self.survey, self.survey.pick_label.copy()
        by_hand = np.isin(found, survey.identified) & ~survey.pick_is_target
        found[by_hand] = len(survey.label) + np.searchsorted(survey.identified, found[by_hand])
        return found

    @cached_property
    def _picks(self) -> Seen:
        survey, label = self.survey, self.survey.pick_label
        own = self.layout.point_columns(self._pick_point), self.plane_columns(label)
        return seen(self, own, survey.pick_frame, survey.pixel_px, survey.pick_sigma_px)

    @cached_property
    def _picked(self) -> PickedPoints:
        return PickedPoints(self)

    @cached_property
    def _tied(self) -> TiedPoints | None:
        return TiedPoints(self) if self.layout.ties else None

    def _lengths(self, state: State) -> Block:
        survey, (taped, columns) = self.survey, self._taped
        reading, jacobian = self._read(state, taped)
        sigma = survey.length_sigma_m[self.line_index]
        residual = (reading - survey.length_m[self.line_index]) / sigma
        return Block(residual[..., None], columns, jacobian[..., None, :] / sigma[:, None, None])

    @cached_property
    def _taped(self) -> tuple[Taped, Ints]:
        """The lengths that take part, and the unknowns of each."""
        taped = taped_lines(self.survey, self.line_index)
        return taped, self._columns_of(taped)

    def readings(self, state: State, taped: Taped) -> tuple[Floats, Floats, Ints]:
        """What tapes read (n,), the gradients (n, k), and the unknowns' columns (n, k).

        A tape that takes no part in the adjustment is read as a right one.
        """
        return *self._read(state, taped), self._columns_of(taped)

    def _read(self, state: State, taped: Taped) -> tuple[Floats, Floats]:
        """What tapes read (n,), and the gradients (n, k)."""
        length, jacobian = self._between(state, taped.start, taped.end, taped.level)
        if not self.tapes:
            return length, jacobian
        row = tape_rows(self.tapes, taped.tape)
        there = row >= 0
        ratio = 1.0 / (1.0 + np.where(there, state.tape[..., row], 0.0))
        by_scale = np.where(there, -length * ratio**2, 0.0)
        gradient = np.concatenate([jacobian * ratio[..., None], by_scale[..., None]], axis=-1)
        return length * ratio, gradient

    def _columns_of(self, taped: Taped) -> Ints:
        """(n, k) unknowns of what tapes read."""
        columns = self._end_columns(taped.start, taped.end)
        if not self.tapes:
            return columns
        row = np.maximum(tape_rows(self.tapes, taped.tape), 0)
        return np.concatenate([columns, (self.layout.first_tape + row)[:, None]], axis=1)

    def lengths_between(
        self, state: State, start: Ints, end: Ints, *, level: Bools | None = None
    ) -> tuple[Floats, Floats, Ints]:
        """True lengths (n,) between labels, their gradients (n, k) and the unknowns' columns.

        Parameters
        ----------
        state
            Values of the unknowns.
        start, end
            (n,) labels by index.
        level
            (n,) which are distances in the horizontal plane; left out, all are 3-D.
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

    def _control(self, state: State) -> Block:
        survey = self.survey
        label = survey.control_label
        world, d_point, d_plane = self.world_points(state, label)
        weight = 1.0 / survey.control_sigma_m
        columns = np.concatenate(
            [self.layout.point_columns(label), self.plane_columns(label)], axis=1
        )
        jacobian = np.concatenate([d_point, d_plane], axis=-1)
        residual = (world - survey.control_world_m) * weight
        return Block(residual, columns, jacobian * weight[:, :, None])

    def _calibration(self, state: State) -> Block:
        sigma = np.ones(self.layout.intrinsics)
        return independent_prior(state.intrinsic, sigma, self.layout.first_intrinsic)

    def _grounds(self, state: State) -> dict[str, Block]:
        """Priors of all that makes up the ground."""
        blocks: dict[str, Block] = {}
        if self.layout.point_size == 3:
            blocks |= self.third.priors(state.point[..., 2])
        if self.layout.relief:
            blocks["relief"] = self._relief(state)
        return blocks | self._planes(state)

    def _planes(self, state: State) -> dict[str, Block]:
        """Priors by area; the first area's has the name of old, ``plane``."""
        unknown = state.plane[..., state.plane.shape[-1] - self.layout.plane :]
        blocks = {}
        for prior in self.ground.priors():
            own = unknown[..., prior.first : prior.first + len(prior.mean)]
            name = "plane" if prior.area == self.survey.ground.name else f"plane of {prior.area}"
            first = self.layout.first_plane + prior.first
            blocks[name] = independent_prior(own - prior.mean, prior.sigma, first)
        return blocks

    def _turning(self, state: State) -> Block:
        columns = self.layout.turning_columns(np.arange(self.layout.frames))
        assert self.survey.rolling is not None  # noqa: S101  (else it is no unknown)
        rolling = self.survey.rolling
        readout = rolling.readout
        sigma = rolling.rate_sigma_rad_s * float(np.hypot(readout.value_s, readout.sigma_s))
        weight = np.broadcast_to(np.eye(3) / sigma, (len(columns), 3, 3))
        return Block(state.turning / sigma, columns, weight)

    def _tape(self, state: State) -> Block:
        sigma = np.array([self.survey.scale_sigma_of(tape) for tape in self.tapes])
        return independent_prior(state.tape, sigma, self.layout.first_tape)

    def _relief(self, state: State) -> Block:
        sigma = self.ground.relief_sigma_m
        return independent_prior(state.relief, sigma, self.layout.first_relief)

    def _gauge(self, state: State) -> Block:
        """First frame above x = y = 0, its image up towards north.

        u = R (0, -1, 0) is image up in the world; u_east = 0. With R exp(δθ):
        δu = R (δθ x (0, -1, 0)), its east part row R_east . (δθ_z, 0, -δθ_x).
        """
        east = state.rotation[..., 0, 0, :]
        residual = np.concatenate([state.center[..., 0, :2], -east[..., 1:2]], axis=-1)
        jacobian = np.zeros((*east.shape, 6))
        jacobian[..., 0, 0] = jacobian[..., 1, 1] = 1.0
        jacobian[..., 2, 3], jacobian[..., 2, 5] = -east[..., 2], east[..., 0]
        columns = self.layout.frame_columns(np.zeros(1, dtype=np.int64))
        whitened = (residual / GAUGE_SIGMA)[..., None, :]
        return Block(whitened, columns, (jacobian / GAUGE_SIGMA[:, None])[..., None, :, :])


def covariance_root(covariance: Floats) -> Floats:
    """(P, r) matrix L with L L^T = covariance; r leaves out what is known exactly.

    The eigenvalues are those of the correlation matrix, so that pixels and distortion
    coefficients weigh alike when the rank is decided.
    """
    sigma = np.sqrt(np.diag(covariance))
    scale = np.where(sigma > 0, sigma, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    kept = values > 1e-12
    return np.asarray(scale[:, None] * vectors[:, kept] * np.sqrt(values[kept]))
