"""Poses stated by the photos (EXIF, XMP, MRK, geo.txt, CSV), or by a log without attitudes.

Default standard deviations where a source states none. Position: 3 m, a consumer receiver's.
Attitude: 3 degrees of tilt and of yaw; against surveyed targets a Mavic's gimbal pitch was 3.2
degrees off, its compass 2.3 (Narrabeen, resection of the targets).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from uavgram.errors import UavgramError
from uavgram.estimation.clocks.clock_line import convert_boot_to_utc
from uavgram.geometry.geodesy import Origin, enu_from_geodetic
from uavgram.geometry.motion.rotation import ENU_FROM_NED, matrix_from_ypr
from uavgram.model.arrays import Bools, Floats
from uavgram.model.flight_log import Boot, BootClock
from uavgram.model.frames import Frames, PhotoExposures, PhotoPoses
from uavgram.model.message import Message
from uavgram.model.naming import format_photo_count
from uavgram.model.options import MountOptions, TelemetryOptions
from uavgram.stages.seed.mount import apply_stated_mount

HORIZONTAL_SIGMA_M, VERTICAL_SIGMA_M = 3.0, 3.0
TILT_SIGMA_DEG, YAW_SIGMA_DEG = 3.0, 3.0
# A fixed camera tilts with the vehicle, and a gimbal follows its nose with some lag.
MOUNT_TILT_SIGMA_DEG, NOSE_YAW_SIGMA_DEG = 6.0, 15.0
UNKNOWN_YAW_SIGMA_DEG = 180.0
UNKNOWN_HEIGHT_SIGMA_M = 1000.0
DEFAULT_HEIGHT_M = 60.0
"""Usual flying height of a survey by drone [m]: the law limits it to 120 m in most countries, and
few fly below 20 m."""
_DROWNED = 10.0  # times the positions' own sigma


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


def refer_heights_to_control(
    poses: PhotoPoses, control_height_m: Floats, ground_height_m: float
) -> tuple[PhotoPoses, tuple[Message, ...]]:
    """Shift the photos' altitudes to the height reference of control points.

    Altitudes without RTK are off by tens of metres together, as they come from the barometer;
    heights above take-off are not. With the shift, the ground at the median control point is as
    high above take-off as the project states.

    Parameters
    ----------
    poses
        Poses as read.
    control_height_m
        Heights (C,) of control points, in the poses' datum.
    ground_height_m
        Height of the ground above the place of take-off.
    """
    take_off_m = poses.height_m - poses.height_home_m
    take_off_m = take_off_m[np.isfinite(take_off_m)]
    is_exact = not poses.datum_guess or np.isfinite(poses.sigma_vertical_m).any()
    if is_exact or not take_off_m.size or not control_height_m.size:
        return poses, ()
    shift_m = float(np.median(control_height_m) - np.median(take_off_m)) - ground_height_m
    text = (
        f"All altitudes of the photos were shifted by {shift_m:+.1f} m to the heights of the "
        "control points: without RTK they are off together by tens of metres, and heights above "
        f"take-off are not. The ground at the control points is taken to be {ground_height_m:g} m "
        "above take-off up to ground.height_sigma_m; where it is not, set ground.height_m."
    )
    shifted = replace(poses, height_m=poses.height_m + shift_m)
    return shifted, (Message("info", "heights-by-control", text),)


def place_photos(
    poses: PhotoPoses,
    origin: Origin,
    mount: MountOptions,
    telemetry: TelemetryOptions,
) -> tuple[PhotoExposures, tuple[Message, ...]]:
    """Convert the photos' poses to exposures in the local world.

    Photos without attitude look as `mount` states from a level vehicle; where it states no pitch,
    they are as steep as the other photos are on average. Where their tags do not state the heading
    of its nose, it is unknown (north, with a sigma of 180 degrees), and the picks have to determine
    it: the course is no evidence, as multicopters fly backwards and sideways too.

    Parameters
    ----------
    poses
        Poses as read.
    origin
        Origin of the world: latitude, longitude [deg], height [m] in the poses' datum.
    mount, telemetry
        Nominal view, and sigmas where they are not ``auto``.
    """
    height, is_known = _heights(poses, origin)
    position = enu_from_geodetic(poses.latitude_deg, poses.longitude_deg, height, origin)
    sigma_position = _position_sigmas(poses, telemetry)
    sigma_position[~is_known, 1] = UNKNOWN_HEIGHT_SIGMA_M
    has_attitude = np.asarray(np.isfinite(poses.ypr_rad).all(axis=1))
    # Heading of the vehicle: stated, or by the attitude of the camera.
    nose = poses.vehicle_ypr_rad[:, 0]
    heading = np.where(np.isnan(nose), poses.ypr_rad[:, 0], nose)
    ypr, stated = apply_stated_mount(mount, poses.ypr_rad, heading, poses.source)
    pitch, scatter = _guess_pitch_deg(ypr[has_attitude, 1], mount)
    messages = (*_messages(poses, has_attitude, scatter), *stated)
    ned_from_body = _vehicle(poses, heading)
    # Attitude of the camera: stated, or by the mount or the other photos on a level vehicle.
    ned_from_gimbal = matrix_from_ypr(*np.nan_to_num(ypr).T)
    guessed = _level(heading) @ matrix_from_ypr(*np.radians(mount.angles_deg((0.0, pitch, 0.0))))
    ned_from_gimbal = np.where(has_attitude[:, None, None], ned_from_gimbal, guessed)
    exposures = PhotoExposures(
        frame_id=poses.frame_id,
        position_world_m=position,
        world_from_body=ENU_FROM_NED @ ned_from_body,
        world_from_gimbal=ENU_FROM_NED @ ned_from_gimbal,
        sigma_position_m=sigma_position,
        sigma_attitude_rad=_attitude_sigmas(poses, telemetry, has_attitude, scatter),
        by_mount=~has_attitude,
        source=poses.source,
    )
    return exposures, (*messages, *_bias_hint(sigma_position, telemetry))


def _guess_pitch_deg(pitch_rad: Floats, mount: MountOptions) -> tuple[float, float]:
    """Return the pitch of photos without attitude, and its scatter among the others [deg].

    Parameters
    ----------
    pitch_rad
        (n,) pitch of the others; without any, that of the mount is taken.
    mount
        Mount of the camera.
    """
    if not len(pitch_rad):
        return mount.angles_deg()[1], 0.0
    return float(np.degrees(np.mean(pitch_rad))), float(np.degrees(np.std(pitch_rad)))


def _bias_hint(sigma_position: Floats, telemetry: TelemetryOptions) -> Iterator[Message]:
    """Report a common bias, as of a consumer receiver, that hides the precision of RTK."""
    horizontal, vertical = np.median(sigma_position, axis=0)
    bias = telemetry.position_bias_sigma_m
    if bias[0] < _DROWNED * horizontal:
        return
    text = (
        "The photos' positions are better than the project lets them be: they "
        f"state {horizontal:.2f} m horizontal and {vertical:.2f} m vertical, "
        f"but the project lets all of them be off together by {bias[0]:g} and {bias[1]:g} m. With "
        "a base station of known place, set `telemetry.position_bias_sigma_m` to "
        f"[{horizontal:.2f}, {vertical:.2f}]."
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


def _messages(poses: PhotoPoses, has_attitude: Bools, scatter_deg: float) -> Iterator[Message]:
    """Report the assumptions on photos without attitude."""
    has_nose = np.isfinite(poses.vehicle_ypr_rad[:, 0])
    by_nose = np.flatnonzero(~has_attitude & has_nose)
    unknown = np.flatnonzero(~has_attitude & ~has_nose)
    likeness = "the other photos and " if has_attitude.any() else ""
    how = f"by {likeness}`mount`"
    tilt_deg = np.hypot(MOUNT_TILT_SIGMA_DEG, scatter_deg)
    way_out = "give yaw_deg, pitch_deg and roll_deg in a CSV file (`poses`)"
    if by_nose.size:
        frames = tuple(poses.frame_id[k] for k in by_nose)
        text = (
            f"There is no attitude in {poses.source} for {format_photo_count(frames)}: the "
            f"direction is assumed {how} from a level vehicle with the heading of its tags (± "
            f"{tilt_deg:.0f} degrees of tilt, ± {NOSE_YAW_SIGMA_DEG:.0f} of heading). If you "
            f"know better, {way_out}."
        )
        yield Message("warning", "attitude-from-course", text, frames=frames)
    if unknown.size:
        frames = tuple(poses.frame_id[k] for k in unknown)
        text = (
            f"There is no attitude in {poses.source} for {format_photo_count(frames)}. The "
            f"direction is assumed {how} from a level vehicle (± {tilt_deg:.0f} degrees "
            "of tilt); the heading is unknown, as a drone may fly backwards and sideways. Only "
            "points that several photos share, or known points, determine it. Pick such points, "
            f"or {way_out}."
        )
        yield Message("warning", "attitude-unknown", text, frames=frames)


def _position_sigmas(poses: PhotoPoses, options: TelemetryOptions) -> Floats:
    """Return horizontal and vertical sigmas (N, 2) [m]."""
    count = len(poses.frame_id)
    if options.position_sigma_m != "auto":
        return np.tile(np.array(options.position_sigma_m), (count, 1))
    stated = np.stack([poses.sigma_horizontal_m, poses.sigma_vertical_m], axis=1)
    return np.where(np.isfinite(stated), stated, [HORIZONTAL_SIGMA_M, VERTICAL_SIGMA_M])


def _attitude_sigmas(
    poses: PhotoPoses, options: TelemetryOptions, has_attitude: Bools, scatter_deg: float
) -> Floats:
    """Return sigmas (N, 2) of roll and pitch, and of yaw [rad]; guesses keep their wide sigmas.

    Parameters
    ----------
    poses, options
        Stated sigmas of the photos, and of the project.
    has_attitude
        (N,) mask of the photos that state one.
    scatter_deg
        Scatter of the pitch of these.
    """
    stated = poses.sigma_attitude_rad[:, None]
    sigma = np.where(np.isfinite(stated), stated, np.radians([TILT_SIGMA_DEG, YAW_SIGMA_DEG]))
    has_nose = np.isfinite(poses.vehicle_ypr_rad[:, 0])
    yaw = np.where(has_nose, NOSE_YAW_SIGMA_DEG, UNKNOWN_YAW_SIGMA_DEG)
    tilt = MOUNT_TILT_SIGMA_DEG
    if options.attitude_sigma_deg != "auto":
        sigma = np.tile(np.radians(options.attitude_sigma_deg), (len(poses.frame_id), 1))
        tilt, yaw = options.attitude_sigma_deg[0], np.maximum(yaw, options.attitude_sigma_deg[1])
    tilts = np.full_like(yaw, np.hypot(tilt, scatter_deg))
    guessed = np.radians(np.stack([tilts, yaw], axis=1))
    return np.where(has_attitude[:, None], sigma, guessed)


EARTH_M = 6.371e6
"""Radius of the earth [m], for speeds."""


def compute_positions(frames: Frames, boot: Boot, clock: BootClock) -> PhotoPoses:
    """Interpolate the log's positions at the matched frames, without attitudes.

    The error of each photo is independent within the uncertainty of its instant, as poses of photos
    have no clock: the common offset is treated as an error of each.

    Parameters
    ----------
    frames
        Frames at their instants.
    boot, clock
        The boot of the photos, and its line to UTC.

    Raises
    ------
    UavgramError
        The log has fewer than two positions.
    """
    positions = boot.positions
    if positions is None or len(positions.time_boot_s) < 2:
        raise UavgramError("the log has fewer than two positions: it cannot place photos")
    rows = np.flatnonzero(frames.matched)
    instant, logged = frames.time_utc_s[rows], convert_boot_to_utc(clock, positions.time_boot_s)

    columns = positions.latitude_deg, positions.longitude_deg, positions.height_m
    latitude, longitude, height = (np.interp(instant, logged, column) for column in columns)
    # Velocity by differences, for the error from the uncertain instant.
    north = EARTH_M * np.gradient(np.radians(positions.latitude_deg), logged)
    east = EARTH_M * np.gradient(np.radians(positions.longitude_deg), logged)
    east *= np.cos(np.radians(positions.latitude_deg))
    climb = np.interp(instant, logged, np.abs(np.gradient(positions.height_m, logged)))
    speed = np.interp(instant, logged, np.hypot(east, north))
    sigma_s = np.hypot(np.nan_to_num(frames.sigma_time_s[rows]), frames.clock_offset_sigma_s)
    return PhotoPoses(
        frame_id=tuple(frames.frame_id[k] for k in rows),
        latitude_deg=latitude,
        longitude_deg=longitude,
        height_m=height,
        height_home_m=np.interp(instant, logged, positions.height_home_m),
        datum=positions.datum,
        time_utc_s=instant,
        sigma_horizontal_m=np.hypot(HORIZONTAL_SIGMA_M, speed * sigma_s),
        sigma_vertical_m=np.hypot(VERTICAL_SIGMA_M, climb * sigma_s),
        source=f"The log ({positions.source})",
    )
