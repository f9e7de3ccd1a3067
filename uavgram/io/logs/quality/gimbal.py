"""Gimbal attitudes as MAVLink and PX4 state them -> GimbalSamples; shared by their readers."""

from __future__ import annotations

import numpy as np

from uavgram.geometry.motion.rotation import matrix_from_xyzw, ypr_from_matrix
from uavgram.io.logs.quality.rows import are_angles, left_out, plausible_rows
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.flight.log import GimbalSamples

# GIMBAL_DEVICE_FLAGS, https://mavlink.io/en/messages/common.html
_YAW_LOCK, _YAW_IN_VEHICLE_FRAME, _YAW_IN_EARTH_FRAME = 16, 32, 64


def _among(stated: Bools, rows: Ints) -> Ints:
    """Which of the rows that state something are used, counted among these."""
    return np.flatnonzero(np.isin(np.flatnonzero(stated), rows))


def from_device_status(
    time_s: Floats, wxyz: Floats, flags: Ints, source: str
) -> tuple[GimbalSamples | None, tuple[str, ...]]:
    """GIMBAL_DEVICE_ATTITUDE_STATUS: roll and pitch from the horizon, yaw as the flags say.

    Parameters
    ----------
    time_s
        (N,) since boot.
    wxyz
        (N, 4) quaternions, w first.
    flags
        (N,) GIMBAL_DEVICE_FLAGS; where rows differ in the frame of yaw, the commoner one is kept.
    source
        The message's name.
    """
    xyzw = wxyz[:, [1, 2, 3, 0]]
    length = np.linalg.norm(xyzw, axis=1)
    # Neither frame flag (older firmware): the lock flag says which frame the yaw is in.
    earth = (flags & _YAW_IN_EARTH_FRAME > 0) | (
        (flags & _YAW_IN_VEHICLE_FRAME == 0) & (flags & _YAW_LOCK > 0)
    )
    use_earth = bool(len(earth) and earth.mean() > 0.5)
    rows = plausible_rows(time_s, (np.abs(length - 1) < 0.01) & (earth == use_earth))
    stated = np.asarray(np.isfinite(length))
    notes = left_out(source, time_s[stated], _among(stated, rows))
    if not len(rows):
        return None, notes
    yaw, pitch, roll = ypr_from_matrix(matrix_from_xyzw(xyzw[rows] / length[rows, None]))
    samples = GimbalSamples(
        time_boot_s=time_s[rows],
        roll_rad=roll,
        pitch_rad=pitch,
        yaw_rad=yaw,
        yaw_frame="earth" if use_earth else "vehicle",
        source=source,
    )
    return samples, notes


def from_angles(
    time_s: Floats, rpy_deg: Floats, source: str
) -> tuple[GimbalSamples | None, tuple[str, ...]]:
    """Angles (N, 3) of roll, pitch [deg] from the horizon and yaw from the vehicle's nose."""
    rows = plausible_rows(time_s, are_angles(rpy_deg))
    stated = np.asarray(np.isfinite(rpy_deg).any(axis=1))
    notes = left_out(source, time_s[stated], _among(stated, rows))
    if not len(rows):
        return None, notes
    roll, pitch, yaw = np.radians(rpy_deg[rows]).T
    samples = GimbalSamples(
        time_boot_s=time_s[rows],
        roll_rad=roll,
        pitch_rad=pitch,
        yaw_rad=yaw,
        yaw_frame="vehicle",
        source=source,
    )
    return samples, notes
