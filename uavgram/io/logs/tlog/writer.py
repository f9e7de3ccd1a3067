"""Writer of a simulated flight as a MAVLink telemetry log (.tlog), like a ground station's."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from pymavlink.dialects.v20 import all as dialect

from uavgram.geometry.motion.rotation import matrix_from_ypr, xyzw_from_matrix
from uavgram.model.arrays import Floats
from uavgram.model.flight_log import SimulatedLog

LINK_DELAY_S = 0.06  # delay of the radio; the receiver's clock is right
FEEDBACK_DELAY_S = 0.02  # a camera reports after the exposure
SYSTEM_EVERY_S, HOME_EVERY_S = 1.0, 5.0
UNKNOWN_16 = 65535
GIMBAL_FLAGS = (
    dialect.GIMBAL_DEVICE_FLAGS_ROLL_LOCK
    | dialect.GIMBAL_DEVICE_FLAGS_PITCH_LOCK
    | dialect.GIMBAL_DEVICE_FLAGS_YAW_IN_VEHICLE_FRAME
)
ARMED = (
    dialect.MAV_MODE_FLAG_SAFETY_ARMED
    | dialect.MAV_MODE_FLAG_GUIDED_ENABLED
    | dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
)
AUTO_MODE = 3  # ArduCopter's number of it

Timed = Iterator[tuple[float, dialect.MAVLink_message]]


def write_tlog(path: Path, log: SimulatedLog) -> None:
    """Write a flight as a telemetry log; the same flight gives the same bytes.

    Each message follows a big-endian uint64 of microseconds since the Unix epoch: its time of
    reception by the ground station.

    Parameters
    ----------
    path
        Output file; overwritten.
    log
        Recording of the autopilot.
    """
    sources = (_system, _home, _positions, _attitudes, _gimbal, _gps, _feedback)
    timed = [row for source in sources for row in source(log)]
    timed.sort(key=lambda row: row[0])  # stable: messages of the same time keep the order above
    link = dialect.MAVLink(None, srcSystem=1, srcComponent=dialect.MAV_COMP_ID_AUTOPILOT1)
    out = bytearray()
    for number, (time_boot_s, message) in enumerate(timed):
        link.seq = number % 256
        received = round((log.boot_utc_s + time_boot_s + LINK_DELAY_S) * 1e6)
        out += struct.pack(">Q", received) + message.pack(link)
    path.write_bytes(out)


def _every(log: SimulatedLog, step_s: float) -> Floats:
    return np.arange(log.position_time_s[0], log.position_time_s[-1], step_s)


def _system(log: SimulatedLog) -> Timed:
    """Iterate over heartbeat and clock once a second, and a greeting at the start."""
    message = dialect.MAVLink_statustext_message(dialect.MAV_SEVERITY_INFO, b"uavgram demo")
    yield float(log.position_time_s[0]), message
    for time in _every(log, SYSTEM_EVERY_S).tolist():
        message = dialect.MAVLink_heartbeat_message(
            dialect.MAV_TYPE_QUADROTOR,
            dialect.MAV_AUTOPILOT_ARDUPILOTMEGA,
            ARMED,
            AUTO_MODE,
            dialect.MAV_STATE_ACTIVE,
            3,
        )
        yield time, message
        utc_us = round((log.boot_utc_s + time) * 1e6)
        yield time, dialect.MAVLink_system_time_message(utc_us, _ms(time))


def _home(log: SimulatedLog) -> Timed:
    latitude, longitude, altitude = _scale_positions(log.home_geodetic[None])[0]
    for time in _every(log, HOME_EVERY_S).tolist():
        message = dialect.MAVLink_home_position_message(
            latitude, longitude, altitude, 0, 0, 0, (1, 0, 0, 0), 0, 0, 0, _us(time)
        )
        yield time, message


def _positions(log: SimulatedLog) -> Timed:
    heading = np.rad2deg(np.interp(log.position_time_s, log.attitude_time_s, _yaw(log)))
    home_mm = _scale_positions(log.home_geodetic[None])[0][2]
    rows = zip(
        log.position_time_s.tolist(),
        _scale_positions(log.position_geodetic),
        np.round(log.velocity_ned_m_s * 100).astype(int).tolist(),
        (np.round(heading * 100).astype(int) % 36000).tolist(),
        strict=True,
    )
    for time, (latitude, longitude, altitude), velocity, centidegrees in rows:
        message = dialect.MAVLink_global_position_int_message(
            _ms(time), latitude, longitude, altitude, altitude - home_mm, *velocity, centidegrees
        )
        yield time, message


def _attitudes(log: SimulatedLog) -> Timed:
    """Iterate over ATTITUDE and ATTITUDE_QUATERNION, with angle rates as body rates."""
    steady = np.unwrap(log.attitude_rpy_rad, axis=0)
    rates = np.gradient(steady, log.attitude_time_s, axis=0).tolist()
    angles = log.attitude_rpy_rad.copy()
    angles[:, 2] = np.angle(np.exp(1j * angles[:, 2]))
    rows = zip(log.attitude_time_s.tolist(), angles.tolist(), _wxyz(angles), rates, strict=True)
    for time, rpy, wxyz, rate in rows:
        yield time, dialect.MAVLink_attitude_message(_ms(time), *rpy, *rate)
        yield time, dialect.MAVLink_attitude_quaternion_message(_ms(time), *wxyz, *rate)


def _gimbal(log: SimulatedLog) -> Timed:
    rows = zip(log.gimbal_time_s.tolist(), _wxyz(log.gimbal_rpy_rad), strict=True)
    for time, wxyz in rows:
        message = dialect.MAVLink_gimbal_device_attitude_status_message(
            0, 0, _ms(time), GIMBAL_FLAGS, wxyz, 0, 0, 0, 0
        )
        yield time, message


def _gps(log: SimulatedLog) -> Timed:
    accuracy_mm = np.round(log.gps_accuracy_m * 1000).astype(int).tolist()
    undulation_mm = round(log.undulation_m * 1000)
    rows = zip(
        log.gps_time_s.tolist(), _scale_positions(log.gps_geodetic), accuracy_mm, strict=True
    )
    for time, (latitude, longitude, altitude), (horizontal, vertical) in rows:
        message = dialect.MAVLink_gps_raw_int_message(
            _us(time),
            dialect.GPS_FIX_TYPE_3D_FIX,
            latitude,
            longitude,
            altitude,
            eph=80,
            epv=120,
            vel=UNKNOWN_16,
            cog=UNKNOWN_16,
            satellites_visible=17,
            alt_ellipsoid=altitude + undulation_mm,
            h_acc=horizontal,
            v_acc=vertical,
        )
        yield time, message


def _feedback(log: SimulatedLog) -> Timed:
    """Iterate over exposures with attitudes, stamped in UTC (ArduPilot without feedback pin)."""
    home_m = float(log.home_geodetic[2])
    rows = zip(
        log.event_time_s.tolist(),
        _scale_positions(log.event_geodetic),
        log.event_geodetic[:, 2].tolist(),
        np.rad2deg(log.event_rpy_rad).tolist(),
        strict=True,
    )
    for number, (time, (latitude, longitude, _), altitude, (roll, pitch, yaw)) in enumerate(
        rows, 1
    ):
        message = dialect.MAVLink_camera_feedback_message(
            round((log.boot_utc_s + time) * 1e6),
            target_system=0,
            cam_idx=0,
            img_idx=number,
            lat=latitude,
            lng=longitude,
            alt_msl=altitude,
            alt_rel=altitude - home_m,
            roll=roll,
            pitch=pitch,
            yaw=yaw % 360.0,
            foc_len=0.0,
            flags=dialect.CAMERA_FEEDBACK_PHOTO,
            completed_captures=number,
        )
        yield time + FEEDBACK_DELAY_S, message


def _yaw(log: SimulatedLog) -> Floats:
    return np.unwrap(log.attitude_rpy_rad[:, 2])


def _scale_positions(geodetic: Floats) -> list[list[int]]:
    """Convert (N, 3) degrees, degrees, metres to latitude, longitude [1e-7 deg] and height [mm]."""
    rounded: list[list[int]] = np.round(geodetic * [1e7, 1e7, 1e3]).astype(np.int64).tolist()
    return rounded


def _wxyz(rpy_rad: Floats) -> list[list[float]]:
    """Convert (N, 3) roll, pitch, yaw to quaternions w, x, y, z, MAVLink's order."""
    roll, pitch, yaw = rpy_rad.T
    xyzw = xyzw_from_matrix(matrix_from_ypr(yaw, pitch, roll))
    rolled: list[list[float]] = np.roll(xyzw, 1, axis=-1).tolist()
    return rolled


def _ms(time_s: float) -> int:
    return round(time_s * 1e3)


def _us(time_s: float) -> int:
    return round(time_s * 1e6)
