"""A whole simulated survey: true camera, true poses, and what people pick and tape of them."""

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
from uavgram.model.scenario.scenario import CameraSpec, Scenario
from uavgram.model.scenario.simulated import SimulatedLog, SimulatedSurvey, SurveyTruth
from uavgram.model.survey.observations import KnownLines, KnownPoints, MeasurementRequest, Picks
from uavgram.stages.simulate.motion import Motion, at, fly, scene_axes
from uavgram.stages.simulate.quantities import measured_values, with_true_friction
from uavgram.stages.simulate.recording import (
    FlightBiases,
    draw_biases,
    record,
    start_utc_s,
)

PICK_MARGIN_PX = 12.0  # nobody picks a mark that is cut off by the image's edge
FILE_STEP_S = 0.001  # three sub-second digits


def simulate(scenario: Scenario) -> SimulatedSurvey:
    """Simulate a survey: the same scenario gives the same survey.

    Parameters
    ----------
    scenario
        Every number that defines it, seed included.

    Returns
    -------
    What the survey's files will say, and the truth behind them.
    """
    # One stream for each kind of error: another number of points leaves the flight as it was.
    streams = [np.random.default_rng(s) for s in np.random.SeedSequence(scenario.seed).spawn(6)]
    motion_rng, bias_rng, log_rng, camera_rng, people_rng, road_rng = streams
    motion = fly(scenario.flight, scenario.site, motion_rng)
    biases = draw_biases(scenario.errors, bias_rng)
    log = record(scenario, motion, biases, log_rng)
    calibration = calibration_of(scenario.camera)
    intrinsics = camera_rng.multivariate_normal(calibration.parameters, calibration.covariance)
    stored = np.arange(len(motion.exposure_time_s)) != scenario.errors.lost_exposure
    requests = with_true_friction(scenario.measurements, road_rng)
    truth = _truth(scenario, requests, motion, biases, intrinsics, stored)
    return _observe(scenario, log, calibration, truth, stored, people_rng)


def calibration_of(camera: CameraSpec) -> Calibration:
    """Calibration as the survey's camera.yaml states it."""
    sigma = np.array(camera.sigma)
    correlation = np.eye(len(sigma))
    correlation[0, 1] = correlation[1, 0] = camera.focal_correlation
    return Calibration(
        name=camera.name,
        model="brown",
        width_px=camera.width_px,
        height_px=camera.height_px,
        parameters=np.array(camera.parameters),
        covariance=correlation * np.outer(sigma, sigma),
    )


def point_positions(scenario: Scenario) -> Floats:
    """World positions (K, 3) of the scenario's points, on the ground plane."""
    site = scenario.site
    xy = np.array([[point.x_m, point.y_m] for point in scenario.points])
    offset = xy @ scene_axes(site).T
    up = site.ground_height_m + offset @ np.tan(np.deg2rad(site.ground_slope_deg))
    middle = np.array([site.scene_east_m, site.scene_north_m])
    return np.column_stack([offset + middle, up])


def _truth(
    scenario: Scenario,
    requests: tuple[MeasurementRequest, ...],
    motion: Motion,
    biases: FlightBiases,
    intrinsics: Floats,
    stored: Bools,
) -> SurveyTruth:
    site = scenario.site
    center, rotation = _true_poses(motion, biases, motion.exposure_time_s[stored])
    points = point_positions(scenario)
    row = {point.label: i for i, point in enumerate(scenario.points)}
    ends = np.array([[row[line.start], row[line.end]] for line in scenario.lines], dtype=int)
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
        plane_height_m=site.ground_height_m,
        plane_slope=np.tan(np.deg2rad(site.ground_slope_deg)),
        plane_pivot_m=np.array([site.scene_east_m, site.scene_north_m]),
        label=tuple(row),
        point_world_m=points,
        line_length_m=np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1),
        measurement_name=names,
        measurement_value=values,
        measurement_unit=units,
    )


def _true_poses(motion: Motion, biases: FlightBiases, instants_s: Floats) -> tuple[Floats, Floats]:
    """Projection centres (F, 3) and rotations (F, 3, 3) of the camera, as it really was."""
    roll, pitch, yaw = at(motion, motion.body_rpy_rad, instants_s).T
    world_from_body = ENU_FROM_NED @ matrix_from_ypr(yaw, pitch, roll)
    gimbal_roll, gimbal_pitch, gimbal_yaw = at(motion, motion.gimbal_rpy_rad, instants_s).T
    world_from_gimbal = ENU_FROM_NED @ matrix_from_ypr(yaw + gimbal_yaw, gimbal_pitch, gimbal_roll)
    position = at(motion, motion.position_world_m, instants_s)
    center = position + world_from_body @ biases.lever_arm_m
    return center, world_from_gimbal @ GIMBAL_FROM_CAMERA @ exp_so3(biases.boresight_rad)


def _observe(
    scenario: Scenario,
    log: SimulatedLog,
    calibration: Calibration,
    truth: SurveyTruth,
    stored: Bools,
    rng: np.random.Generator,
) -> SimulatedSurvey:
    errors = scenario.errors
    jitter = errors.exif_jitter_s * rng.standard_normal(len(truth.frame_id))
    file_time = truth.time_utc_s + errors.camera_clock_offset_s + jitter
    tape = errors.tape_m * rng.standard_normal(len(scenario.lines))
    checked = [i for i, point in enumerate(scenario.points) if point.mark == "disc"]
    check_noise = errors.check_m * rng.standard_normal((len(checked), 3))
    return SimulatedSurvey(
        scenario=scenario,
        calibration=calibration,
        frame_id=truth.frame_id,
        file_time_utc_s=np.round(file_time / FILE_STEP_S) * FILE_STEP_S,
        event_has_photo=stored,
        log=log,
        picks=_pick(scenario, truth, rng),
        lines=KnownLines(
            name=tuple(line.name for line in scenario.lines),
            start=tuple(line.start for line in scenario.lines),
            end=tuple(line.end for line in scenario.lines),
            length_m=truth.line_length_m + tape,
            sigma_m=np.full(len(tape), errors.tape_m),
            adjust=np.array([line.use == "adjust" for line in scenario.lines], dtype=bool),
        ),
        checks=KnownPoints(
            label=tuple(truth.label[i] for i in checked),
            kind="local",
            coordinates=truth.point_world_m[checked] + check_noise,
            sigma_m=np.full((len(checked), 3), errors.check_m),
        ),
        measurements=scenario.measurements,
        truth=truth,
    )


def true_pixels(truth: SurveyTruth) -> Floats:
    """Where each point really lies in each photo, (F, K, 2) px; NaN behind the camera."""
    offset = truth.point_world_m[None] - truth.center_world_m[:, None]
    in_camera = np.einsum("fij,fki->fkj", truth.world_from_camera, offset)
    return project("brown", truth.intrinsics, in_camera)


def _pick(scenario: Scenario, truth: SurveyTruth, rng: np.random.Generator) -> Picks:
    """Pick every mark that is wholly in a photo, with the scenario's noise."""
    camera, sigma = scenario.camera, scenario.errors.pick_px
    pixel = true_pixels(truth)
    limit = np.array([camera.width_px, camera.height_px]) - 1.0 - PICK_MARGIN_PX
    inside = np.all((pixel > PICK_MARGIN_PX) & (pixel < limit), axis=-1)
    frame, point = np.nonzero(inside)
    noisy = pixel[inside] + sigma * rng.standard_normal((len(frame), 2))
    return Picks(
        image=tuple(truth.frame_id[i] for i in frame),
        label=tuple(truth.label[i] for i in point),
        pixel_px=noisy,
        sigma_px=np.full(len(frame), sigma),
        height_m=np.full(len(frame), np.nan),
    )
