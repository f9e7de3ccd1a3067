"""How a camera moved at its exposures, by the flight."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uavgram.geometry.motion.rotation import log_so3
from uavgram.geometry.motion.telemetry_pose import corrected_time, exposures_by_time, predict_pose
from uavgram.model.arrays import Floats
from uavgram.model.flight.log import Track
from uavgram.model.flight.pose import TelemetryPrior

HALF_SPAN_S = 0.015
"""Between the poses that are compared: a usual readout of 30 ms, over which rates are means."""


def camera_motion(
    track: Track, prior: TelemetryPrior, frame_id: Sequence[str], shared: Floats
) -> Floats:
    """(N, 6) velocity in the world [m/s] and angular rate in camera axes [rad/s].

    Central differences of the camera's own poses, so a gimbal's turns count and the body's do not.
    None (0) of a frame that a corrected clock puts outside the track.

    Parameters
    ----------
    track
        The flight.
    prior
        Of N frames: their instants, and how the camera sits in its mount.
    frame_id
        (N,) their names.
    shared
        (12,) unknowns of the telemetry, see `predict_pose`.
    """
    at_s = corrected_time(shared, prior.time_s, prior.middle_s)
    times = [track.position_time_s, track.attitude_time_s]
    times += [track.gimbal_time_s] if len(track.gimbal_time_s) else []
    first, last = max(one[0] for one in times), min(one[-1] for one in times)
    before, after = (np.clip(at_s + side, first, last) for side in (-HALF_SPAN_S, HALF_SPAN_S))
    poses = exposures_by_time(track, frame_id)
    since_middle = prior.time_s - prior.middle_s
    start, from_start, _ = predict_pose(
        poses(before), prior.gimbal_from_camera, shared, since_middle
    )
    end, from_end, _ = predict_pose(poses(after), prior.gimbal_from_camera, shared, since_middle)
    turn = log_so3(np.swapaxes(from_start, 1, 2) @ from_end)
    span_s = (after - before)[:, None]
    known = span_s > 0
    moved = np.concatenate([end - start, turn], axis=1)
    return np.asarray(np.where(known, moved, 0.0) / np.where(known, span_s, 1.0))
