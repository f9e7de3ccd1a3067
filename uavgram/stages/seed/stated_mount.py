"""Camera angles that the project states, in place of those by the gimbal."""

from __future__ import annotations

import numpy as np

from uavgram.geometry.motion.rotation import log_so3, matrix_from_ypr
from uavgram.model.arrays import Floats
from uavgram.model.message import Message
from uavgram.model.options import MountOptions


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
    before, after = matrix_from_ypr(*ypr_rad[known].T), matrix_from_ypr(*replaced[known].T)
    turns = log_so3(np.swapaxes(before, 1, 2) @ after)
    most_deg = float(np.degrees(np.linalg.norm(turns, axis=1).max()))
    text = (
        "The camera is taken to look as `mount` in the project states. The gimbal's own angles "
        f"({source}), up to {most_deg:.1f} degrees apart, were not used: `auto` takes them."
    )
    return replaced, (Message("info", "mount-stated", text),)
