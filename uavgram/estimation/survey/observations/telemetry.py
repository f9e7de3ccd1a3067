"""Poses of frames by the flight log, their correlated errors, and priors that all frames share."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.observations.observation import (
    ErrorSource,
    Kind,
    Member,
    Misfit,
    Observation,
    Subjects,
)
from uavgram.estimation.survey.observations.priors import Prior, make_independent_prior
from uavgram.estimation.survey.observed import Observations, SimulatedTruth
from uavgram.estimation.survey.unknowns import State
from uavgram.geometry.motion.camera_motion import (
    BORESIGHT,
    CLOCK,
    CLOCK_DRIFT,
    HEADING_BIAS,
    LEVER_ARM,
    POSITION_BIAS,
    SHARED_SIZE,
    UP,
    Exposures,
    correct_time,
    exposures_by_time,
    predict_pose,
)
from uavgram.geometry.motion.rotation import exp_so3, log_so3, right_jacobian_inverse
from uavgram.model.arrays import Floats, Ints
from uavgram.model.frames import PhotoExposures, TelemetryPrior
from uavgram.model.message import Remedy, propose_photo_removal
from uavgram.model.naming import format_misfit

FLIGHT_LOG = ErrorSource(
    "flight log",
    "position, attitude and time of the photos in the flight log",
    "More known lengths or control points would help there.",
)


class Telemetry(Observation):
    """Poses of frames by the log; errors that they share are unknowns with priors of their own."""

    kind = Kind(
        "telemetry",
        FLIGHT_LOG,
        "flight log: position and attitude of each photo",
        axes=("east", "north", "up", "image x axis", "image y axis", "optical axis"),
        units=("m",) * 3 + ("deg",) * 3,
        plural="positions and directions of the log",
        check="the gimbal, the times and their stated errors",
        misfit_code="telemetry-strained",
        advice="Look at their picks, their times and the gimbal.",
        is_whole=True,
    )

    def is_part(self) -> bool:
        """Return whether there is a log."""
        return self.problem.survey.telemetry is not None

    @classmethod
    def draw(cls, stated: Observations, truth: SimulatedTruth) -> Observations:
        """Draw the log of the true poses with errors by its priors; times stay as they were.

        The errors of the clock are part of the errors of the frames already.
        """
        telemetry, frames = stated.telemetry, truth.problem.survey.telemetry
        if telemetry is None or frames is None:
            return stated
        prior, poses, covariance = telemetry.prior, telemetry.poses, frames.covariance
        center, rotation = truth.state.center, truth.state.rotation
        nominal = np.zeros(SHARED_SIZE)
        nominal[LEVER_ARM] = prior.lever_arm_m
        sigma = np.zeros(SHARED_SIZE)
        sigma[BORESIGHT] = prior.boresight_sigma_rad
        sigma[LEVER_ARM] = prior.lever_arm_sigma_m
        sigma[POSITION_BIAS] = prior.position_bias_sigma_m
        sigma[HEADING_BIAS] = prior.heading_bias_sigma_rad
        shared = nominal + sigma * truth.rng.standard_normal(SHARED_SIZE)
        shared[CLOCK] = shared[CLOCK_DRIFT] = 0.0
        # Independent errors of each frame: the Cholesky root of its covariance times unit normals.
        root = np.linalg.cholesky(covariance)
        own = np.einsum("nij,nj->ni", root, truth.rng.standard_normal((len(center), 6)))
        logged = rotation @ exp_so3(own[:, 3:])
        there = exposures_by_time(telemetry.track, poses.frame_id)(prior.time_s)
        # Invert the model: logged = turn(heading) Rz mount exp(boresight), and Rb keeps its
        # attitude relative to Rz.
        turn = exp_so3(shared[HEADING_BIAS] * UP)
        camera = prior.gimbal_from_camera @ exp_so3(shared[BORESIGHT])
        gimbal = np.swapaxes(turn, -1, -2) @ logged @ camera.T
        body = gimbal @ np.swapaxes(there.world_from_mount, 1, 2) @ there.world_from_body
        arm = turn @ body @ shared[LEVER_ARM]
        sizes = np.sqrt(np.einsum("nii->ni", covariance))
        exposures = PhotoExposures(
            frame_id=poses.frame_id,
            position_world_m=center + own[:, :3] + shared[POSITION_BIAS] - arm,
            world_from_body=body,
            world_from_gimbal=gimbal,
            sigma_position_m=sizes[:, [0, 2]],
            sigma_attitude_rad=sizes[:, [3, 5]],
            by_mount=np.zeros(len(center), dtype=np.bool_),
            source="a simulation",
        )
        now = exposures_by_time(exposures, poses.frame_id)(prior.time_s)
        seed_center, seed_rotation, _ = predict_pose(
            now, prior.gimbal_from_camera, nominal, prior.time_s - prior.middle_s
        )
        seeds = replace(poses, center_world_m=seed_center, world_from_camera=seed_rotation)
        again = replace(telemetry, poses=seeds, track=exposures)
        return replace(stated, telemetry=again)

    @property
    def _prior(self) -> TelemetryPrior:
        assert self.problem.survey.telemetry is not None  # noqa: S101  (see `is_part`)
        return self.problem.survey.telemetry

    @cached_property
    def _exposures(self) -> Callable[[Floats], Exposures]:
        survey = self.problem.survey
        assert survey.track is not None  # noqa: S101  (there is one wherever there is a prior)
        return exposures_by_time(
            survey.track, [survey.frame_id[i] for i in self._prior.frame_index]
        )

    def rows(self, state: State) -> Block | None:
        """Compare the poses with the predicted ones; None if the corrected time leaves the log."""
        prior, layout = self._prior, self.problem.layout
        at_s = correct_time(state.telemetry, prior.time_s, prior.middle_s)
        try:
            exposures = self._exposures(at_s)
        except ValueError:
            return None
        center, rotation, d_shared = predict_pose(
            exposures,
            prior.gimbal_from_camera,
            state.telemetry,
            prior.time_s - prior.middle_s,
        )
        frame = prior.frame_index
        turn = log_so3(np.swapaxes(rotation, -1, -2) @ state.rotation[..., frame, :, :])
        residual = np.concatenate([state.center[..., frame, :] - center, turn], axis=-1)
        # turn = log(P^T R): with R exp(a) it changes by Jr^-1(turn) a, with P exp(b) by
        # -Jr^-1(-turn) b (Sola et al. 2018, eq. 68 to 70); Jr^-1(-turn) is the transpose of
        # Jr^-1(turn).
        by_turn = right_jacobian_inverse(turn)
        jacobian = np.zeros((*turn.shape[:-1], 6, 6 + layout.telemetry))
        jacobian[..., :3, :3] = np.eye(3)
        jacobian[..., 3:, 3:6] = by_turn
        jacobian[..., :3, 6:] = -d_shared[..., :3, :]
        jacobian[..., 3:, 6:] = -by_turn.swapaxes(-1, -2) @ d_shared[..., 3:, :]
        white = self.problem.telemetry_whitening
        return Block((white @ residual[..., None])[..., 0], self._columns, white @ jacobian)

    @cached_property
    def _columns(self) -> Ints:
        layout, frame = self.problem.layout, self._prior.frame_index
        shared = layout.shared_columns(layout.first_telemetry, layout.telemetry, len(frame))
        return np.concatenate([layout.frame_columns(frame), shared], axis=1)

    def whitening(self) -> Floats | None:
        """Return the (N, 6, 6) whitening matrices of the poses."""
        return np.asarray(self.problem.telemetry_whitening, dtype=np.float64)

    def frame(self, row: int) -> str:
        """Return the name of the frame of a row."""
        return str(self.problem.survey.frame_id[self._prior.frame_index[row]])

    def title(self, member: Member) -> str:
        """Return ``position of 'img1.jpg' by the log (east)`` and the like."""
        what = "position" if self.kind.units[member.axis] == "m" else "direction"
        axis = self.kind.axes[member.axis]
        return f"{what} of {self.frame(member.row)!r} by {self.source} ({axis})"

    @property
    def source(self) -> str:
        """Source of the poses, for a sentence."""
        is_photo = isinstance(self.problem.survey.track, PhotoExposures)
        return "the tags of the photos" if is_photo else "the log"

    def subjects(self, row: int) -> Subjects:
        """Return its frame."""
        return {"frames": (self.frame(row),)}

    def witness(self) -> Iterator[str]:
        """Yield the source of evidence for the scale."""
        is_photo = isinstance(self.problem.survey.track, PhotoExposures)
        yield "the photos' own positions" if is_photo else "the log"

    def several(self) -> str:
        """Return the opening of a message on several poses."""
        return f"{{count}} photos are not where they are by {self.source}"

    def remedy(self, row: int) -> Remedy | None:
        """Return the removal of the photo."""
        return propose_photo_removal(self.frame(row))

    def misfit(self, found: Misfit) -> tuple[str, str]:
        """Describe a pose that does not fit."""
        frame = self.frame(found.member.row)
        how = f"{self.kind.axes[found.member.axis]}, {format_misfit(found.w)}"
        return (
            f"Photo {frame!r} is not where it is by {self.source}: {how}. Check its picks, its "
            "time and how the camera hung (`mount`).",
            f"{frame!r} ({how})",
        )


TELEMETRY_PARTS = {
    "boresight": BORESIGHT,
    "lever_arm": LEVER_ARM,
    "position_bias": POSITION_BIAS,
    "heading_bias": HEADING_BIAS,
    "clock": CLOCK,
    "clock_drift": CLOCK_DRIFT,
}
"""Slice of each of these among the unknowns that all frames of a log share."""


def _make_shared_kind(name: str, words: str, unit: str, axes: str, ways: str = "") -> Kind:
    every = tuple(f"{axes} {way}" for way in ways.split()) or (axes,)
    return Kind(name, FLIGHT_LOG, words, axes=every, units=(unit,) * len(every))


class FlightPrior(Prior):
    """Priors of the unknowns that all frames of a log share."""

    kinds: ClassVar[tuple[Kind, ...]] = (
        _make_shared_kind(
            "boresight", "direction of the camera in its mount", "deg", "boresight", "x y z"
        ),
        _make_shared_kind(
            "lever_arm", "place of the camera on the drone", "m", "lever arm", "forward right down"
        ),
        _make_shared_kind(
            "position_bias", "offset of the log's positions", "m", "position bias", "east north up"
        ),
        _make_shared_kind("heading_bias", "offset of the log's heading", "deg", "heading bias"),
        _make_shared_kind("clock", "offset of the camera's clock", "s", "clock offset"),
    )

    def is_part(self) -> bool:
        """Return whether there is a log."""
        return self.problem.survey.telemetry is not None

    def title(self, member: Member) -> str:
        """Return ``offset of the log's positions (up)`` and the like."""
        way = self.axis(member).rpartition(" ")[2]
        return self.kind.words + (f" ({way})" if len(self.kind.axes) > 1 else "")

    def rows(self, state: State) -> Block | None:
        """Compare the unknowns with their prior means."""
        problem, part = self.problem, TELEMETRY_PARTS[self.name]
        off = state.telemetry[..., part] - problem.telemetry_mean[part]
        first = problem.layout.first_telemetry + part.start
        return make_independent_prior(off, problem.telemetry_sigma[part], first)


STEADY_CHANGE = "something that changes steadily over the flight"


class ClockDriftPrior(FlightPrior):
    """Prior of the drift of the camera's clock.

    The drift is the one unknown that grows steadily over a flight: it absorbs every steady change,
    most often one of another cause. Therefore no message names the clock as the cause.
    """

    kinds = (_make_shared_kind("clock_drift", "drift of the camera clock", "ppm", "clock drift"),)

    def suspect(self, member: Member) -> str:
        """Return a name that does not mention the clock."""
        del member
        return STEADY_CHANGE

    def misfit(self, found: Misfit) -> tuple[str, str]:
        """Describe a misfit that grows over the flight."""
        return (
            "Something that changes steadily from the first photo to the last does not fit "
            f"({format_misfit(found.w)}). It may be positions of the log that jump or wander, a "
            "wrong scale of the lengths, ground that is no plane, or the times of the photos: "
            "look at "
            "these, and at the other messages.",
            f"{STEADY_CHANGE} ({format_misfit(found.w)})",
        )


def compute_telemetry_prior(prior: TelemetryPrior) -> tuple[Floats, Floats]:
    """Return mean and sigma (12,) of the telemetry's shared unknowns."""
    mean = np.zeros(SHARED_SIZE)
    mean[LEVER_ARM] = prior.lever_arm_m
    mean[HEADING_BIAS] = prior.heading_bias_rad
    sigma = np.empty(SHARED_SIZE)
    sigma[BORESIGHT] = prior.boresight_sigma_rad
    sigma[LEVER_ARM] = prior.lever_arm_sigma_m
    sigma[POSITION_BIAS] = prior.position_bias_sigma_m
    sigma[HEADING_BIAS] = prior.heading_bias_sigma_rad
    sigma[CLOCK] = prior.clock_sigma_s
    sigma[CLOCK_DRIFT] = prior.clock_drift_sigma
    return mean, sigma


def compute_trend_inflation(time_s: Floats, shortest_s: float, longest_s: float) -> float:
    """Compute the factor of the variance by which independent errors represent correlated ones.

    The error that all instants have in common is a bias with an unknown of its own. The most
    harmful of the remaining errors is the slowest change, one period over the whole span T: at this
    frequency the errors of a first-order Gauss-Markov process, correlated over tau, have the
    spectral density of independent ones times

        (1 - rho^2) / (1 - 2 rho cos(w dt) + rho^2),   rho = exp(-dt / tau),   w = 2 pi / T

    (Box, Jenkins and Reinsel 1994, Time series analysis, eq. 3.2.15, over that of white noise). It
    is largest about tau = 1 / w; faster changes are overstated by the same factor.

    Parameters
    ----------
    time_s
        (N,) instants, in any order.
    shortest_s, longest_s
        Range of tau; the worst value within it is taken.

    Returns
    -------
    float
        At least 1; 1 for fewer than three instants, or if all are the same (or unknown).
    """
    span = float(np.ptp(time_s)) if len(time_s) > 2 else 0.0
    if span == 0.0:
        return 1.0
    interval = span / (len(time_s) - 1)
    frequency = 2.0 * np.pi / span
    # The worst correlation time, 1 / w, within its range.
    tau = float(np.clip(1.0 / frequency, shortest_s, longest_s))
    rho = float(np.exp(-interval / tau))
    density = (1.0 - rho**2) / (1.0 - 2.0 * rho * np.cos(frequency * interval) + rho**2)
    return max(1.0, float(density))
