"""Two ways to say where a camera looks, and the way from one to the other.

Gimbal angles (DJI, MAVLink, this program): yaw, pitch, roll of a frame whose x is the optical axis
and whose -z is image up; pitch -90 degrees looks straight down.

Nadir angles (Pix4D, OpenDroneMap): yaw, pitch, roll of a body under which the camera looks down,
the top of the image to the front; pitch 0 looks straight down, 90 degrees forward (Pix4D, "Yaw,
Pitch, Roll and Omega, Phi, Kappa angles"; OpenDroneMap, opendm/photo.py: "Pitch: 0 --> nadir
camera"). Both turn Z-Y-X from north-east-down.
"""

from __future__ import annotations

import numpy as np

from uavgram.geometry.motion.rotation import matrix_from_ypr, ypr_from_matrix
from uavgram.model.arrays import Floats

BODY_FROM_GIMBAL: Floats = matrix_from_ypr(0.0, -np.pi / 2, 0.0)
"""A gimbal that looks down from a level body, image up to its front."""


def gimbal_from_nadir(ypr_rad: Floats) -> Floats:
    """Turn nadir angles (N, 3) into gimbal angles (N, 3), yaw-pitch-roll [rad]; NaN stays."""
    ned_from_body = matrix_from_ypr(*np.asarray(ypr_rad, np.float64).T)
    return _angles(ned_from_body @ BODY_FROM_GIMBAL, ypr_rad)


def nadir_from_gimbal(ypr_rad: Floats) -> Floats:
    """Turn gimbal angles (N, 3) into nadir angles (N, 3), yaw-pitch-roll [rad]; NaN stays."""
    ned_from_gimbal = matrix_from_ypr(*np.asarray(ypr_rad, np.float64).T)
    return _angles(ned_from_gimbal @ BODY_FROM_GIMBAL.T, ypr_rad)


def _angles(rotation: Floats, given: Floats) -> Floats:
    known = np.asarray(np.isfinite(given).all(axis=1))
    angles = np.stack(ypr_from_matrix(rotation), axis=1)
    return np.asarray(np.where(known[:, None], angles, np.nan))
