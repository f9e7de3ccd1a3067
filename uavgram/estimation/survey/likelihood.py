"""The one likelihood: every observation of a survey as whitened residuals with Jacobians.

Residuals are predicted minus observed, over the observation's standard deviation. Each prior
enters once: the telemetry of a frame against what the shared unknowns (boresight, lever arm,
biases, clock) predict for it, and each shared unknown against its own prior.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.ground_planes import GroundPlanes
from uavgram.estimation.survey.tapes import Taped, tape_rows, taped_lines, tapes_of
from uavgram.estimation.survey.unknowns import Layout, State, layout_of
from uavgram.geometry.camera.projection import project_with_jacobian
from uavgram.geometry.motion.rotation import exp_so3, hat, log_so3, right_jacobian_inverse
from uavgram.geometry.motion.row_poses import row_share
from uavgram.geometry.motion.telemetry_pose import (
    BORESIGHT,
    CLOCK,
    CLOCK_DRIFT,
    HEADING_BIAS,
    LEVER_ARM,
    POSITION_BIAS,
    SHARED_SIZE,
    Exposures,
    corrected_time,
    exposures_by_time,
    predict_pose,
)
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.camera.readout import Readout
from uavgram.model.survey.survey import Survey

GAUGE_SIGMA = np.array([1e-4, 1e-4, 1e-6])
"""Of the three conditions that fix a free gauge [m, m, rad]: they are met exactly at the minimum,
so their size moves no estimate; small enough to add nothing to a covariance."""

TELEMETRY_PARTS = {
    "boresight": BORESIGHT,
    "lever_arm": LEVER_ARM,
    "position_bias": POSITION_BIAS,
    "heading_bias": HEADING_BIAS,
    "clock": CLOCK,
    "clock_drift": CLOCK_DRIFT,
}


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
        self.line_index = np.flatnonzero(line_used)
        self.intrinsic_basis = covariance_root(survey.calibration.covariance)
        self.tapes = tapes_of(survey, self.line_index)
        self.layout: Layout = layout_of(survey, self.intrinsic_basis.shape[1], len(self.tapes))
        telemetry = survey.telemetry
        if telemetry is not None:
            self.telemetry_whitening = np.linalg.inv(np.linalg.cholesky(telemetry.covariance))
            self.telemetry_mean, self.telemetry_sigma = _shared_prior(survey)

    @property
    def pivot_m(self) -> Floats:
        """(A, 2) east and north of the point about which the slopes of each area turn."""
        return self.ground.pivot_m

    def intrinsics(self, state: State) -> Floats:
        """(P,) the interior orientation of a state."""
        return self.survey.calibration.parameters + self.intrinsic_basis @ state.intrinsic

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
        own = state.point[label]
        surface = self.ground.at(state.plane, state.relief, label, own[:, :2])
        up = surface.height_m + self.survey.height_above_m[label]
        d_point = np.zeros((len(label), 3, self.layout.point_size))
        d_point[:, 0, 0] = d_point[:, 1, 1] = 1.0
        d_point[:, 2, :2] = surface.slope
        if self.layout.point_size == 3:
            rough = self.ground.roughness_sigma_m[label] > 0
            up = up + np.where(rough, own[:, 2], 0.0)
            d_point[:, 2, 2] = rough
        d_plane = np.zeros((len(label), 3, surface.by_unknowns.shape[1]))
        d_plane[:, 2] = surface.by_unknowns
        world = np.empty((len(label), 3))
        world[:, :2], world[:, 2] = own[:, :2], up
        return world, d_point, d_plane

    def plane_columns(self, label: Ints) -> Ints:
        """(n, w) unknowns of the ground on which each of n labels lies."""
        return self.layout.first_plane + self.ground.columns(label)

    def evaluate(self, state: State) -> dict[str, Block] | None:
        """All whitened residuals by group.

        None where a picked point lies behind its camera, or the lens would have no focal length.
        """
        if self.intrinsics(state)[:2].min() <= 0:
            return None
        pixels = self._pixels(state)
        if pixels is None:
            return None
        blocks = {"pixels": pixels, "calibration": self._calibration(state)}
        if len(self.line_index):
            blocks["lengths"] = self._lengths(state)
        if self.tapes:
            sigma = self.survey.tape_scale_sigma
            weight = np.full(len(self.tapes), 1.0 / sigma)
            blocks["tape"] = _prior(state.tape / sigma, self.layout.first_tape, weight)
        if len(self.survey.control_label):
            blocks["control"] = self._control(state)
        blocks |= self._grounds(state)
        if self.survey.rolling is not None:
            blocks["readout"] = self._readout(state, self.survey.rolling.readout)
        if self.layout.free_gauge:
            blocks["gauge"] = self._gauge(state)
        if self.survey.telemetry is not None:
            try:
                blocks |= self._telemetry(state)
            except ValueError:  # the clock correction leads out of the log
                return None
        return blocks

    def _pixels(self, state: State) -> Block | None:
        survey = self.survey
        frame = survey.pick_frame
        world, d_point, d_plane = self.world_points(state, survey.pick_label)
        camera_from_world = np.swapaxes(state.rotation, 1, 2)[frame]
        from_center = world - state.center[frame]
        unturned = None
        if survey.rolling is not None:
            # The row's own pose: centre + a v, R exp(a w), with a the time since the middle row.
            motion = survey.rolling.motion[frame]
            share = row_share(survey.pixel_px[:, 1], survey.calibration.height_px)[:, None]
            moved = share * state.readout * motion
            from_center = from_center - moved[:, :3]
            unturned = exp_so3(-moved[:, 3:])
            in_middle = np.einsum("nij,nj->ni", camera_from_world, from_center)
            camera_from_world = unturned @ camera_from_world
        camera = np.einsum("nij,nj->ni", camera_from_world, from_center)
        pixel, d_camera, d_intrinsics = project_with_jacobian(
            survey.calibration.model, self.intrinsics(state), camera, beyond_fold="extend"
        )
        if not np.isfinite(pixel).all():
            return None
        weight = 1.0 / survey.pick_sigma_px
        d_world = d_camera @ camera_from_world
        by_turn = hat(camera) if unturned is None else unturned @ hat(in_middle)
        parts = [
            d_world @ d_point,
            -d_world,
            d_camera @ by_turn,
            d_intrinsics @ self.intrinsic_basis,
            d_world @ d_plane,
        ]
        if unturned is not None:
            # d/da of exp(-a w) R^T (X - centre - a v): camera x w - R_row^T v
            by_time = np.cross(camera, motion[:, 3:])
            by_time -= np.einsum("nij,nj->ni", camera_from_world, motion[:, :3])
            parts.append(d_camera @ (share * by_time)[..., None])
        jacobian = np.concatenate(parts, axis=2)
        residual = (pixel - survey.pixel_px) * weight[:, None]
        return Block(residual, self._pixel_columns, jacobian * weight[:, None, None])

    @cached_property
    def _pixel_columns(self) -> Ints:
        layout, frame, label = self.layout, self.survey.pick_frame, self.survey.pick_label
        return np.concatenate(
            [
                layout.point_columns(label),
                layout.frame_columns(frame),
                layout.shared_columns(layout.first_intrinsic, layout.intrinsics, len(frame)),
                self.plane_columns(label),
                layout.shared_columns(layout.first_readout, layout.readout, len(frame)),
            ],
            axis=1,
        )

    def _lengths(self, state: State) -> Block:
        survey = self.survey
        reading, jacobian, columns = self.readings(state, taped_lines(survey, self.line_index))
        sigma = survey.length_sigma_m[self.line_index]
        residual = (reading - survey.length_m[self.line_index]) / sigma
        return Block(residual[:, None], columns, jacobian[:, None, :] / sigma[:, None, None])

    def readings(self, state: State, taped: Taped) -> tuple[Floats, Floats, Ints]:
        """What tapes read (n,), the gradients (n, k), and the unknowns' columns (n, k).

        A tape that takes no part in the adjustment is read as a right one.
        """
        length, jacobian, columns = self.lengths_between(
            state, taped.start, taped.end, level=taped.level
        )
        if not self.tapes:
            return length, jacobian, columns
        row = tape_rows(self.tapes, taped.tape)
        there = row >= 0
        ratio = 1.0 / (1.0 + np.where(there, state.tape[row], 0.0))
        by_scale = np.where(there, -length * ratio**2, 0.0)
        return (
            length * ratio,
            np.concatenate([jacobian * ratio[:, None], by_scale[:, None]], axis=1),
            np.concatenate(
                [columns, (self.layout.first_tape + np.maximum(row, 0))[:, None]], axis=1
            ),
        )

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
        n = len(start)
        world, d_point, d_plane = self.world_points(state, np.concatenate([start, end]))
        along = world[n:] - world[:n]
        if level is not None:
            along[level, 2] = 0.0
        length = np.linalg.norm(along, axis=1)
        unit = (along / np.where(length > 0, length, 1.0)[:, None])[:, None]
        jacobian = np.concatenate(
            [-unit @ d_point[:n], unit @ d_point[n:], -unit @ d_plane[:n], unit @ d_plane[n:]],
            axis=2,
        )[:, 0]
        columns = np.concatenate(
            [
                self.layout.point_columns(start),
                self.layout.point_columns(end),
                self.plane_columns(start),
                self.plane_columns(end),
            ],
            axis=1,
        )
        return length, jacobian, columns

    def _control(self, state: State) -> Block:
        survey = self.survey
        label = survey.control_label
        world, d_point, d_plane = self.world_points(state, label)
        weight = 1.0 / survey.control_sigma_m
        columns = np.concatenate(
            [self.layout.point_columns(label), self.plane_columns(label)], axis=1
        )
        jacobian = np.concatenate([d_point, d_plane], axis=2)
        residual = (world - survey.control_world_m) * weight
        return Block(residual, columns, jacobian * weight[:, :, None])

    def _calibration(self, state: State) -> Block:
        return _prior(state.intrinsic, self.layout.first_intrinsic)

    def _roughness(self, state: State) -> Block:
        rough = self.ground.roughness_sigma_m > 0
        # On smooth ground beside rough one the departure is idle: it moves nothing and stays 0.
        sigma = np.where(rough, self.ground.roughness_sigma_m, 1.0)[:, None]
        columns = self.layout.point_columns(np.arange(self.layout.points))[:, 2:]
        return Block(state.point[:, 2:] / sigma, columns, 1.0 / sigma[:, :, None])

    def _grounds(self, state: State) -> dict[str, Block]:
        """Priors of all that makes up the ground."""
        blocks = {}
        if self.layout.point_size == 3:
            blocks["roughness"] = self._roughness(state)
        if self.layout.relief:
            blocks["relief"] = self._relief(state)
        return blocks | self._planes(state)

    def _readout(self, state: State, known: Readout) -> Block:
        scaled = (state.readout - known.value_s) / known.sigma_s
        return _prior(scaled, self.layout.first_readout, np.array([1.0 / known.sigma_s]))

    def _planes(self, state: State) -> dict[str, Block]:
        """Priors by area; the first area's has the name of old, ``plane``."""
        unknown = state.plane[len(state.plane) - self.layout.plane :]
        blocks = {}
        for prior in self.ground.priors():
            own = unknown[prior.first : prior.first + len(prior.mean)]
            name = "plane" if prior.area == self.survey.ground.name else f"plane of {prior.area}"
            blocks[name] = _prior(
                (own - prior.mean) / prior.sigma,
                self.layout.first_plane + prior.first,
                1.0 / prior.sigma,
            )
        return blocks

    def _relief(self, state: State) -> Block:
        sigma = self.ground.relief_sigma_m[:, None]
        columns = self.layout.first_relief + np.arange(self.layout.relief)
        return Block(state.relief[:, None] / sigma, columns[:, None], 1.0 / sigma[:, :, None])

    def _gauge(self, state: State) -> Block:
        """First frame above x = y = 0, its image up towards north.

        u = R (0, -1, 0) is image up in the world; u_east = 0. With R exp(δθ):
        δu = R (δθ x (0, -1, 0)), its east part row R_east . (δθ_z, 0, -δθ_x).
        """
        east = state.rotation[0, 0]
        residual = np.array([state.center[0, 0], state.center[0, 1], -east[1]])
        jacobian = np.zeros((3, 6))
        jacobian[0, 0] = jacobian[1, 1] = 1.0
        jacobian[2, 3], jacobian[2, 5] = -east[2], east[0]
        columns = self.layout.frame_columns(np.zeros(1, dtype=np.int64))
        whitened = (residual / GAUGE_SIGMA)[None]
        return Block(whitened, columns, (jacobian / GAUGE_SIGMA[:, None])[None])

    def _telemetry(self, state: State) -> dict[str, Block]:
        prior, layout = self.survey.telemetry, self.layout
        assert prior is not None  # noqa: S101  (the caller asked)
        at_s = corrected_time(state.telemetry, prior.time_s, prior.middle_s)
        center, rotation, d_shared = predict_pose(
            self._exposures(at_s),
            prior.gimbal_from_camera,
            state.telemetry,
            prior.time_s - prior.middle_s,
        )
        frame = prior.frame_index
        turn = log_so3(np.swapaxes(rotation, 1, 2) @ state.rotation[frame])
        residual = np.concatenate([state.center[frame] - center, turn], axis=1)
        # turn = log(P^T R): by R exp(a) it moves by Jr^-1(turn) a, by P exp(b) by -Jr^-1(-turn) b
        # (Sola et al. 2018, eq. 68 to 70); Jr^-1(-turn) is the transpose of Jr^-1(turn).
        by_turn = right_jacobian_inverse(turn)
        jacobian = np.zeros((len(frame), 6, 6 + layout.telemetry))
        jacobian[:, :3, :3] = np.eye(3)
        jacobian[:, 3:, 3:6] = by_turn
        jacobian[:, :3, 6:] = -d_shared[:, :3]
        jacobian[:, 3:, 6:] = -by_turn.swapaxes(1, 2) @ d_shared[:, 3:]
        white = self.telemetry_whitening
        whitened = (white @ residual[..., None])[..., 0]
        blocks = {"telemetry": Block(whitened, self._telemetry_columns, white @ jacobian)}
        scaled = (state.telemetry - self.telemetry_mean) / self.telemetry_sigma
        for name, part in TELEMETRY_PARTS.items():
            first = layout.first_telemetry + part.start
            blocks[name] = _prior(scaled[part], first, 1.0 / self.telemetry_sigma[part])
        return blocks

    @cached_property
    def _exposures(self) -> Callable[[Floats], Exposures]:
        """Where the flight has the frames, by their instants."""
        prior, track = self.survey.telemetry, self.survey.track
        assert prior is not None  # noqa: S101  (the caller asked)
        assert track is not None  # noqa: S101
        return exposures_by_time(track, [self.survey.frame_id[i] for i in prior.frame_index])

    @cached_property
    def _telemetry_columns(self) -> Ints:
        prior, layout = self.survey.telemetry, self.layout
        assert prior is not None  # noqa: S101  (the caller asked)
        frame = prior.frame_index
        shared = layout.shared_columns(layout.first_telemetry, layout.telemetry, len(frame))
        return np.concatenate([layout.frame_columns(frame), shared], axis=1)


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


def _prior(scaled: Floats, first: int, weight: Floats | None = None) -> Block:
    """Block of independent priors on neighbouring unknowns, residuals already in sigmas."""
    n = len(scaled)
    columns = (first + np.arange(n))[:, None]
    weight = np.ones(n) if weight is None else weight
    return Block(scaled[:, None], columns, weight[:, None, None])


def _shared_prior(survey: Survey) -> tuple[Floats, Floats]:
    """Mean and sigma (12,) of the telemetry's shared unknowns."""
    prior = survey.telemetry
    assert prior is not None  # noqa: S101  (the caller asked)
    mean = np.zeros(SHARED_SIZE)
    mean[LEVER_ARM] = prior.lever_arm_m
    sigma = np.empty(SHARED_SIZE)
    sigma[BORESIGHT] = prior.boresight_sigma_rad
    sigma[LEVER_ARM] = prior.lever_arm_sigma_m
    sigma[POSITION_BIAS] = prior.position_bias_sigma_m
    sigma[HEADING_BIAS] = prior.heading_bias_sigma_rad
    sigma[CLOCK] = prior.clock_sigma_s
    sigma[CLOCK_DRIFT] = prior.clock_drift_sigma
    return mean, sigma
