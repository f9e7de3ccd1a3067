"""Poses of the photos themselves (EXIF, XMP, MRK, geo.txt, CSV) in the local world.

Standard deviations where a source states none. Position: 3 m, a consumer receiver's. Attitude:
3 degrees of tilt and of yaw; against surveyed targets a Mavic's gimbal pitch was 3.2 degrees off,
its compass 2.3 (Narrabeen, resection of the targets).
"""

from __future__ import annotations

import numpy as np

from uavgram.errors import UavgramError
from uavgram.geometry.geodesy import Origin, enu_from_geodetic
from uavgram.geometry.rotation import ENU_FROM_NED, matrix_from_ypr
from uavgram.model.arrays import Bools, Floats
from uavgram.model.message import Message
from uavgram.model.options import MountOptions, TelemetryOptions
from uavgram.model.photo_poses import PhotoExposures, PhotoPoses

HORIZONTAL_SIGMA_M, VERTICAL_SIGMA_M = 3.0, 3.0
TILT_SIGMA_DEG, YAW_SIGMA_DEG = 3.0, 3.0
# A fixed camera tilts with the vehicle, and a vehicle crabs in the wind. At a turn the course
# before and the one after differ, and nobody says which of them the photo has.
COURSE_TILT_SIGMA_DEG, COURSE_YAW_SIGMA_DEG, TURN_YAW_SIGMA_DEG = 6.0, 15.0, 30.0
_TURN_DEG = 30.0
_LARGEST_TILT_WITHOUT_YAW_DEG = 30.0
_DROWNED = 10.0  # times the positions' own sigma
_SHORTEST_LEG_SIGMAS = 3.0  # of one position: below, the course is noise


def find_photo_home(poses: PhotoPoses) -> tuple[Origin, tuple[Message, ...]]:
    """Take-off as the photos know it: below the first one, by its height above take-off.

    Raises
    ------
    UavgramError
        No photo has a height above take-off.
    """
    known = np.flatnonzero(np.isfinite(poses.height_home_m))
    if not known.size:
        raise UavgramError(
            f"{poses.source} says nothing of the height above take-off, so there is no home: set "
            "world.origin to a latitude, longitude and the height of the ground, in the datum of "
            f"world.heights (these poses are {poses.datum})"
        )
    k = int(known[0])
    height = float(poses.height_m[k] - poses.height_home_m[k])
    text = (
        f"The world's origin lies below the first photo ({poses.frame_id[k]}) at the height of "
        f"take-off ({height:.2f} m {poses.datum}): altitude minus height above take-off. The "
        "ground is taken to be there up to ground.height_sigma_m; where it is not, set "
        "ground.height_m or world.origin."
    )
    origin = (float(poses.latitude_deg[k]), float(poses.longitude_deg[k]), height)
    return origin, (Message("info", "origin-first-photo", text),)


def place_photos(
    poses: PhotoPoses, origin: Origin, mount: MountOptions, telemetry: TelemetryOptions
) -> tuple[PhotoExposures, tuple[Message, ...]]:
    """Turn the photos' poses into exposures in the local world.

    Photos without attitude look as `mount` says from a level vehicle; its heading is the course
    from photo to photo, with wide sigmas. Those without a course either are left out.

    Parameters
    ----------
    poses
        As read, in the order in which they were taken (or of their names).
    origin
        Of the world: latitude, longitude [deg], height [m] in the poses' datum.
    mount, telemetry
        Nominal view, and sigmas where they are not ``auto``.

    Raises
    ------
    UavgramError
        Photos have no attitude, and the camera is too oblique for a guess of it, or no photo has
        a neighbour that would give a course.
    """
    position = enu_from_geodetic(poses.latitude_deg, poses.longitude_deg, poses.height_m, origin)
    sigma_position = _position_sigmas(poses, telemetry)
    has_attitude = np.asarray(np.isfinite(poses.ypr_rad).all(axis=1))
    heading, turning, messages = _headings(poses, position, sigma_position, has_attitude, mount)
    ned_from_body = _vehicle(poses, heading, has_attitude)
    ned_from_gimbal = matrix_from_ypr(*np.nan_to_num(poses.ypr_rad).T)
    mount_ypr = np.radians([mount.yaw_deg, mount.pitch_deg, mount.roll_deg])
    guessed = ned_from_body @ matrix_from_ypr(*mount_ypr)
    ned_from_gimbal = np.where(has_attitude[:, None, None], ned_from_gimbal, guessed)
    sigma_attitude = _attitude_sigmas(poses, telemetry, has_attitude, turning)
    keep = has_attitude | np.isfinite(heading)
    exposures = PhotoExposures(
        frame_id=tuple(poses.frame_id[k] for k in np.flatnonzero(keep)),
        position_world_m=position[keep],
        world_from_body=(ENU_FROM_NED @ ned_from_body)[keep],
        world_from_gimbal=(ENU_FROM_NED @ ned_from_gimbal)[keep],
        sigma_position_m=sigma_position[keep],
        sigma_attitude_rad=sigma_attitude[keep],
        by_course=~has_attitude[keep],
        source=poses.source,
    )
    return exposures, (*messages, *_bias_hint(sigma_position[keep], telemetry))


def _bias_hint(sigma_position: Floats, telemetry: TelemetryOptions) -> tuple[Message, ...]:
    """Say so where a common bias as of a consumer receiver drowns what RTK knows."""
    horizontal, vertical = np.median(sigma_position, axis=0)
    bias = telemetry.position_bias_sigma_m
    if bias[0] < _DROWNED * horizontal:
        return ()
    text = (
        f"The photos' positions state {horizontal:.2f} m horizontal and {vertical:.2f} m vertical, "
        f"but telemetry.position_bias_sigma_m lets all of them be off together by {bias[0]:g} and "
        f"{bias[1]:g} m: with a base station of known place, set it to [{horizontal:.2f}, "
        f"{vertical:.2f}]"
    )
    return (Message("info", "position-bias-wide", text),)


def _vehicle(poses: PhotoPoses, heading: Floats, has_attitude: Bools) -> Floats:
    """(N, 3, 3) the vehicle's attitude; where unknown level, with the camera's or course's yaw."""
    stated = poses.vehicle_ypr_rad
    known = np.asarray(np.isfinite(stated).all(axis=1))
    yaw = np.nan_to_num(np.where(has_attitude, poses.ypr_rad[:, 0], heading))
    level = np.stack([yaw, np.zeros_like(yaw), np.zeros_like(yaw)], axis=1)
    return matrix_from_ypr(*np.where(known[:, None], stated, level).T)


def _headings(
    poses: PhotoPoses,
    position: Floats,
    sigma_position: Floats,
    has_attitude: Bools,
    mount: MountOptions,
) -> tuple[Floats, Bools, tuple[Message, ...]]:
    """Course (N,) from photo to photo [rad from north], NaN where there is none; if it turns."""
    without = np.flatnonzero(~has_attitude)
    if not without.size:
        return np.full(len(position), np.nan), np.zeros(len(position), dtype=np.bool_), ()
    way_out = "give yaw_deg, pitch_deg and roll_deg in a CSV file (`poses`), or leave `poses` out"
    if abs(mount.pitch_deg + 90.0) > _LARGEST_TILT_WITHOUT_YAW_DEG:
        raise UavgramError(
            f"{poses.source} has no attitude for {len(without)} photos (the first is "
            f"{poses.frame_id[without[0]]}), and mount.pitch_deg {mount.pitch_deg:g} looks too far "
            f"from straight down to do without: {way_out}"
        )
    order = np.arange(len(position))
    if np.isfinite(poses.time_utc_s).all():
        order = np.argsort(poses.time_utc_s, kind="stable")
    course, turning = np.empty(len(order)), np.empty(len(order), dtype=np.bool_)
    course[order], turning[order] = _courses(position[order, :2], sigma_position[order, 0])
    lost = without[np.isnan(course[without])]
    if lost.size == len(order):
        raise UavgramError(
            f"{poses.source} has no attitude, and its photos lie too close together for a course: "
            f"{way_out}"
        )
    text = (
        f"{poses.source} has no attitude for {len(without) - len(lost)} photos: they look as "
        "`mount` says from a level vehicle that heads along the course from photo to photo (sigma "
        f"{COURSE_TILT_SIGMA_DEG:g} degrees of tilt, {COURSE_YAW_SIGMA_DEG:g} of yaw, "
        f"{TURN_YAW_SIGMA_DEG:g} where the course turns)"
    )
    messages = [Message("warning", "attitude-from-course", text)]
    if lost.size:
        text = (
            f"{len(lost)} photos (the first is {poses.frame_id[lost[0]]}) have neither attitude "
            f"nor a neighbour far enough for a course, and were left out: {way_out}"
        )
        messages.append(Message("warning", "attitude-unknown", text))
    return course, turning, tuple(messages)


def _courses(position_m: Floats, sigma_m: Floats) -> tuple[Floats, Bools]:
    """Courses (N,) [rad from north] through points (N, 2) in order, and where they turn.

    The mean direction of the leg before and the one after; of a single leg, its own; where both
    differ by more than a turn, the shorter one, which lies within a flight line.
    """
    legs = np.diff(position_m, axis=0)
    length = np.hypot(*legs.T)
    good = length > _SHORTEST_LEG_SIGMAS * np.maximum(sigma_m[:-1], sigma_m[1:])
    unit = np.where(good[:, None], legs / np.where(length > 0, length, 1.0)[:, None], 0.0)
    none = np.zeros((1, 2))
    before, after = np.vstack([none, unit]), np.vstack([unit, none])
    both = before.any(axis=1) & after.any(axis=1)
    turning = both & (np.sum(before * after, axis=1) < np.cos(np.radians(_TURN_DEG)))
    infinite = np.array([np.inf])
    previous = np.concatenate([infinite, length])
    shorter = np.where((previous <= np.concatenate([length, infinite]))[:, None], before, after)
    direction = np.where(turning[:, None], shorter, before + after)
    course = np.arctan2(direction[:, 0], direction[:, 1])
    return np.where(direction.any(axis=1), course, np.nan), turning


def _position_sigmas(poses: PhotoPoses, options: TelemetryOptions) -> Floats:
    """(N, 2) horizontal and vertical [m]."""
    count = len(poses.frame_id)
    if options.position_sigma_m != "auto":
        return np.tile(np.array(options.position_sigma_m), (count, 1))
    stated = np.stack([poses.sigma_horizontal_m, poses.sigma_vertical_m], axis=1)
    return np.where(np.isfinite(stated), stated, [HORIZONTAL_SIGMA_M, VERTICAL_SIGMA_M])


def _attitude_sigmas(
    poses: PhotoPoses, options: TelemetryOptions, has_attitude: Bools, turning: Bools
) -> Floats:
    """(N, 2) of roll and pitch, and of yaw [rad]."""
    defaults = np.radians([TILT_SIGMA_DEG, YAW_SIGMA_DEG])
    if options.attitude_sigma_deg != "auto":
        sigma = np.tile(np.radians(options.attitude_sigma_deg), (len(poses.frame_id), 1))
    else:
        stated = poses.sigma_attitude_rad[:, None]
        sigma = np.where(np.isfinite(stated), stated, defaults)
    yaw = np.where(turning, TURN_YAW_SIGMA_DEG, COURSE_YAW_SIGMA_DEG)
    by_course = np.radians(np.stack([np.full_like(yaw, COURSE_TILT_SIGMA_DEG), yaw], axis=1))
    return np.where(has_attitude[:, None], sigma, by_course)
