"""Motion of a camera during the readout of its rows, and conversion of its angles.

Row v of a photo of height h is exposed at time + readout * share(v), with share(v) = (v - (h - 1) /
2) / h: the stated instant is that of the middle row. Within one photo the camera is assumed to move
steadily (Hedborg et al. 2012, "Rolling shutter bundle adjustment")::

    centre(v)            = centre + share sweep[:3]
    world_from_camera(v) = world_from_camera exp(share sweep[3:])

with the sweep readout * (velocity in the world, angular rate in camera axes).

Gimbal angles (DJI, MAVLink, this program): yaw, pitch, roll of a frame whose x is the optical axis
and whose -z is image up; pitch -90 degrees looks straight down.

Nadir angles (Pix4D, OpenDroneMap): yaw, pitch, roll of a body under which the camera looks down,
the top of the image to the front; pitch 0 looks straight down, 90 degrees forward (Pix4D, "Yaw,
Pitch, Roll and Omega, Phi, Kappa angles"; OpenDroneMap, opendm/photo.py: "Pitch: 0 --> nadir
camera"). Both turn Z-Y-X from north-east-down.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uavgram.geometry.motion.rotation import log_so3, matrix_from_ypr, ypr_from_matrix
from uavgram.geometry.motion.telemetry_pose import correct_time, exposures_by_time, predict_pose
from uavgram.model.arrays import Floats
from uavgram.model.flight_log import Track
from uavgram.model.frames import TelemetryPrior


def compute_row_share(row_px: Floats, height_px: int) -> Floats:
    """Compute exposure times (...) of rows since the middle row, in units of the readout time.

    They are about -1/2 to 1/2.
    """
    return np.asarray((row_px - (height_px - 1) / 2) / height_px)


def rotate_vector(turn: Floats, vector: Floats) -> Floats:
    """Compute exp(turn) vector (..., 3) by Rodrigues' formula, without a matrix for each."""
    angle = np.linalg.norm(turn, axis=-1)[..., None]
    across = np.cross(turn, vector)
    once = np.sinc(angle / np.pi)
    twice = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2  # (1 - cos a) / a^2
    return np.asarray(vector + once * across + twice * np.cross(turn, across))


BODY_FROM_GIMBAL: Floats = matrix_from_ypr(0.0, -np.pi / 2, 0.0)
"""Rotation of a gimbal that looks down from a level body, image up to its front."""


def gimbal_from_nadir(ypr_rad: Floats) -> Floats:
    """Convert nadir angles (N, 3) to gimbal angles (N, 3), yaw-pitch-roll [rad]; NaN stays."""
    ned_from_body = matrix_from_ypr(*np.asarray(ypr_rad, np.float64).T)
    return _angles(ned_from_body @ BODY_FROM_GIMBAL, ypr_rad)


def nadir_from_gimbal(ypr_rad: Floats) -> Floats:
    """Convert gimbal angles (N, 3) to nadir angles (N, 3), yaw-pitch-roll [rad]; NaN stays."""
    ned_from_gimbal = matrix_from_ypr(*np.asarray(ypr_rad, np.float64).T)
    return _angles(ned_from_gimbal @ BODY_FROM_GIMBAL.T, ypr_rad)


def _angles(rotation: Floats, given: Floats) -> Floats:
    known = np.asarray(np.isfinite(given).all(axis=1))
    angles = np.stack(ypr_from_matrix(rotation), axis=1)
    return np.asarray(np.where(known[:, None], angles, np.nan))


HALF_SPAN_S = 0.015
"""Half the time between the two poses that are differenced.

The span is a usual readout of 30 ms, over which the rates are means.
"""


def camera_motion(
    track: Track, prior: TelemetryPrior, frame_id: Sequence[str], shared: Floats
) -> Floats:
    """Compute velocity in the world [m/s] and angular rate in camera axes [rad/s]; (N, 6).

    Central differences of the camera's own poses, so that turns of the gimbal are included. Zero
    for a frame that a corrected clock puts outside the track.

    Parameters
    ----------
    track
        Flight log.
    prior
        Instants of N frames, and the rotation of the camera in its mount.
    frame_id
        (N,) their names.
    shared
        (12,) unknowns of the telemetry, see `predict_pose`.
    """
    at_s = correct_time(shared, prior.time_s, prior.middle_s)
    times = [track.position_time_s, track.attitude_time_s]
    times += [track.gimbal_time_s] if len(track.gimbal_time_s) else []
    first, last = max(one[0] for one in times), min(one[-1] for one in times)
    # Poses a little before and after each exposure, within the span of the track.
    before, after = (np.clip(at_s + side, first, last) for side in (-HALF_SPAN_S, HALF_SPAN_S))
    poses = exposures_by_time(track, frame_id)
    since_middle = prior.time_s - prior.middle_s
    start, from_start, _ = predict_pose(
        poses(before), prior.gimbal_from_camera, shared, since_middle
    )
    end, from_end, _ = predict_pose(poses(after), prior.gimbal_from_camera, shared, since_middle)
    # Rotation vector between the two poses, in camera axes.
    turn = log_so3(np.swapaxes(from_start, 1, 2) @ from_end)
    span_s = (after - before)[:, None]
    known = span_s > 0
    moved = np.concatenate([end - start, turn], axis=1)
    return np.asarray(np.where(known, moved, 0.0) / np.where(known, span_s, 1.0))
