"""Poses of the photos themselves (EXIF, XMP, MRK, geo.txt, CSV) in the local world.

Default standard deviations where a source states none. Position: 3 m, a consumer receiver's.
Attitude: 3 degrees of tilt and of yaw; against surveyed targets a Mavic's gimbal pitch was 3.2
degrees off, its compass 2.3 (Narrabeen, resection of the targets).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from uavgram.errors import UavgramError
from uavgram.geometry.earth.geodesy import Origin, enu_from_geodetic
from uavgram.geometry.motion.rotation import ENU_FROM_NED, matrix_from_ypr
from uavgram.model.arrays import Bools, Floats
from uavgram.model.flight.pose import PhotoExposures, PhotoPoses
from uavgram.model.message import Message
from uavgram.model.options import MountOptions, TelemetryOptions
from uavgram.stages.seed.stated_mount import apply_stated_mount

HORIZONTAL_SIGMA_M, VERTICAL_SIGMA_M = 3.0, 3.0
TILT_SIGMA_DEG, YAW_SIGMA_DEG = 3.0, 3.0
# A fixed camera tilts with the vehicle, and a vehicle crabs in the wind. At a turn the course
# before and the one after differ, and the photo may have either.
COURSE_TILT_SIGMA_DEG, COURSE_YAW_SIGMA_DEG, TURN_YAW_SIGMA_DEG = 6.0, 15.0, 30.0
UNKNOWN_YAW_SIGMA_DEG = 180.0
UNKNOWN_HEIGHT_SIGMA_M = 1000.0
DEFAULT_HEIGHT_M = 60.0
"""Usual flying height of a survey by drone [m]: the law limits it to 120 m in most countries, and
few fly below 20 m."""
CLOSE_S = 5.0
"""Time from photo to photo [s] up to which a drone is assumed to fly along its nose."""
_TURN_DEG = 30.0
_DROWNED = 10.0  # times the positions' own sigma
_SHORTEST_LEG_SIGMAS = 3.0  # of one position; the course of a shorter leg is noise


def find_photo_home(poses: PhotoPoses) -> tuple[Origin, tuple[Message, ...]]:
    """Return the take-off point by the photos: below the first one, by its height above take-off.

    Raises
    ------
    UavgramError
        No photo has a height above take-off.
    """
    take_off_m = poses.height_m - poses.height_home_m
    if not np.isfinite(take_off_m).any():  # no valid altitude: heights count from take-off
        take_off_m = 0.0 * poses.height_home_m
    known = np.flatnonzero(np.isfinite(take_off_m))
    if not known.size:
        raise UavgramError(
            f"{poses.source} states no height above take-off that can be right, so there is no "
            "home: set world.origin to a latitude, longitude and the height of the ground, in the "
            f"datum of world.heights (these poses are {poses.datum})"
        )
    k = int(known[0])
    height = float(take_off_m[k])
    text = (
        f"The world's origin is below the first photo ({poses.frame_id[k]}) at the height of "
        f"take-off ({height:.2f} m {poses.datum}): altitude minus height above take-off. The "
        "ground is taken to be there up to ground.height_sigma_m; where it is not, set "
        "ground.height_m or world.origin."
    )
    origin = (float(poses.latitude_deg[k]), float(poses.longitude_deg[k]), height)
    return origin, (Message("info", "origin-first-photo", text),)


def place_photos(
    poses: PhotoPoses,
    origin: Origin,
    mount: MountOptions,
    telemetry: TelemetryOptions,
    file_time_s: Floats | None = None,
) -> tuple[PhotoExposures, tuple[Message, ...]]:
    """Convert the photos' poses to exposures in the local world.

    Photos without attitude look as `mount` states from a level vehicle. Where they follow each
    other within seconds, its heading is the course from photo to photo, with wide sigmas; otherwise
    it is unknown (north, with a sigma of 180 degrees), and the picks have to determine it.

    Parameters
    ----------
    poses
        Poses as read, in the order in which they were taken (or of their names).
    origin
        Origin of the world: latitude, longitude [deg], height [m] in the poses' datum.
    mount, telemetry
        Nominal view, and sigmas where they are not ``auto``.
    file_time_s
        (N,) times of the photos by their files, on one clock; NaN where unknown. Used where `poses`
        has no times of its own.
    """
    height, is_known = _heights(poses, origin)
    position = enu_from_geodetic(poses.latitude_deg, poses.longitude_deg, height, origin)
    sigma_position = _position_sigmas(poses, telemetry)
    sigma_position[~is_known, 1] = UNKNOWN_HEIGHT_SIGMA_M
    has_attitude = np.asarray(np.isfinite(poses.ypr_rad).all(axis=1))
    time_s = _times(poses, file_time_s)
    # Heading of the vehicle: stated, by its attitude, or the course between photos.
    course, turning = _courses_in_time(time_s, position, sigma_position)
    nose = poses.vehicle_ypr_rad[:, 0]
    course, turning = np.where(np.isfinite(nose), nose, course), turning & np.isnan(nose)
    heading = np.where(has_attitude & np.isnan(nose), poses.ypr_rad[:, 0], course)
    ypr, stated = apply_stated_mount(mount, poses.ypr_rad, heading, poses.source)
    messages = (*_messages(poses, has_attitude, course), *stated)
    ned_from_body = _vehicle(poses, heading)
    # Attitude of the camera: stated, or by the mount on a level vehicle.
    ned_from_gimbal = matrix_from_ypr(*np.nan_to_num(ypr).T)
    guessed = _level(heading) @ matrix_from_ypr(*np.radians(mount.angles_deg()))
    ned_from_gimbal = np.where(has_attitude[:, None, None], ned_from_gimbal, guessed)
    exposures = PhotoExposures(
        frame_id=poses.frame_id,
        position_world_m=position,
        world_from_body=ENU_FROM_NED @ ned_from_body,
        world_from_gimbal=ENU_FROM_NED @ ned_from_gimbal,
        sigma_position_m=sigma_position,
        sigma_attitude_rad=_attitude_sigmas(poses, telemetry, has_attitude, course, turning),
        by_course=~has_attitude,
        source=poses.source,
    )
    return exposures, (*messages, *_bias_hint(sigma_position, telemetry))


def _bias_hint(sigma_position: Floats, telemetry: TelemetryOptions) -> Iterator[Message]:
    """Report a common bias, as of a consumer receiver, that hides the precision of RTK."""
    horizontal, vertical = np.median(sigma_position, axis=0)
    bias = telemetry.position_bias_sigma_m
    if bias[0] < _DROWNED * horizontal:
        return
    text = (
        "The photos' positions are better than the project lets them be: they "
        f"state {horizontal:.2f} m horizontal and {vertical:.2f} m vertical, "
        f"but telemetry.position_bias_sigma_m lets all of them be off together by {bias[0]:g} and "
        f"{bias[1]:g} m: with a base station of known place, set it to [{horizontal:.2f}, "
        f"{vertical:.2f}]."
    )
    yield Message("info", "position-bias-wide", text)


def _vehicle(poses: PhotoPoses, heading: Floats) -> Floats:
    """Return the vehicle's attitudes (N, 3, 3); level where unknown."""
    stated = poses.vehicle_ypr_rad
    known = np.asarray(np.isfinite(stated).all(axis=1))[:, None, None]
    return np.where(known, matrix_from_ypr(*np.nan_to_num(stated).T), _level(heading))


def _level(heading: Floats) -> Floats:
    """Return level attitudes (N, 3, 3); to the north where the heading is unknown."""
    yaw = np.nan_to_num(heading)
    return matrix_from_ypr(yaw, np.zeros_like(yaw), np.zeros_like(yaw))


def _heights(poses: PhotoPoses, origin: Origin) -> tuple[Floats, Bools]:
    """Return heights (N,) in the poses' datum [m], and the mask of known ones (any reference).

    Unknown heights are replaced by those of the other photos, or usual ones.
    """
    take_off = poses.height_m - poses.height_home_m
    take_off = take_off[np.isfinite(take_off)]
    home = np.median(take_off) if take_off.size else origin[2]
    height = np.where(np.isfinite(poses.height_m), poses.height_m, home + poses.height_home_m)
    known = np.isfinite(height)
    usual = np.median(height[known]) if known.any() else origin[2] + DEFAULT_HEIGHT_M
    return np.where(known, height, usual), known


def _times(poses: PhotoPoses, file_time_s: Floats | None) -> Floats:
    """Return instants (N,) on one clock: the source's own, or the files'; NaN if incomplete."""
    if np.isfinite(poses.time_utc_s).all() or file_time_s is None:
        return poses.time_utc_s
    return file_time_s


def _courses_in_time(
    time_s: Floats, position: Floats, sigma_position: Floats
) -> tuple[Floats, Bools]:
    """Compute courses (N,) [rad from north] of close photos, otherwise NaN; and mark turns."""
    course = np.full(len(time_s), np.nan)
    turning = np.zeros(len(time_s), dtype=np.bool_)
    known = np.flatnonzero(np.isfinite(time_s))
    order = known[np.argsort(time_s[known], kind="stable")]
    if len(order) > 1:
        close = np.diff(time_s[order]) <= CLOSE_S
        course[order], turning[order] = _courses(
            position[order, :2], sigma_position[order, 0], close
        )
    return course, turning


def _messages(poses: PhotoPoses, has_attitude: Bools, course: Floats) -> Iterator[Message]:
    """Report the assumptions on photos without attitude."""
    guessed = ~has_attitude & np.isfinite(course)
    unknown = np.flatnonzero(~has_attitude & np.isnan(course))
    way_out = "give yaw_deg, pitch_deg and roll_deg in a CSV file (`poses`)"
    if guessed.any():
        text = (
            f"{poses.source} has no attitude for {int(guessed.sum())} photos: their direction is "
            "assumed by `mount` from a level vehicle with the heading of its tags, or else along "
            f"the course from photo to photo (sigma {COURSE_TILT_SIGMA_DEG:g} degrees of tilt, "
            f"{COURSE_YAW_SIGMA_DEG:g} of yaw, {TURN_YAW_SIGMA_DEG:g} where the course turns). "
            f"If you know better, {way_out}."
        )
        frames = tuple(poses.frame_id[k] for k in np.flatnonzero(guessed))
        yield Message("warning", "attitude-from-course", text, frames=frames)
    if unknown.size:
        text = (
            f"{poses.source} has no attitude for {unknown.size} photos (the first is "
            f"{poses.frame_id[unknown[0]]}), and no other photo follows within {CLOSE_S:g} s that "
            "would give a course. Their direction is assumed by `mount` from a level vehicle "
            f"(sigma {COURSE_TILT_SIGMA_DEG:g} degrees of tilt); their heading is unknown. Only "
            "points that several photos share, or known points, determine it. Pick such points, or "
            f"{way_out}."
        )
        frames = tuple(poses.frame_id[k] for k in unknown)
        yield Message("warning", "attitude-unknown", text, frames=frames)


def _courses(position_m: Floats, sigma_m: Floats, close: Bools) -> tuple[Floats, Bools]:
    """Compute courses (N,) [rad from north] through points (N, 2) in order, and mark turns.

    Only legs that are flown within seconds count, `close` (N - 1,): over a longer time a drone may
    turn freely.

    The course is the mean direction of the legs before and after; of a single leg, its own; where
    both differ by more than a turn, that of the shorter one, which is within a flight line.
    """
    legs = np.diff(position_m, axis=0)
    length = np.hypot(*legs.T)
    good = close & (length > _SHORTEST_LEG_SIGMAS * np.maximum(sigma_m[:-1], sigma_m[1:]))
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
    """Return horizontal and vertical sigmas (N, 2) [m]."""
    count = len(poses.frame_id)
    if options.position_sigma_m != "auto":
        return np.tile(np.array(options.position_sigma_m), (count, 1))
    stated = np.stack([poses.sigma_horizontal_m, poses.sigma_vertical_m], axis=1)
    return np.where(np.isfinite(stated), stated, [HORIZONTAL_SIGMA_M, VERTICAL_SIGMA_M])


def _attitude_sigmas(
    poses: PhotoPoses,
    options: TelemetryOptions,
    has_attitude: Bools,
    course: Floats,
    turning: Bools,
) -> Floats:
    """Return sigmas (N, 2) of roll and pitch, and of yaw [rad]; guesses keep their wide sigmas."""
    stated = poses.sigma_attitude_rad[:, None]
    sigma = np.where(np.isfinite(stated), stated, np.radians([TILT_SIGMA_DEG, YAW_SIGMA_DEG]))
    yaw = np.where(turning, TURN_YAW_SIGMA_DEG, COURSE_YAW_SIGMA_DEG)
    yaw = np.where(np.isfinite(course), yaw, UNKNOWN_YAW_SIGMA_DEG)
    tilt = COURSE_TILT_SIGMA_DEG
    if options.attitude_sigma_deg != "auto":
        sigma = np.tile(np.radians(options.attitude_sigma_deg), (len(poses.frame_id), 1))
        tilt, yaw = options.attitude_sigma_deg[0], np.maximum(yaw, options.attitude_sigma_deg[1])
    guessed = np.radians(np.stack([np.full_like(yaw, tilt), yaw], axis=1))
    return np.where(has_attitude[:, None], sigma, guessed)
