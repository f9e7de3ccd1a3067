"""Position, attitude, gimbal and accuracies in a MAVLink telemetry log.

Units and frames: https://mavlink.io/en/messages/common.html, message by message.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from uavgram.geometry.motion.interpolation import interpolate_rotation
from uavgram.geometry.motion.rotation import matrix_from_ypr, xyzw_from_matrix, ypr_from_matrix
from uavgram.io.logs.quality import gimbal as gimbal_forms
from uavgram.io.logs.quality.rows import as_numbers
from uavgram.io.logs.quality.samples import (
    Found,
    attitude_samples,
    first_found,
    position_samples,
    reception_samples,
    turn_rate_samples,
    unit_quaternions,
    velocity_samples,
)
from uavgram.io.logs.quality.sigmas import Stated, merged_sigmas, positions_known
from uavgram.io.logs.tlog.frames import Columns
from uavgram.io.logs.tlog.stream import Stream
from uavgram.model.arrays import Floats, Ints
from uavgram.model.flight.log import (
    AttitudeSamples,
    EstimatorSigmas,
    GimbalSamples,
    PositionSamples,
    ReceptionSamples,
)
from uavgram.model.flight.second_opinions import TurnRateSamples, VelocitySamples

_LARGEST_RAD = 7.0  # of an angle: some say 2 pi for 0


def positions(stream: Stream) -> Found[PositionSamples]:
    """GLOBAL_POSITION_INT; else the receiver's own."""
    columns, _ = stream.columns("GLOBAL_POSITION_INT")
    if columns:
        time, above_home = columns["time_boot_ms"] * 1e-3, columns["relative_alt"] / 1e3
        samples, notes = _position_samples(columns, time, "GLOBAL_POSITION_INT", above_home)
        if samples is not None:
            return samples, notes
    columns, rows = receiver(stream)
    if not columns:
        return None, ()
    samples, notes = _position_samples(columns, stream.boot_s(rows), "GPS_RAW_INT")
    remark = "positions are the receiver's own (no GLOBAL_POSITION_INT): they lag by its delay"
    return samples, notes if samples is None else (*notes, remark)


def _position_samples(
    columns: Columns, time_s: Floats, source: str, above_home_m: Floats | None = None
) -> Found[PositionSamples]:
    fixed = (columns["lat"] != 0) | (columns["lon"] != 0)
    place = columns["lat"] / 1e7, columns["lon"] / 1e7, columns["alt"] / 1e3
    return position_samples(source, time_s, place, above_home_m, fixed)


def receiver(stream: Stream) -> tuple[Columns, Ints]:
    """Messages with a 3-D fix of the first receiver that has any, and their frames."""
    for name in ("GPS_RAW_INT", "GPS2_RAW"):
        columns, rows = stream.columns(name)
        if columns and (fixed := columns["fix_type"] >= 3).any():
            return {field: values[fixed] for field, values in columns.items()}, rows[fixed]
    return {}, np.zeros(0, dtype=np.int64)


def attitudes(stream: Stream) -> Found[AttitudeSamples]:
    """ATTITUDE_QUATERNION, else ATTITUDE."""
    columns, _ = stream.columns("ATTITUDE_QUATERNION")
    if columns:
        q = np.stack([as_numbers(columns[k]) for k in ("q2", "q3", "q4", "q1")], axis=1)
        samples, notes = _attitude_samples(columns, q, "ATTITUDE_QUATERNION")
        if samples is not None:
            return samples, notes
    return _by_angles(stream)


def _by_angles(stream: Stream) -> Found[AttitudeSamples]:
    columns, _ = stream.columns("ATTITUDE")
    if not columns:
        return None, ()
    yaw, pitch, roll = (as_numbers(columns[k]) for k in ("yaw", "pitch", "roll"))
    sane = np.abs(np.stack([yaw, pitch, roll])).max(axis=0) < _LARGEST_RAD  # NaN compares False
    angles = (np.where(sane, a, 0.0) for a in (yaw, pitch, roll))
    xyzw = np.where(sane[:, None], xyzw_from_matrix(matrix_from_ypr(*angles)), np.nan)
    return _attitude_samples(columns, xyzw, "ATTITUDE")


def _attitude_samples(columns: Columns, xyzw: Floats, source: str) -> Found[AttitudeSamples]:
    return attitude_samples(source, columns["time_boot_ms"] * 1e-3, unit_quaternions(xyzw))


def second_opinions(
    stream: Stream, heard: tuple[Columns, Ints]
) -> tuple[PositionSamples | None, AttitudeSamples | None]:
    """The receiver's own positions, and ATTITUDE, to hold against what is used."""
    columns, rows = heard
    place = _position_samples(columns, stream.boot_s(rows), "GPS_RAW_INT")[0] if columns else None
    return place, _by_angles(stream)[0]


def velocities(stream: Stream) -> VelocitySamples | None:
    """Of GLOBAL_POSITION_INT: the estimator's, which no jump of its positions moves."""
    columns, _ = stream.columns("GLOBAL_POSITION_INT")
    if not columns:
        return None
    north, east, down = (columns[k] / 100.0 for k in ("vx", "vy", "vz"))
    # Firmware that knows no velocity sends zeros throughout.
    if not (north.any() or east.any()):
        return None
    time_s = columns["time_boot_ms"] * 1e-3
    return velocity_samples("GLOBAL_POSITION_INT", time_s, (north, east, down))


def turn_rates(stream: Stream) -> TurnRateSamples | None:
    """Of ATTITUDE_QUATERNION, else of ATTITUDE."""
    for name in ("ATTITUDE_QUATERNION", "ATTITUDE"):
        columns, _ = stream.columns(name)
        if columns:
            roll, pitch, yaw = (
                as_numbers(columns[k]) for k in ("rollspeed", "pitchspeed", "yawspeed")
            )
            time_s = columns["time_boot_ms"] * 1e-3
            found = turn_rate_samples(name, time_s, (roll, pitch, yaw))
            if found is not None:
                return found
    return None


def gimbal(stream: Stream, attitudes: AttitudeSamples | None) -> Found[GimbalSamples]:
    """The gimbal's attitude from the first of its messages that the log has, newest first."""
    return first_found(
        partial(_gimbal_device, stream),
        partial(_mount_orientation, stream),
        partial(_mount_status, stream, attitudes),
    )


def _gimbal_device(stream: Stream) -> Found[GimbalSamples]:
    columns, _ = stream.columns("GIMBAL_DEVICE_ATTITUDE_STATUS")
    if not columns:
        return None, ()
    return gimbal_forms.from_device_status(
        columns["time_boot_ms"] * 1e-3,
        as_numbers(columns["q"].reshape(-1)).reshape(-1, 4),
        columns["flags"].astype(np.int64),
        "GIMBAL_DEVICE_ATTITUDE_STATUS",
    )


def _mount_orientation(stream: Stream) -> Found[GimbalSamples]:
    columns, _ = stream.columns("MOUNT_ORIENTATION")
    if not columns:
        return None, ()
    angles_deg = np.stack([as_numbers(columns[k]) for k in ("roll", "pitch", "yaw")], axis=1)
    time = columns["time_boot_ms"] * 1e-3
    return gimbal_forms.from_angles(time, angles_deg, "MOUNT_ORIENTATION")


def _mount_status(stream: Stream, attitudes: AttitudeSamples | None) -> Found[GimbalSamples]:
    """MOUNT_STATUS: of a servo mount (until 4.2) the servos' angles, so from the vehicle's frame.

    ArduPilot 3.x, AP_Mount_Servo.cpp status_msg() sends _angle_bf_output_deg, the other mounts
    send angles from the horizon; the message does not say which. Servo angles cancel the
    vehicle's: that is how they are told apart here.
    """
    columns, found = stream.columns("MOUNT_STATUS")
    if not columns:
        return None, ()
    # pointing_a, b, c are pitch, roll, yaw in centidegrees; the message has no time of its own
    names = ("pointing_b", "pointing_a", "pointing_c")
    angles_deg = np.stack([columns[k] / 100.0 for k in names], axis=1)
    if not angles_deg.any():
        return None, ()  # no mount is configured
    samples, notes = gimbal_forms.from_angles(stream.boot_s(found), angles_deg, "MOUNT_STATUS")
    if samples is None or attitudes is None or len(attitudes.time_boot_s) < 2:
        return samples, notes
    vehicle, _ = interpolate_rotation(
        attitudes.time_boot_s,
        attitudes.ned_from_body_xyzw,
        np.clip(samples.time_boot_s, *attitudes.time_boot_s[[0, -1]]),
    )
    if not _cancels(samples, vehicle):
        return samples, notes
    note = (
        "MOUNT_STATUS states servo angles, which cancel the vehicle's roll and pitch: they were "
        "turned by the vehicle's attitude"
    )
    return _on_vehicle(samples, vehicle), (*notes, note)


def _cancels(samples: GimbalSamples, ned_from_body: Floats) -> bool:
    """Whether the angles undo the vehicle's: their sum varies far less than they do."""
    _, pitch, roll = ypr_from_matrix(ned_from_body)
    apart = np.var(samples.roll_rad) + np.var(samples.pitch_rad)
    together = np.var(samples.roll_rad + roll) + np.var(samples.pitch_rad + pitch)
    return bool(apart > np.radians(0.5) ** 2 and together < 0.25 * apart)


def _on_vehicle(samples: GimbalSamples, ned_from_body: Floats) -> GimbalSamples:
    """Angles from the vehicle's frame as angles from the horizon and north."""
    body_from_gimbal = matrix_from_ypr(samples.yaw_rad, samples.pitch_rad, samples.roll_rad)
    yaw, pitch, roll = ypr_from_matrix(ned_from_body @ body_from_gimbal)
    return replace(samples, roll_rad=roll, pitch_rad=pitch, yaw_rad=yaw, yaw_frame="earth")


def sigmas(stream: Stream, heard: tuple[Columns, Ints]) -> EstimatorSigmas | None:
    """The accuracies of what `receiver` heard (0 where it states none), and of PX4's estimator.

    EKF_STATUS_REPORT's variances are test ratios, no standard deviations.
    """
    parts: list[Stated] = []
    fix = None
    columns, rows = stream.columns("ESTIMATOR_STATUS")
    if columns:
        horizontal = as_numbers(columns["pos_horiz_accuracy"])
        vertical = as_numbers(columns["pos_vert_accuracy"])
        parts.append(positions_known("ESTIMATOR_STATUS", stream.boot_s(rows), horizontal, vertical))
    columns, rows = heard
    if columns:
        horizontal, vertical = columns["h_acc"] / 1e3, columns["v_acc"] / 1e3
        parts.append(positions_known("GPS_RAW_INT", stream.boot_s(rows), horizontal, vertical))
        fix = stream.boot_s(rows), as_numbers(columns["fix_type"])
    return merged_sigmas(parts, fix)


def reception(stream: Stream, heard: tuple[Columns, Ints]) -> ReceptionSamples | None:
    """What the receiver hears while it has a 3-D fix; 255 and 65535 stand for unknown."""
    columns, rows = heard
    if not columns:
        return None
    satellites, hdop = as_numbers(columns["satellites_visible"]), columns["eph"] / 100.0
    return reception_samples("GPS_RAW_INT", stream.boot_s(rows), satellites, hdop)
