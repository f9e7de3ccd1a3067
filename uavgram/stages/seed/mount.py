"""Use the mount that the project states, and report recorded angles that contradict it."""

from __future__ import annotations

import numpy as np
from scipy.special import chdtrc

from uavgram.geometry.motion.rotation import log_so3, matrix_from_ypr
from uavgram.model.arrays import Floats
from uavgram.model.message import Message
from uavgram.model.options import MountOptions

_UNLIKELY = 0.001  # probability of so large a difference between a right mount and right angles


def apply_stated_mount(
    mount: MountOptions, ypr_rad: Floats, heading_rad: Floats, source: str
) -> tuple[Floats, tuple[Message, ...]]:
    """Replace angles of a gimbal by those that the project states, and report the difference.

    Parameters
    ----------
    mount
        Mount; a stated yaw counts from the vehicle's nose, pitch and roll from the horizon.
    ypr_rad
        (N, 3) the gimbal's yaw from north, pitch and roll; where they are NaN, the result is
        meaningless.
    heading_rad
        (N,) of the vehicle, from north.
    source
        Source of the gimbal's angles.
    """
    stated = np.array(mount.angles_deg((np.nan,) * 3))
    known = np.isfinite(ypr_rad).all(axis=1)
    if np.isnan(stated).all() or not known.any():
        return ypr_rad, ()
    replaced = np.where(np.isfinite(stated), np.radians(stated), ypr_rad)
    replaced[:, 0] += np.where(np.isfinite(stated[0]), heading_rad, 0.0)
    recorded, used = matrix_from_ypr(*ypr_rad[known].T), matrix_from_ypr(*replaced[known].T)
    return replaced, (report_stated_mount(mount, recorded, used, source),)


def report_stated_mount(
    mount: MountOptions, recorded: Floats, used: Floats, source: str
) -> Message:
    """Report how far the stated mount is from recorded angles: a warning where they contradict it.

    Parameters
    ----------
    mount
        Mount, with the sigma of its angles.
    recorded, used
        (N, 3, 3) attitudes of the camera by the gimbal, and as used.
    source
        Source of the gimbal's angles.
    """
    turns_deg = np.degrees(np.linalg.norm(log_so3(np.swapaxes(recorded, 1, 2) @ used), axis=1))
    usual = float(np.median(turns_deg)) / mount.boresight_sigma_deg
    contradicts = chdtrc(3, usual**2) < _UNLIKELY
    text = (
        "The camera is taken to look as the angles under `mount` in the project state. The "
        f"gimbal's own angles ({source}), up to {turns_deg.max():.1f} degrees apart, were not "
        "used: to use them, write `auto` into `mount`."
    )
    if contradicts:
        text = (
            "The mount that the project states contradicts the recorded angles: the gimbal's own "
            f"angles ({source}) are up to {turns_deg.max():.1f} degrees apart, and were not used. "
            "Check how the camera hung. If you are not sure, write `auto` into `mount`."
        )
    return Message("warning" if contradicts else "info", "mount-stated", text)
