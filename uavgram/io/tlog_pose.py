"""Position, attitude, gimbal and accuracies in a MAVLink telemetry log.

Units and frames: https://mavlink.io/en/messages/common.html, message by message.
"""

from __future__ import annotations

import numpy as np

from uavgram.geometry.rotation import (
    matrix_from_xyzw,
    matrix_from_ypr,
    xyzw_from_matrix,
    ypr_from_matrix,
)
from uavgram.io.dataflash_pose import merged_sigmas
from uavgram.io.mavlink_frames import Columns
from uavgram.io.samples import are_angles, in_order, is_height, near_its_track
from uavgram.io.tlog_stream import Stream
from uavgram.model.arrays import Floats, Ints
from uavgram.model.telemetry import (
    AttitudeSamples,
    EstimatorSigmas,
    GimbalSamples,
    PositionSamples,
)

# GIMBAL_DEVICE_FLAGS
_YAW_LOCK, _YAW_IN_VEHICLE_FRAME, _YAW_IN_EARTH_FRAME = 16, 32, 64


def positions(stream: Stream) -> PositionSamples | None:
    """GLOBAL_POSITION_INT."""
    columns, _ = stream.columns("GLOBAL_POSITION_INT")
    if not columns:
        return None
    time = columns["time_boot_ms"] * 1e-3
    latitude, longitude = columns["lat"] / 1e7, columns["lon"] / 1e7
    height = columns["alt"] / 1e3
    rows = in_order(time, near_its_track(latitude, longitude) & is_height(height))
    if not len(rows):
        return None
    return PositionSamples(
        time_boot_s=time[rows],
        latitude_deg=latitude[rows],
        longitude_deg=longitude[rows],
        height_m=height[rows],
        height_home_m=(columns["relative_alt"] / 1e3)[rows],
        datum="msl",
        source="GLOBAL_POSITION_INT",
    )


def attitudes(stream: Stream) -> AttitudeSamples | None:
    """ATTITUDE_QUATERNION, else ATTITUDE."""
    columns, _ = stream.columns("ATTITUDE_QUATERNION")
    if columns:
        q = np.stack([columns[k].astype(np.float64) for k in ("q2", "q3", "q4", "q1")], axis=1)
        return _attitude_samples(columns, q, "ATTITUDE_QUATERNION")
    columns, _ = stream.columns("ATTITUDE")
    if not columns:
        return None
    yaw, pitch, roll = (columns[k].astype(np.float64) for k in ("yaw", "pitch", "roll"))
    finite = np.isfinite(yaw) & np.isfinite(pitch) & np.isfinite(roll)
    angles = (np.where(finite, a, 0.0) for a in (yaw, pitch, roll))
    xyzw = np.where(finite[:, None], xyzw_from_matrix(matrix_from_ypr(*angles)), np.nan)
    return _attitude_samples(columns, xyzw, "ATTITUDE")


def _attitude_samples(columns: Columns, xyzw: Floats, source: str) -> AttitudeSamples | None:
    time = columns["time_boot_ms"] * 1e-3
    length = np.linalg.norm(xyzw, axis=1)
    rows = in_order(time, np.abs(length - 1) < 0.01)
    if not len(rows):
        return None
    return AttitudeSamples(
        time_boot_s=time[rows],
        ned_from_body_xyzw=xyzw[rows] / length[rows, None],
        source=source,
    )


def gimbal(stream: Stream) -> GimbalSamples | None:
    """The gimbal's attitude from the first of its messages that the log has, newest first."""
    return _gimbal_device(stream) or _mount_orientation(stream) or _mount_status(stream)


def _gimbal_device(stream: Stream) -> GimbalSamples | None:
    columns, _ = stream.columns("GIMBAL_DEVICE_ATTITUDE_STATUS")
    if not columns:
        return None
    q = columns["q"].astype(np.float64)[:, [1, 2, 3, 0]]
    length = np.linalg.norm(q, axis=1)
    flags = columns["flags"]
    # Neither frame flag (older firmware): the lock flag says which frame the yaw is in.
    earth = (flags & _YAW_IN_EARTH_FRAME > 0) | (
        (flags & _YAW_IN_VEHICLE_FRAME == 0) & (flags & _YAW_LOCK > 0)
    )
    use_earth = bool(earth.mean() > 0.5)
    time = columns["time_boot_ms"] * 1e-3
    rows = in_order(time, (np.abs(length - 1) < 0.01) & (earth == use_earth))
    if not len(rows):
        return None
    yaw, pitch, roll = ypr_from_matrix(matrix_from_xyzw(q[rows] / length[rows, None]))
    return GimbalSamples(
        time_boot_s=time[rows],
        roll_rad=roll,
        pitch_rad=pitch,
        yaw_rad=yaw,
        yaw_frame="earth" if use_earth else "vehicle",
        source="GIMBAL_DEVICE_ATTITUDE_STATUS",
    )


def _mount_orientation(stream: Stream) -> GimbalSamples | None:
    columns, _ = stream.columns("MOUNT_ORIENTATION")
    if not columns:
        return None
    angles_deg = np.stack([columns[k] for k in ("roll", "pitch", "yaw")], axis=1)
    time = columns["time_boot_ms"] * 1e-3
    return _mount_samples(time, angles_deg.astype(np.float64), "MOUNT_ORIENTATION")


def _mount_status(stream: Stream) -> GimbalSamples | None:
    columns, found = stream.columns("MOUNT_STATUS")
    if not columns:
        return None
    # pointing_a, b, c are pitch, roll, yaw in centidegrees; the message has no time of its own
    names = ("pointing_b", "pointing_a", "pointing_c")
    angles_deg = np.stack([columns[k] / 100.0 for k in names], axis=1)
    if not angles_deg.any():
        return None  # no mount is configured
    return _mount_samples(stream.boot_s(found), angles_deg, "MOUNT_STATUS")


def _mount_samples(time: Floats, angles_deg: Floats, source: str) -> GimbalSamples | None:
    rows = in_order(time, are_angles(angles_deg))
    if not len(rows):
        return None
    roll, pitch, yaw = np.radians(angles_deg[rows]).T
    return GimbalSamples(
        time_boot_s=time[rows],
        roll_rad=roll,
        pitch_rad=pitch,
        yaw_rad=yaw,
        yaw_frame="vehicle",
        source=source,
    )


def sigmas(stream: Stream) -> EstimatorSigmas | None:
    """The receiver's accuracies (0 where it states none), and PX4's estimator status.

    EKF_STATUS_REPORT's variances are test ratios, no standard deviations.
    """
    parts: list[tuple[str, Floats, dict[str, Floats]]] = []
    columns, rows = stream.columns("ESTIMATOR_STATUS")
    if columns:
        horizontal = columns["pos_horiz_accuracy"].astype(np.float64)
        vertical = columns["pos_vert_accuracy"].astype(np.float64)
        parts.append(_part("ESTIMATOR_STATUS", stream, rows, horizontal, vertical))
    columns, rows = stream.columns("GPS_RAW_INT")
    if columns:
        horizontal, vertical = columns["h_acc"] / 1e3, columns["v_acc"] / 1e3
        parts.append(_part("GPS_RAW_INT", stream, rows, horizontal, vertical))
    return merged_sigmas(parts)


def _part(
    name: str, stream: Stream, rows: Ints, horizontal: Floats, vertical: Floats
) -> tuple[str, Floats, dict[str, Floats]]:
    return name, stream.boot_s(rows), {"horizontal": horizontal, "vertical": vertical}
