"""Compute the pose of each frame at its exposure from the telemetry alone, with its covariance."""

from __future__ import annotations

import numpy as np

from uavgram.geometry.motion.camera_motion import (
    BORESIGHT,
    CLOCK,
    CLOCK_DRIFT,
    HEADING_BIAS,
    LEVER_ARM,
    POSITION_BIAS,
    SHARED_SIZE,
    exposures_by_time,
    predict_pose,
)
from uavgram.geometry.motion.rotation import GIMBAL_FROM_CAMERA, hat, matrix_from_ypr
from uavgram.model.arrays import Floats
from uavgram.model.frames import Flight, Frames, PhotoExposures, Poses, Telemetry, TelemetryPrior
from uavgram.model.options import MountOptions, TelemetryOptions
from uavgram.stages.seed.log_faults import Faults, find_unsure_s, free_priors

STEADY_CLOCK = 1e-9
"""Drift sigma of a flight's own instants: an unknown needs one, and no quartz is better."""


def seed(
    frames: Frames,
    flight: Flight,
    mount: MountOptions,
    telemetry: TelemetryOptions,
    faults: Faults = (),
) -> Telemetry:
    """Look up every matched frame in the flight and convert its exposure to a camera pose.

    Parameters
    ----------
    frames
        Frames; a matched one has an instant within the track, or a row in the photo exposures.
    flight
        A log's track, or the poses of the photos themselves.
    mount, telemetry
        Mount of the camera, and sigmas of the flight.
    faults
        Contradictions of the log with itself: affected frames get larger variances.

    Notes
    -----
    The covariance consists of the flight's sigmas, the frame's timing sigma times speed and angular
    rate, and, in the marginal, of the errors that all frames share: clock, boresight, lever arm,
    biases. An error of the attitude rotates the camera and moves it about the autopilot.
    """
    matched = np.flatnonzero(frames.matched)
    names = tuple(frames.frame_id[i] for i in matched)
    # Photo poses may have no time, and need none, as they have no speed.
    time_s = np.nan_to_num(frames.time_utc_s[matched], nan=0.0)
    sigma_time_s = np.nan_to_num(frames.sigma_time_s[matched], nan=0.0)
    exposures = exposures_by_time(flight, names)(time_s)
    gimbal = isinstance(flight, PhotoExposures) or len(flight.gimbal_time_s) > 0
    mount_from_camera = nominal_mount(mount, gimbal=gimbal)
    shared, shared_sigma = _make_shared_prior(frames, mount, telemetry)
    freed = free_priors(faults, time_s, find_unsure_s(frames))
    shared_sigma[POSITION_BIAS] = np.sqrt(shared_sigma[POSITION_BIAS] ** 2 + freed.position_bias)
    shared_sigma[HEADING_BIAS] = np.sqrt(shared_sigma[HEADING_BIAS] ** 2 + freed.heading_bias)
    middle_s = float(time_s.min() + time_s.max()) / 2.0 if len(time_s) else 0.0
    center, rotation, jacobian = predict_pose(
        exposures, mount_from_camera, shared, time_s - middle_s
    )
    arm_world_m = exposures.world_from_body @ shared[LEVER_ARM]
    position, attitude = _sigmas(flight, names, time_s)
    variances = (
        position[:, [0, 0, 1]] ** 2 + freed.position,
        attitude[:, [0, 0, 1]] ** 2 + freed.attitude,
    )
    own = _own_covariance(variances, rotation, arm_world_m, jacobian, sigma_time_s)
    marginal = own + np.einsum("nik,k,njk->nij", jacobian, shared_sigma**2, jacobian)
    prior = TelemetryPrior(
        frame_index=np.arange(len(matched)),
        time_s=time_s,
        middle_s=middle_s,
        gimbal_from_camera=mount_from_camera,
        covariance=own,
        clock_sigma_s=float(shared_sigma[CLOCK][0]),
        clock_drift_sigma=float(shared_sigma[CLOCK_DRIFT][0]),
        boresight_sigma_rad=float(shared_sigma[BORESIGHT][0]),
        heading_bias_sigma_rad=float(shared_sigma[HEADING_BIAS][0]),
        lever_arm_m=np.array(mount.lever_arm_m),
        lever_arm_sigma_m=mount.lever_arm_sigma_m,
        position_bias_sigma_m=shared_sigma[POSITION_BIAS],
        mount_is_assumed=not gimbal and mount.pitch_deg == "auto",
    )
    poses = Poses(
        frame_id=names,
        center_world_m=center,
        world_from_camera=rotation,
        covariance=marginal,
    )
    return Telemetry(poses=poses, prior=prior, track=flight, correlation_s=telemetry.correlation_s)


def nominal_mount(mount: MountOptions, *, gimbal: bool) -> Floats:
    """Return the camera axes (3, 3) in the frame of its carrier: the gimbal, or the body."""
    if gimbal:
        return np.array(GIMBAL_FROM_CAMERA)
    yaw, pitch, roll = np.deg2rad(mount.angles_deg())
    return np.asarray(matrix_from_ypr(yaw, pitch, roll) @ GIMBAL_FROM_CAMERA)


def _make_shared_prior(
    frames: Frames, mount: MountOptions, telemetry: TelemetryOptions
) -> tuple[Floats, Floats]:
    """Return values and prior sigmas (12,) of the unknowns that all frames share."""
    shared, sigma = np.zeros(SHARED_SIZE), np.zeros(SHARED_SIZE)
    shared[LEVER_ARM] = mount.lever_arm_m
    horizontal, vertical = telemetry.position_bias_sigma_m
    sigma[BORESIGHT] = np.deg2rad(mount.boresight_sigma_deg)
    sigma[LEVER_ARM] = mount.lever_arm_sigma_m
    sigma[POSITION_BIAS] = [horizontal, horizontal, vertical]
    sigma[HEADING_BIAS] = np.deg2rad(telemetry.heading_bias_sigma_deg)
    sigma[CLOCK] = frames.clock_offset_sigma_s
    sigma[CLOCK_DRIFT] = max(frames.clock_drift_sigma, STEADY_CLOCK)
    return shared, sigma


def _sigmas(flight: Flight, names: tuple[str, ...], time_s: Floats) -> tuple[Floats, Floats]:
    """Return position (N, 2) and attitude (N, 2) sigmas of the frames."""
    if isinstance(flight, PhotoExposures):
        index = flight.rows_of(names)
        return flight.sigma_position_m[index], flight.sigma_attitude_rad[index]
    position = _interpolate_sigmas(flight.sigma_time_s, flight.sigma_position_m, time_s)
    return position, _interpolate_sigmas(flight.sigma_time_s, flight.sigma_attitude_rad, time_s)


def _own_covariance(
    variances: tuple[Floats, Floats],
    world_from_camera: Floats,
    arm_world_m: Floats,
    jacobian: Floats,
    sigma_time_s: Floats,
) -> Floats:
    """Compute the covariance (N, 6, 6) of errors that are independent from frame to frame.

    Vehicle and gimbal take their attitude from one estimator: its error a about the world's axes
    rotates both, the camera by R^T a (in its own axes) and its position by a x arm.
    """
    # Roll and pitch tilt about horizontal axes, yaw turns about up: diagonal in the world.
    position, world = variances
    covariance = np.zeros((len(position), 6, 6))
    covariance[:, [0, 1, 2], [0, 1, 2]] = position
    by_attitude = np.concatenate([-hat(arm_world_m), np.swapaxes(world_from_camera, 1, 2)], axis=1)
    covariance += np.einsum("nik,nk,njk->nij", by_attitude, world, by_attitude)
    # A frame's own timing error moves it along its way and its turn, both at once.
    along = jacobian[:, :, CLOCK] * sigma_time_s[:, None, None]
    return np.asarray(covariance + along @ np.swapaxes(along, 1, 2))


def _interpolate_sigmas(time_s: Floats, value: Floats, at_s: Floats) -> Floats:
    """Interpolate sigmas (N, 2) linearly, constant beyond the ends."""
    return np.column_stack([np.interp(at_s, time_s, column) for column in value.T])
