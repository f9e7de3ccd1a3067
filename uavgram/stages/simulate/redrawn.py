"""Telemetry of a real flight as it might as well have been: other errors of the stated sizes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.geometry.motion.rotation import exp_so3
from uavgram.geometry.motion.telemetry_pose import (
    BORESIGHT,
    CLOCK,
    CLOCK_DRIFT,
    HEADING_BIAS,
    LEVER_ARM,
    POSITION_BIAS,
    SHARED_SIZE,
    UP,
    exposures_by_time,
    predict_pose,
)
from uavgram.model.arrays import Floats
from uavgram.model.flight.photo_poses import PhotoExposures
from uavgram.model.flight.telemetry import Telemetry


def redrawn(
    telemetry: Telemetry,
    truth: tuple[Floats, Floats],
    covariance: Floats,
    rng: np.random.Generator,
) -> Telemetry:
    """Telemetry of true poses, wrong as its prior says; each frame stands where it stands.

    What the clock did stays as it was: the frames' own errors have it in them.

    Parameters
    ----------
    telemetry
        Of the flight.
    truth
        (N, 3), (N, 3, 3) true poses of its frames.
    covariance
        (N, 6, 6) of the errors of each frame, as the adjustment takes them.
    rng
        Draws.
    """
    prior, poses = telemetry.prior, telemetry.poses
    center, rotation = truth
    nominal, sigma = np.zeros(SHARED_SIZE), np.zeros(SHARED_SIZE)
    nominal[LEVER_ARM] = prior.lever_arm_m
    sigma[BORESIGHT] = prior.boresight_sigma_rad
    sigma[LEVER_ARM] = prior.lever_arm_sigma_m
    sigma[POSITION_BIAS] = prior.position_bias_sigma_m
    sigma[HEADING_BIAS] = prior.heading_bias_sigma_rad
    shared = nominal + sigma * rng.standard_normal(SHARED_SIZE)
    shared[CLOCK] = shared[CLOCK_DRIFT] = 0.0
    own = np.einsum(
        "nij,nj->ni", np.linalg.cholesky(covariance), rng.standard_normal((len(center), 6))
    )
    stated = rotation @ exp_so3(own[:, 3:])
    there = exposures_by_time(telemetry.track, poses.frame_id)(prior.time_s)
    # stated = turn(heading) Rz mount exp(boresight), and Rb keeps its place to Rz.
    turn = exp_so3(shared[HEADING_BIAS] * UP)
    camera = prior.gimbal_from_camera @ exp_so3(shared[BORESIGHT])
    gimbal = np.swapaxes(turn, -1, -2) @ stated @ camera.T
    body = gimbal @ np.swapaxes(there.world_from_mount, 1, 2) @ there.world_from_body
    arm = turn @ body @ shared[LEVER_ARM]
    exposures = PhotoExposures(
        frame_id=poses.frame_id,
        position_world_m=center + own[:, :3] + shared[POSITION_BIAS] - arm,
        world_from_body=body,
        world_from_gimbal=gimbal,
        sigma_position_m=np.sqrt(np.einsum("nii->ni", covariance)[:, [0, 2]]),
        sigma_attitude_rad=np.sqrt(np.einsum("nii->ni", covariance)[:, [3, 5]]),
        by_course=np.zeros(len(center), dtype=np.bool_),
        source="a simulation",
    )
    now = exposures_by_time(exposures, poses.frame_id)(prior.time_s)
    seed_center, seed_rotation, _ = predict_pose(
        now, prior.gimbal_from_camera, nominal, prior.time_s - prior.middle_s
    )
    seeds = replace(poses, center_world_m=seed_center, world_from_camera=seed_rotation)
    return replace(telemetry, poses=seeds, track=exposures)
