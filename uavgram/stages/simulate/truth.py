"""The truth of a simulated survey: true camera poses, true points, true values."""

from __future__ import annotations

import numpy as np

from uavgram.geometry.camera.projection import project
from uavgram.geometry.motion.rotation import (
    ENU_FROM_NED,
    GIMBAL_FROM_CAMERA,
    exp_so3,
    matrix_from_ypr,
)
from uavgram.model.arrays import Bools, Floats
from uavgram.model.camera.calibration import Calibration
from uavgram.model.scenario.scenario import Scenario
from uavgram.model.scenario.simulated import SurveyTruth
from uavgram.model.scenario.surface import Surface
from uavgram.model.survey.observations import MeasurementRequest
from uavgram.stages.simulate.motion import Motion, at
from uavgram.stages.simulate.quantities import measured_values
from uavgram.stages.simulate.recording import FlightBiases, start_utc_s


def survey_truth(
    scenario: Scenario,
    requests: tuple[MeasurementRequest, ...],
    flown: tuple[Motion, FlightBiases],
    ground: tuple[Surface, Floats],
    intrinsics: Floats,
    stored: Bools,
) -> SurveyTruth:
    """What really was.

    Parameters
    ----------
    scenario
        What it is made of.
    requests
        What is measured, with true friction.
    flown
        The true flight, and what its log has wrong all through.
    ground
        The surface, and the points (K, 3) on it.
    intrinsics
        (P,) of the true camera.
    stored
        (E,) which exposures became photos.
    """
    (motion, biases), (surface, points) = flown, ground
    center, rotation = true_poses(motion, biases, motion.exposure_time_s[stored])
    row = {label: i for i, label in enumerate(scenario.labels)}
    ends = np.array([[row[line.start], row[line.end]] for line in scenario.lines], dtype=int)
    ends = ends.reshape(-1, 2)
    names, values, units = measured_values(requests, row, points)
    return SurveyTruth(
        frame_id=tuple(f"IMG_{i + 1:04d}.jpg" for i in range(len(center))),
        time_utc_s=start_utc_s(scenario) + motion.exposure_time_s[stored],
        center_world_m=center,
        world_from_camera=rotation,
        intrinsics=intrinsics,
        boresight_rad=biases.boresight_rad,
        lever_arm_m=biases.lever_arm_m,
        position_bias_m=biases.position_m,
        heading_bias_rad=biases.heading_rad,
        clock_offset_s=scenario.errors.camera_clock_offset_s,
        surface=surface,
        label=tuple(row),
        point_world_m=points,
        line_length_m=np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1),
        measurement_name=names,
        measurement_value=values,
        measurement_unit=units,
    )


def true_poses(motion: Motion, biases: FlightBiases, instants_s: Floats) -> tuple[Floats, Floats]:
    """Projection centres (F, 3) and rotations (F, 3, 3) of the camera, as it really was.

    Parameters
    ----------
    motion, biases
        The true flight, and how the camera sits.
    instants_s
        (F,) from the start of the recording.
    """
    roll, pitch, yaw = at(motion, motion.body_rpy_rad, instants_s).T
    world_from_body = ENU_FROM_NED @ matrix_from_ypr(yaw, pitch, roll)
    gimbal_roll, gimbal_pitch, gimbal_yaw = at(motion, motion.gimbal_rpy_rad, instants_s).T
    world_from_gimbal = ENU_FROM_NED @ matrix_from_ypr(yaw + gimbal_yaw, gimbal_pitch, gimbal_roll)
    position = at(motion, motion.position_world_m, instants_s)
    center = position + world_from_body @ biases.lever_arm_m
    return center, world_from_gimbal @ GIMBAL_FROM_CAMERA @ exp_so3(biases.boresight_rad)


def true_pixels(truth: SurveyTruth, model: Calibration | None = None) -> Floats:
    """Where each point lies in each photo whose rows are exposed at once, (F, K, 2) px.

    NaN behind the camera. `model` says of which lens the intrinsics are, a Brown one by default.
    """
    offset = truth.point_world_m[None] - truth.center_world_m[:, None]
    in_camera = np.einsum("fij,fki->fkj", truth.world_from_camera, offset)
    return project("brown" if model is None else model.model, truth.intrinsics, in_camera)


def rolled_pixels(
    calibration: Calibration,
    truth: SurveyTruth,
    flown: tuple[Motion, FlightBiases, Bools],
    places_m: Floats,
    readout_s: float,
) -> Floats:
    """Where places (F, K, 3) of each photo are seen, row after row, (F, K, 2) px.

    Row v of a photo of height h is exposed at time + readout (v - (h - 1) / 2) / h. A row's time
    moves the pixel by far less than a row a row, so a few rounds come to rest.

    Parameters
    ----------
    calibration
        Whose lens model and size hold.
    truth, flown
        Of the survey; (E,) which exposures became photos.
    places_m
        In the world.
    readout_s
        From the first row to the last.
    """
    offset = places_m - truth.center_world_m[:, None]
    in_camera = np.einsum("fij,fki->fkj", truth.world_from_camera, offset)
    pixel = project(calibration.model, truth.intrinsics, in_camera)
    if not readout_s:
        return pixel
    motion, biases, stored = flown
    exposed = motion.exposure_time_s[stored]
    height = calibration.height_px
    for _ in range(3):
        row = np.clip(np.nan_to_num(pixel[..., 1]), 0.0, height - 1.0)
        instants = exposed[:, None] + readout_s * (row - (height - 1) / 2) / height
        center, rotation = true_poses(motion, biases, instants.ravel())
        away = places_m.reshape(-1, 3) - center
        seen = np.einsum("nij,ni->nj", rotation, away).reshape(places_m.shape)
        pixel = project(calibration.model, truth.intrinsics, seen)
    return pixel
