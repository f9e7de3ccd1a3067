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
from uavgram.geometry.motion.row_poses import row_share
from uavgram.model.arrays import Bools, Floats
from uavgram.model.camera.calibration import Calibration
from uavgram.model.scenario.photo_rows import PhotoRows
from uavgram.model.scenario.scenario import Scenario
from uavgram.model.scenario.simulated import SurveyTruth
from uavgram.model.scenario.surface import Surface
from uavgram.model.survey.observations import MeasurementRequest
from uavgram.stages.simulate.motion import Motion, at
from uavgram.stages.simulate.quantities import measured_values
from uavgram.stages.simulate.recording import FlightBiases, start_utc_s

READ = 0.51  # of the readout, before and after the middle row
INSTANTS_S = 0.002  # between poses; turning by 2 rad/s, lines between them are 5e-7 rad off
ROUNDS = 3


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
    exposed = motion.exposure_time_s[stored]
    center, rotation = true_poses(motion, biases, exposed)
    row = {label: i for i, label in enumerate(scenario.labels)}
    ends = np.array([[row[line.start], row[line.end]] for line in scenario.lines], dtype=int)
    ends = ends.reshape(-1, 2)
    names, values, units = measured_values(requests, row, points)
    return SurveyTruth(
        frame_id=tuple(f"IMG_{i + 1:04d}.jpg" for i in range(len(center))),
        time_utc_s=start_utc_s(scenario) + exposed,
        center_world_m=center,
        world_from_camera=rotation,
        rows=_photo_rows(motion, biases, exposed, 1e-3 * scenario.errors.readout_ms),
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


def rolled_pixels(calibration: Calibration, truth: SurveyTruth, places_m: Floats) -> Floats:
    """Where places (F, K, 3) of each photo are seen, row after row, (F, K, 2) px.

    A row's time moves the pixel by far less than a row a row, so a few rounds come to rest.

    Parameters
    ----------
    calibration
        Whose lens model and size hold.
    truth
        Of the survey.
    places_m
        In the world.
    """
    offset = places_m - truth.center_world_m[:, None]
    in_camera = np.einsum("fij,fki->fkj", truth.world_from_camera, offset)
    pixel = project(calibration.model, truth.intrinsics, in_camera)
    if truth.rows is None:
        return pixel
    height = calibration.height_px
    frame = np.broadcast_to(np.arange(len(offset))[:, None], offset.shape[:2])
    for _ in range(ROUNDS):
        row = np.clip(np.nan_to_num(pixel[..., 1]), 0.0, height - 1.0)
        center, rotation = truth.rows.at(frame, row_share(row, height))
        seen = np.einsum("fkij,fki->fkj", rotation, places_m - center)
        pixel = project(calibration.model, truth.intrinsics, seen)
    return pixel


def _photo_rows(
    motion: Motion, biases: FlightBiases, exposed_s: Floats, readout_s: float
) -> PhotoRows | None:
    """Poses (F, R) all through the reading of each photo, a little longer on both sides."""
    if not readout_s:
        return None
    share = np.linspace(-READ, READ, 2 * int(np.ceil(READ * abs(readout_s) / INSTANTS_S)) + 1)
    instants = exposed_s[:, None] + readout_s * share
    center, rotation = true_poses(motion, biases, instants.ravel())
    return PhotoRows(
        share=share,
        center_world_m=center.reshape(*instants.shape, 3),
        world_from_camera=rotation.reshape(*instants.shape, 3, 3),
    )
