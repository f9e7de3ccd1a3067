"""Gimbal attitudes as MAVLink and PX4 state them -> GimbalSamples; shared by their readers."""

from __future__ import annotations

from typing import Literal

import numpy as np

from uavgram.geometry.motion.rotation import matrix_from_xyzw, ypr_from_matrix
from uavgram.io.logs.quality.rows import are_angles, left_out, plausible_rows
from uavgram.io.logs.quality.samples import Found, unit_quaternions
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.flight.log import GimbalSamples

# GIMBAL_DEVICE_FLAGS, https://mavlink.io/en/messages/common.html
_YAW_LOCK, _YAW_IN_VEHICLE_FRAME, _YAW_IN_EARTH_FRAME = 16, 32, 64


def from_device_status(
    time_s: Floats, wxyz: Floats, flags: Ints, source: str
) -> Found[GimbalSamples]:
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
    xyzw = unit_quaternions(wxyz[:, [1, 2, 3, 0]])
    sane = np.asarray(np.isfinite(xyzw).all(axis=1))
    # Neither frame flag (older firmware): the lock flag says which frame the yaw is in.
    earth = (flags & _YAW_IN_EARTH_FRAME > 0) | (
        (flags & _YAW_IN_VEHICLE_FRAME == 0) & (flags & _YAW_LOCK > 0)
    )
    use_earth = bool(len(earth) and earth.mean() > 0.5)
    rows = plausible_rows(time_s, sane & (earth == use_earth))
    stated = np.asarray(np.isfinite(wxyz).all(axis=1))
    turned = np.where(sane[:, None], xyzw, [0.0, 0.0, 0.0, 1.0])
    rpy = np.stack(ypr_from_matrix(matrix_from_xyzw(turned))[::-1], axis=1)
    return _samples(time_s, rpy, rows, stated, source, "earth" if use_earth else "vehicle")


def from_angles(
    time_s: Floats,
    rpy_deg: Floats,
    source: str,
    *,
    yaw_frame: Literal["earth", "vehicle"] = "vehicle",
    stated: Bools | None = None,
) -> Found[GimbalSamples]:
    """Angles of roll and pitch from the horizon, and of yaw.

    Parameters
    ----------
    time_s
        (N,) since boot.
    rpy_deg
        (N, 3) roll, pitch, yaw.
    source
        The message's name.
    yaw_frame
        Whether yaw is from north or from the vehicle's nose.
    stated
        (N,) rows that state something; None for those with a number among the three angles.
    """
    rows = plausible_rows(time_s, are_angles(rpy_deg))
    if stated is None:
        stated = np.asarray(np.isfinite(rpy_deg).any(axis=1))
    return _samples(time_s, np.radians(rpy_deg), rows, stated, source, yaw_frame)


def _samples(
    time_s: Floats,
    rpy_rad: Floats,
    rows: Ints,
    stated: Bools,
    source: str,
    yaw_frame: Literal["earth", "vehicle"],
) -> Found[GimbalSamples]:
    notes = left_out(source, time_s, rows, stated)
    if not len(rows):
        return None, notes
    roll, pitch, yaw = rpy_rad[rows].T
    samples = GimbalSamples(
        time_boot_s=time_s[rows],
        roll_rad=roll,
        pitch_rad=pitch,
        yaw_rad=yaw,
        yaw_frame=yaw_frame,
        source=source,
    )
    return samples, notes
