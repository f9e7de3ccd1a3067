"""Motion of a camera: its pose from telemetry and shared unknowns, and rows of a rolling shutter.

The pose follows from telemetry. With the vehicle at p (world), its attitude Rb (world from body),
the mount's attitude Rm (world from gimbal, or Rb again for a camera fixed to the body) and the
nominal C (mount from camera)::

    center            = p(t) - position_bias + Rz Rb(t) lever_arm
    world_from_camera = Rz Rm(t) C exp(boresight)

    Rz = rotation by +heading_bias about up,   t = s - clock correction - clock drift (s - middle)

with s the stated instant and the middle instant of the survey's exposures, at which a drift does
not change the clock correction.

Biases are log minus truth. Headings run clockwise, rotations about up counterclockwise: removing a
heading bias turns the vehicle by plus this angle about up.

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

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from uavgram.geometry.motion.interpolation import SmoothPositions, SmoothRotations
from uavgram.geometry.motion.rotation import (
    cross,
    exp_with_right_jacobian,
    hat,
    log_so3,
    matrix_from_ypr,
    ypr_from_matrix,
)
from uavgram.model.arrays import Floats
from uavgram.model.flight_log import Track
from uavgram.model.frames import Flight, PhotoExposures, TelemetryPrior

UP = np.array([0.0, 0.0, 1.0])

BORESIGHT = slice(0, 3)
LEVER_ARM = slice(3, 6)
POSITION_BIAS = slice(6, 9)
HEADING_BIAS = slice(9, 10)
CLOCK = slice(10, 11)
CLOCK_DRIFT = slice(11, 12)
SHARED_SIZE = 12


class Exposures(NamedTuple):
    """Flight interpolated at N instants.

    Attributes
    ----------
    position
        (N, 3) vehicle in the world [m].
    velocity
        (N, 3) its velocity [m/s].
    world_from_body
        (N, 3, 3) rotations.
    body_rate
        (N, 3) angular velocity in body axes [rad/s].
    world_from_mount
        (N, 3, 3) rotations of the gimbal or body that the camera is fixed to.
    mount_rate
        (N, 3) its angular velocity in its own axes [rad/s].
    """

    position: Floats
    velocity: Floats
    world_from_body: Floats
    body_rate: Floats
    world_from_mount: Floats
    mount_rate: Floats


class FlightPath:
    """Flight between the samples of its log.

    Parameters
    ----------
    position_track
        (times [s], (n, 3) positions in the world [m]).
    attitude_track, gimbal_track
        (times [s], (n, 4) unit quaternions xyzw to the world); an empty gimbal track means a camera
        fixed to the body.

    Raises
    ------
    ValueError
        The times of a track do not increase.
    """

    def __init__(
        self,
        position_track: tuple[Floats, Floats],
        attitude_track: tuple[Floats, Floats],
        gimbal_track: tuple[Floats, Floats],
    ) -> None:
        self._position = SmoothPositions(*position_track)
        self._body = SmoothRotations(*attitude_track)
        self._gimbal = SmoothRotations(*gimbal_track) if len(gimbal_track[0]) else None

    def at(self, at_s: Floats) -> Exposures:
        """Interpolate the flight at instants (..., N) on its clock.

        Raises
        ------
        ValueError
            An instant is outside a track.
        """
        flat = at_s.ravel()
        position, velocity = self._position.at(flat)
        body, body_rate = self._body.at(flat)
        mount, mount_rate = self._gimbal.at(flat) if self._gimbal else (body, body_rate)
        found = (position, velocity, body, body_rate, mount, mount_rate)
        return Exposures(*(one.reshape(*at_s.shape, *one.shape[1:]) for one in found))


def exposures_by_time(flight: Flight, frame_id: Sequence[str]) -> Callable[[Floats], Exposures]:
    """Return the exposures of N frames as a function of instants (N,) on the flight's clock.

    They are interpolated in a track. Exposures that came with the photos are constant: the instants
    do not change them. The function raises ValueError where an instant is outside the track.
    """
    if not isinstance(flight, PhotoExposures):
        path = FlightPath(
            (flight.position_time_s, flight.position_world_m),
            (flight.attitude_time_s, flight.world_from_body_xyzw),
            (flight.gimbal_time_s, flight.world_from_gimbal_xyzw),
        )
        return path.at
    row = {name: k for k, name in enumerate(flight.frame_id)}
    index = [row[name] for name in frame_id]
    still = np.zeros((len(index), 3))
    exposures = Exposures(
        position=flight.position_world_m[index],
        velocity=still,
        world_from_body=flight.world_from_body[index],
        body_rate=still,
        world_from_mount=flight.world_from_gimbal[index],
        mount_rate=still,
    )
    return lambda _: exposures


def correct_time(shared: Floats, time_s: Floats, middle_s: float) -> Floats:
    """Apply clock correction and drift to stated instants.

    The result is (..., N) on the flight's clock [s].

    Parameters
    ----------
    shared
        (..., 12) unknowns of the telemetry, see `predict_pose`.
    time_s
        (N,) stated instants.
    middle_s
        Middle of the survey's exposures, at which a drift does not change the correction.
    """
    since_middle = time_s - middle_s
    return np.asarray(time_s - shared[..., CLOCK] - shared[..., CLOCK_DRIFT] * since_middle)


def predict_pose(
    exposures: Exposures, mount_from_camera: Floats, shared: Floats, since_middle_s: Floats
) -> tuple[Floats, Floats, Floats]:
    """Predict camera poses from the telemetry, with derivatives by the shared unknowns.

    Parameters
    ----------
    exposures
        N instants, interpolated at the `correct_time` of the stated ones.
    mount_from_camera
        (3, 3) nominal rotation, without boresight.
    shared
        (..., 12) boresight [rad], lever arm [m], position bias [m], heading bias [rad], clock
        correction [s], clock drift [s/s]; see the slices of this module. The clock acts through
        `exposures` and is not used here.
    since_middle_s
        (N,) stated instants less the middle of the survey's exposures.

    Returns
    -------
    center_world : (..., N, 3)
    world_from_camera : (..., N, 3, 3)
    jacobian : (..., N, 6, 12)
        Derivative of (δcentre in world, δθ in camera with R exp(δθ)) by the shared unknowns.
    """
    # Rotations of heading and boresight in one call.
    vectors = np.stack([shared[..., HEADING_BIAS] * UP, shared[..., BORESIGHT]], axis=-2)
    turns, by_vector = exp_with_right_jacobian(vectors)
    turn = turns[..., :1, :, :]
    lever = shared[..., None, LEVER_ARM, None]
    arm = turn @ exposures.world_from_body
    offset = (arm @ lever)[..., 0]
    center = exposures.position - shared[..., None, POSITION_BIAS] + offset
    camera_in_mount = mount_from_camera @ turns[..., 1, :, :]
    rotation = turn @ exposures.world_from_mount @ camera_in_mount[..., None, :, :]

    jacobian = np.zeros((*center.shape[:-1], 6, SHARED_SIZE))
    jacobian[..., :3, LEVER_ARM] = arm
    jacobian[..., :3, POSITION_BIAS] = -np.eye(3)
    jacobian[..., 0, 9], jacobian[..., 1, 9] = -offset[..., 1], offset[..., 0]  # up x offset
    # Clock: at t - clock the vehicle was further back on its path and in its rotation.
    spin = (hat(exposures.body_rate) @ lever)[..., 0]
    jacobian[..., :3, 10] = -exposures.velocity - np.einsum("...ij,...j->...i", arm, spin)
    jacobian[..., 3:, BORESIGHT] = by_vector[..., 1:, :, :]
    jacobian[..., 3:, 9] = rotation[..., 2, :]  # up, in camera axes
    jacobian[..., 3:, 10] = -exposures.mount_rate @ camera_in_mount
    jacobian[..., 11] = jacobian[..., 10] * since_middle_s[:, None]
    return center, rotation, jacobian


def compute_row_share(row_px: Floats, height_px: int) -> Floats:
    """Compute exposure times (...) of rows since the middle row, in units of the readout time.

    They are about -1/2 to 1/2.
    """
    return np.asarray((row_px - (height_px - 1) / 2) / height_px)


def rotate_vector(turn: Floats, vector: Floats) -> Floats:
    """Compute exp(turn) vector (..., 3) by Rodrigues' formula, without a matrix for each."""
    angle = np.linalg.norm(turn, axis=-1)[..., None]
    across = cross(turn, vector)
    once = np.sinc(angle / np.pi)
    twice = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2  # (1 - cos a) / a^2
    return np.asarray(vector + once * across + twice * cross(turn, across))


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
