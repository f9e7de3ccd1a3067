"""What a reader makes of a simulated log, without the file between: `io/logs/tlog/writer.py`."""

from __future__ import annotations

import numpy as np

from uavgram.geometry.motion.rotation import matrix_from_ypr, xyzw_from_matrix
from uavgram.model.flight.log import (
    AttitudeSamples,
    Boot,
    CameraEvents,
    ClockSamples,
    EstimatorSigmas,
    FlightLog,
    GimbalSamples,
    HomeSamples,
    PositionSamples,
)
from uavgram.model.flight.second_opinions import TurnRateSamples, VelocitySamples
from uavgram.model.scenario.simulated import SimulatedLog

SYSTEM_EVERY_S = 1.0


def flight_log(log: SimulatedLog) -> FlightLog:
    """Give the log as it is read, but for the rounding of MAVLink's whole numbers.

    Parameters
    ----------
    log
        What the autopilot recorded.
    """
    return FlightLog(
        path="flight.tlog",
        kind="tlog",
        vehicle="quadrotor",
        firmware="",
        boots=(_boot(log),),
        messages=(),
        undulation_m=log.undulation_m,
        notes=(),
    )


def _boot(log: SimulatedLog) -> Boot:
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
