"""What the log says of each frame, and what is known of all that its frames share."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.unknowns import Layout, State
from uavgram.geometry.motion.rotation import log_so3, right_jacobian_inverse
from uavgram.geometry.motion.telemetry_pose import (
    BORESIGHT,
    CLOCK,
    CLOCK_DRIFT,
    HEADING_BIAS,
    LEVER_ARM,
    POSITION_BIAS,
    SHARED_SIZE,
    corrected_time,
    exposures_by_time,
    predict_pose,
)
from uavgram.model.arrays import Floats, Ints
from uavgram.model.flight.pose import TelemetryPrior
from uavgram.model.survey.survey import Survey

TELEMETRY_PARTS = {
    "boresight": BORESIGHT,
    "lever_arm": LEVER_ARM,
    "position_bias": POSITION_BIAS,
    "heading_bias": HEADING_BIAS,
    "clock": CLOCK,
    "clock_drift": CLOCK_DRIFT,
}


class TelemetryTerms:
    """Residuals of frames against the log, and of the shared unknowns against their priors.

    Parameters
    ----------
    survey
        With telemetry.
    layout
        Where each unknown stands.
    """

    def __init__(self, survey: Survey, layout: Layout) -> None:
        assert survey.telemetry is not None  # noqa: S101  (the caller asked)
        assert survey.track is not None  # noqa: S101
        self._prior, self._layout = survey.telemetry, layout
        self._mean, self._sigma = telemetry_prior(survey.telemetry)
        names = [survey.frame_id[i] for i in survey.telemetry.frame_index]
        self._exposures = exposures_by_time(survey.track, names)

    def blocks(self, state: State, white: Floats) -> dict[str, Block]:
        """Residuals and derivatives by group.

        Parameters
        ----------
        state
            Values of the unknowns.
        white
            (N, 6, 6) what makes residuals of the frames' poses independent, of unit variance.

        Raises
        ------
        ValueError
            The clock's correction leads out of the log.
        """
        prior, layout = self._prior, self._layout
        at_s = corrected_time(state.telemetry, prior.time_s, prior.middle_s)
        center, rotation, d_shared = predict_pose(
            self._exposures(at_s),
            prior.gimbal_from_camera,
            state.telemetry,
            prior.time_s - prior.middle_s,
        )
        frame = prior.frame_index
        turn = log_so3(np.swapaxes(rotation, -1, -2) @ state.rotation[..., frame, :, :])
        residual = np.concatenate([state.center[..., frame, :] - center, turn], axis=-1)
        # turn = log(P^T R): by R exp(a) it moves by Jr^-1(turn) a, by P exp(b) by -Jr^-1(-turn) b
        # (Sola et al. 2018, eq. 68 to 70); Jr^-1(-turn) is the transpose of Jr^-1(turn).
        by_turn = right_jacobian_inverse(turn)
        jacobian = np.zeros((*turn.shape[:-1], 6, 6 + layout.telemetry))
        jacobian[..., :3, :3] = np.eye(3)
        jacobian[..., 3:, 3:6] = by_turn
        jacobian[..., :3, 6:] = -d_shared[..., :3, :]
        jacobian[..., 3:, 6:] = -by_turn.swapaxes(-1, -2) @ d_shared[..., 3:, :]
        whitened = (white @ residual[..., None])[..., 0]
        blocks = {"telemetry": Block(whitened, self._columns, white @ jacobian)}
        off = ((state.telemetry - self._mean) / self._sigma)[..., None]
        for name, part in TELEMETRY_PARTS.items():
            blocks[name] = Block(off[..., part, :], *self._priors[name])
        return blocks

    @cached_property
    def _priors(self) -> dict[str, tuple[Ints, Floats]]:
        """Unknowns and derivatives of what is known of each part."""
        own = self._layout.first_telemetry + np.arange(SHARED_SIZE)[:, None]
        weight = (1.0 / self._sigma)[:, None, None]
        return {name: (own[part], weight[part]) for name, part in TELEMETRY_PARTS.items()}

    @cached_property
    def _columns(self) -> Ints:
        layout, frame = self._layout, self._prior.frame_index
        shared = layout.shared_columns(layout.first_telemetry, layout.telemetry, len(frame))
        return np.concatenate([layout.frame_columns(frame), shared], axis=1)


def telemetry_prior(prior: TelemetryPrior) -> tuple[Floats, Floats]:
    """Mean and sigma (12,) of the telemetry's shared unknowns."""
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
