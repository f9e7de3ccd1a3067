"""Autopilot log of a synthetic flight, with the errors of estimator, receiver and gimbal."""

from __future__ import annotations

import numpy as np

from uavgram.geometry.geodesy import geodetic_from_enu
from uavgram.geometry.motion.rotation import matrix_from_ypr, xyzw_from_matrix
from uavgram.model.arrays import Floats
from uavgram.model.flight_log import (
    AttitudeSamples,
    Boot,
    CameraEvents,
    ClockSamples,
    EstimatorSigmas,
    FlightLog,
    GimbalSamples,
    HomeSamples,
    PositionSamples,
    SimulatedLog,
    TurnRateSamples,
    VelocitySamples,
)
from uavgram.synthetic.errors import ErrorSpec
from uavgram.synthetic.flight import STEP_S, FlightBiases, Motion, draw_gauss_markov, interpolate
from uavgram.synthetic.scenario import Scenario, Site

POSITION_EVERY = 10  # of the motion's steps: 10 Hz
ATTITUDE_EVERY = 5  # 20 Hz
GIMBAL_EVERY = 10
GPS_EVERY = 20  # 5 Hz
GPS_LAG_STEPS = 10  # receivers are late by 0.1 to 0.2 s (ArduPilot PR 8763)


def draw_biases(scenario: Scenario, rng: np.random.Generator) -> FlightBiases:
    """Draw the errors that all frames share, and add the fixed errors of the habits."""
    errors, habits = scenario.errors, scenario.habits
    horizontal, vertical = errors.position_bias_m
    return FlightBiases(
        position_m=rng.standard_normal(3) * [horizontal, horizontal, vertical],
        heading_rad=float(
            np.deg2rad(errors.heading_bias_deg) * rng.standard_normal() + np.deg2rad(habits.yaw_deg)
        ),
        boresight_rad=np.deg2rad(errors.boresight_deg) * rng.standard_normal(3)
        + np.deg2rad([habits.mount_deg, 0.0, 0.0]),
        lever_arm_m=errors.lever_arm_m + errors.lever_arm_sigma_m * rng.standard_normal(3),
    )


def record_flight(
    scenario: Scenario, motion: Motion, biases: FlightBiases, rng: np.random.Generator
) -> SimulatedLog:
    """Record a flight as an autopilot does, with the scenario's errors.

    Parameters
    ----------
    scenario
        Its errors and its site.
    motion
        The true flight.
    biases
        Errors that are constant over the flight.
    rng
        Draws the errors.
    """
    errors, site, boot_s = scenario.errors, scenario.site, scenario.flight.boot_s
    position, gps = _draw_positions(scenario, motion, biases, rng)
    body, gimbal = _draw_angles(errors, motion, biases, rng)
    # logged times of exposures: jitter, and a fixed delay
    events = motion.exposure_time_s
    events = events + errors.event_jitter_s * rng.standard_normal(len(events))
    events = events + scenario.habits.lag_s
    # the receiver's rows are late: the position of an earlier time
    gps_rows = slice(GPS_LAG_STEPS, None, GPS_EVERY)
    gps_position = gps[: len(motion.time_s) - GPS_LAG_STEPS : GPS_EVERY]
    every = {
        "position": slice(None, None, POSITION_EVERY),
        "attitude": slice(None, None, ATTITUDE_EVERY),
        "gimbal": slice(None, None, GIMBAL_EVERY),
    }
    # A receiver reports its scatter and drift, not the constant bias.
    accuracy = np.hypot(errors.position_drift_m, errors.gps_noise_m)
    east, north, up = motion.velocity_world_m_s[every["position"]].T
    return SimulatedLog(
        boot_utc_s=scenario.flight.start_utc_s - boot_s,
        home_geodetic=np.array([site.latitude_deg, site.longitude_deg, site.height_msl_m]),
        undulation_m=site.undulation_m,
        position_time_s=boot_s + motion.time_s[every["position"]],
        position_geodetic=convert_to_geodetic(position[every["position"]], site),
        velocity_ned_m_s=np.stack([north, east, -up], axis=1),
        attitude_time_s=boot_s + motion.time_s[every["attitude"]],
        attitude_rpy_rad=body[every["attitude"]],
        gimbal_time_s=boot_s + motion.time_s[every["gimbal"]],
        gimbal_rpy_rad=gimbal[every["gimbal"]],
        gps_time_s=boot_s + motion.time_s[gps_rows],
        gps_geodetic=convert_to_geodetic(gps_position, site),
        gps_accuracy_m=np.tile(accuracy, (len(gps_position), 1)),
        event_time_s=boot_s + events,
        event_geodetic=convert_to_geodetic(interpolate(motion, position, events), site),
        event_rpy_rad=interpolate(motion, body, events),
    )


def convert_to_geodetic(position_world_m: Floats, site: Site) -> Floats:
    """Convert world (N, 3) to latitude, longitude [deg], height above sea level [m], (N, 3)."""
    ellipsoid_m = site.height_msl_m + site.undulation_m
    origin = (site.latitude_deg, site.longitude_deg, ellipsoid_m)
    latitude, longitude, height = geodetic_from_enu(position_world_m, origin)
    return np.column_stack([latitude, longitude, height - site.undulation_m])


def _draw_positions(
    scenario: Scenario, motion: Motion, biases: FlightBiases, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Draw positions of estimator and receiver (N, 3): a common drift, and scatter of the fixes."""
    errors = scenario.errors
    horizontal, vertical = errors.position_drift_m
    sigma = np.array([horizontal, horizontal, vertical])
    count = len(motion.time_s)
    drift = draw_gauss_markov(rng, count, STEP_S, errors.position_drift_tau_s, sigma)
    estimated = motion.position_world_m + biases.position_m + drift
    if scenario.habits.gps_jump_m:
        amid = motion.time_s > np.median(motion.exposure_time_s)
        estimated[:, 1] += scenario.habits.gps_jump_m * amid
    scatter = np.array([errors.gps_noise_m[0], *errors.gps_noise_m])
    return estimated, estimated + scatter * rng.standard_normal((count, 3))


def _draw_angles(
    errors: ErrorSpec, motion: Motion, biases: FlightBiases, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Draw the logged roll, pitch, yaw of body and gimbal, (N, 3) each."""
    count, tau = len(motion.time_s), errors.attitude_tau_s
    body_sigma = np.deg2rad([errors.attitude_deg, errors.attitude_deg, errors.heading_deg])
    body = motion.body_rpy_rad + draw_gauss_markov(rng, count, STEP_S, tau, body_sigma)
    body[:, 2] += biases.heading_rad
    gimbal_sigma = np.full(3, np.deg2rad(errors.gimbal_deg))
    gimbal = motion.gimbal_rpy_rad + draw_gauss_markov(rng, count, STEP_S, tau, gimbal_sigma)
    return body, gimbal


SYSTEM_EVERY_S = 1.0


def make_flight_log(log: SimulatedLog) -> FlightLog:
    """Return the log in the form of a log reader, but without the integer rounding of MAVLink.

    Parameters
    ----------
    log
        Recording of the autopilot.
    """
    return FlightLog(
        path="flight.tlog",
        kind="tlog",
        vehicle="quadrotor",
        firmware="",
        boots=(_convert_to_boot(log),),
        messages=(),
        undulation_m=log.undulation_m,
        notes=(),
    )


def _convert_to_boot(log: SimulatedLog) -> Boot:
    clock_s = np.arange(log.position_time_s[0], log.position_time_s[-1], SYSTEM_EVERY_S)
    unstated = np.full(len(log.gps_time_s), np.nan)
    return Boot(
        positions=_positions(log, "GLOBAL_POSITION_INT"),
        receiver=_positions(log, "GPS_RAW_INT"),
        attitudes=AttitudeSamples(
            time_boot_s=log.attitude_time_s,
            ned_from_body_xyzw=xyzw_from_matrix(matrix_from_ypr(*log.attitude_rpy_rad.T[::-1])),
            source="ATTITUDE_QUATERNION",
        ),
        gimbal=GimbalSamples(
            time_boot_s=log.gimbal_time_s,
            roll_rad=log.gimbal_rpy_rad[:, 0],
            pitch_rad=log.gimbal_rpy_rad[:, 1],
            yaw_rad=log.gimbal_rpy_rad[:, 2],
            yaw_frame="vehicle",
            source="GIMBAL_DEVICE_ATTITUDE_STATUS",
        ),
        sigmas=EstimatorSigmas(
            time_boot_s=log.gps_time_s,
            horizontal_m=log.gps_accuracy_m[:, 0],
            vertical_m=log.gps_accuracy_m[:, 1],
            tilt_rad=unstated,
            yaw_rad=unstated,
            source="GPS_RAW_INT",
        ),
        events=CameraEvents(
            time_boot_s=log.event_time_s,
            image_number=np.arange(1, len(log.event_time_s) + 1),
            confirmed=np.ones(len(log.event_time_s)),
            source="CAMERA_FEEDBACK",
        ),
        home=_home(log),
        clocks=(
            ClockSamples(time_boot_s=clock_s, utc_s=log.boot_utc_s + clock_s, source="system_time"),
        ),
        velocities=VelocitySamples(
            time_boot_s=log.position_time_s,
            ned_m_s=log.velocity_ned_m_s,
            source="GLOBAL_POSITION_INT",
        ),
        turn_rates=TurnRateSamples(
            time_boot_s=log.attitude_time_s,
            body_rad_s=np.gradient(
                np.unwrap(log.attitude_rpy_rad, axis=0), log.attitude_time_s, axis=0
            ),
            source="ATTITUDE_QUATERNION",
        ),
    )


def _positions(log: SimulatedLog, source: str) -> PositionSamples:
    raw = source == "GPS_RAW_INT"
    place = log.gps_geodetic if raw else log.position_geodetic
    above_home = np.full(len(place), np.nan) if raw else place[:, 2] - log.home_geodetic[2]
    return PositionSamples(
        time_boot_s=log.gps_time_s if raw else log.position_time_s,
        latitude_deg=place[:, 0],
        longitude_deg=place[:, 1],
        height_m=place[:, 2],
        height_home_m=above_home,
        datum="msl",
        source=source,
    )


def _home(log: SimulatedLog) -> HomeSamples:
    latitude, longitude, height = log.home_geodetic
    return HomeSamples(
        time_boot_s=log.position_time_s[:1],
        latitude_deg=np.array([latitude]),
        longitude_deg=np.array([longitude]),
        height_m=np.array([height]),
        datum="msl",
        source="HOME_POSITION",
    )
