"""Track of one boot in the local world on the UTC clock, with home and independent evidence."""

from __future__ import annotations

import numpy as np

from uavgram.errors import UavgramError
from uavgram.estimation.clocks.clock_line import convert_boot_to_utc, convert_utc_to_boot
from uavgram.geometry.geodesy import Origin, enu_from_geodetic
from uavgram.geometry.motion.interpolation import interpolate_rotation
from uavgram.geometry.motion.rotation import (
    ENU_FROM_NED,
    matrix_from_xyzw,
    matrix_from_ypr,
    xyzw_from_matrix,
    ypr_from_matrix,
)
from uavgram.model.arrays import Floats
from uavgram.model.flight_log import (
    AttitudeSamples,
    Boot,
    BootClock,
    EstimatorSigmas,
    FlightEvidence,
    GimbalSamples,
    HeightDatum,
    HomeSamples,
    Track,
)
from uavgram.model.message import Message
from uavgram.model.options import MountOptions, TelemetryOptions
from uavgram.stages.seed.mount import apply_stated_mount, report_stated_mount

_NONE = np.zeros(0), np.zeros((0, 3))


def gather_evidence(boot: Boot, clock: BootClock, origin: Origin) -> FlightEvidence:
    """Collect velocities, receiver positions, angular rates and the stated resets of a boot.

    Parameters
    ----------
    boot, clock
        The boot, and its line to UTC.
    origin
        Latitude, longitude [deg] and height [m] of the world's origin, as for `build_track`.
    """
    velocity, receiver, turn = _NONE, _NONE, _NONE
    if boot.velocities is not None:
        stated = boot.velocities
        velocity = convert_boot_to_utc(clock, stated.time_boot_s), stated.ned_m_s @ ENU_FROM_NED.T
    if boot.turn_rates is not None:
        turn = convert_boot_to_utc(clock, boot.turn_rates.time_boot_s), boot.turn_rates.body_rad_s
    other = boot.receiver
    if other is not None and boot.positions is not None and other.source != boot.positions.source:
        place = enu_from_geodetic(other.latitude_deg, other.longitude_deg, other.height_m, origin)
        receiver = convert_boot_to_utc(clock, other.time_boot_s), place
    at = convert_boot_to_utc(clock, np.array([reset.time_boot_s for reset in boot.resets]))
    what = (reset.what for reset in boot.resets)
    return FlightEvidence(
        velocity_time_s=velocity[0],
        velocity_world_m_s=velocity[1],
        receiver_time_s=receiver[0],
        receiver_world_m=receiver[1],
        turn_time_s=turn[0],
        turn_body_rad_s=turn[1],
        resets=tuple(zip(at.tolist(), what, strict=True)),
    )


# Lower limits of the sigmas stated by a log. Against the truth of simulated flights the
# estimator claimed 0.17 to 0.20 m (square roots of XKV1's variances) and was off by 0.2 m rms in
# calm air, by 0.9 (copter) and 2.7 m (plane) in wind; its yaw by 0.5 to 0.75 degrees in calm air,
# 1.5 to 2.9 in wind. The limits are for errors that change from frame to frame; those constant
# in a flight are the shared unknowns of `position_bias_sigma_m` and `heading_bias_sigma_deg`.
POSITION_FLOOR_M = 0.5
# With a fixed RTK solution of centimetres the stated sigmas hold, down to what the motion between
# the log's positions adds: horizontal and vertical. Base, antenna and timing are shared unknowns.
# (A simulator claims a fixed solution too, of some decimetres.)
RTK_FLOOR_M = (0.03, 0.05)
RTK_MOST_M = 0.1
TILT_FLOOR_DEG, YAW_FLOOR_DEG = 1.0, 2.0
WITHOUT = "use another one, or leave `log` out to measure by known lengths alone"

_LONG_HOLD_S = 1.0

Home = tuple[float, float, float]


def find_home(
    boot: Boot, clock: BootClock, first_exposure_utc_s: float
) -> tuple[Home, HeightDatum, tuple[Message, ...]]:
    """Return the home in force at the first matched exposure.

    Parameters
    ----------
    boot, clock
        The boot that contains the photos, and its line to UTC.
    first_exposure_utc_s
        Instant of the first matched frame.

    Returns
    -------
    home : (latitude_deg, longitude_deg, height_m)
    datum
        Datum of its height.
    messages
        Where the log states none: that the first position was taken, at its altitude minus its
        height above home.

    Raises
    ------
    UavgramError
        The log has neither home nor positions.
    """
    first_boot_s = float(convert_utc_to_boot(clock, first_exposure_utc_s))
    if boot.home is not None:
        return _choose_home(boot.home, first_boot_s)
    positions = boot.positions
    if positions is None:
        raise UavgramError(f"the log has no positions, so there is no home: {WITHOUT}")
    above = positions.height_home_m[0]
    height = positions.height_m[0] - (above if np.isfinite(above) else 0.0)
    how = (
        "at its altitude minus its height above home"
        if np.isfinite(above)
        else "at its altitude, as the log has no height above home"
    )
    text = (
        f"The log states no home: the first position of {positions.source} was taken, {how} "
        f"({height:.2f} m). Set world.origin for another."
    )
    home = (float(positions.latitude_deg[0]), float(positions.longitude_deg[0]), float(height))
    return home, positions.datum, (Message("warning", "home-missing", text),)


def _choose_home(
    home: HomeSamples, first_boot_s: float
) -> tuple[Home, HeightDatum, tuple[Message, ...]]:
    """Return the last statement before the exposure, or the first of all."""
    k = max(int(np.searchsorted(home.time_boot_s, first_boot_s, side="right")) - 1, 0)
    place = (
        float(home.latitude_deg[k]),
        float(home.longitude_deg[k]),
        float(home.height_m[k]),
    )
    messages: tuple[Message, ...] = ()
    if home.time_boot_s[k] > first_boot_s:
        late = home.time_boot_s[k] - first_boot_s
        text = f"The log states home only {late:.1f} s after the first photo: that was used."
        messages = (Message("info", "home-late", text),)
    return place, home.datum, messages


def build_track(
    boot: Boot,
    clock: BootClock,
    origin: Home,
    mount: MountOptions,
    telemetry: TelemetryOptions,
) -> tuple[Track, tuple[Message, ...]]:
    """Convert a boot's tables to a track.

    Parameters
    ----------
    boot, clock
        The boot, and its line to UTC.
    origin
        Latitude, longitude [deg] and height [m] of the world's origin, in the positions' datum.
    mount
        Mount; ``gimbal: auto`` takes the log's gimbal where it has one.
    telemetry
        Sigmas, or ``auto``.

    Raises
    ------
    UavgramError
        The log has fewer than two positions or attitudes.
    """
    positions, attitudes = boot.positions, boot.attitudes
    if positions is None or len(positions.time_boot_s) < 2:
        raise UavgramError(f"the log has fewer than two positions: {WITHOUT}")
    if attitudes is None or len(attitudes.time_boot_s) < 2:
        raise UavgramError(f"the log has no attitude of the vehicle (ATT, ATTITUDE): {WITHOUT}")
    center_m = enu_from_geodetic(
        positions.latitude_deg, positions.longitude_deg, positions.height_m, origin
    )
    ned_from_body = matrix_from_xyzw(attitudes.ned_from_body_xyzw)
    used = boot.gimbal if mount.gimbal == "auto" else None
    gimbal_boot_s, world_from_gimbal, messages = _gimbal_track(used, attitudes, mount)
    if used is None and boot.gimbal is not None:
        messages = _report_unused(boot.gimbal, attitudes, mount)
    sigma_boot_s, sigma_position, sigma_attitude = _sigmas(boot.sigmas, telemetry)
    source = "+".join(
        part.source for part in (positions, attitudes, used, boot.sigmas) if part is not None
    )
    track = Track(
        position_time_s=convert_boot_to_utc(clock, positions.time_boot_s),
        position_world_m=center_m,
        attitude_time_s=convert_boot_to_utc(clock, attitudes.time_boot_s),
        world_from_body_xyzw=xyzw_from_matrix(ENU_FROM_NED @ ned_from_body),
        gimbal_time_s=convert_boot_to_utc(clock, gimbal_boot_s),
        world_from_gimbal_xyzw=world_from_gimbal,
        sigma_time_s=convert_boot_to_utc(clock, sigma_boot_s),
        sigma_position_m=sigma_position,
        sigma_attitude_rad=sigma_attitude,
        source=source,
    )
    return track, (_sources(boot, used, telemetry), *messages)


def _sources(boot: Boot, gimbal: GimbalSamples | None, options: TelemetryOptions) -> Message:
    """Report the log messages used for the seeds, and the source of the sigmas."""
    position = "nothing" if boot.positions is None else boot.positions.source
    attitude = "nothing" if boot.attitudes is None else boot.attitudes.source
    camera = "the mount in the project" if gimbal is None else gimbal.source
    if options.position_sigma_m != "auto" and options.attitude_sigma_deg != "auto":
        sigmas = "the project"
    elif boot.sigmas is None:
        sigmas = "the program, as the log states none"
    else:
        sigmas = f"{boot.sigmas.source}, with lower limits"
    text = (
        f"The log places the photos: the drone's positions are from its records {position}, its "
        f"turns from {attitude}, the camera's direction from {camera}. Their uncertainties are "
        f"from {sigmas}. The results begin with these and improve them; no action is needed."
    )
    return Message("info", "pose-source", text)


def _gimbal_track(
    gimbal: GimbalSamples | None, attitudes: AttitudeSamples, mount: MountOptions
) -> tuple[Floats, Floats, tuple[Message, ...]]:
    """Return gimbal attitudes (L, 4) in the world at boot times (L,), over the attitudes' span."""
    if gimbal is None:
        return np.zeros(0), np.zeros((0, 4)), ()
    time, ned_from_body, ypr = _gimbal_angles(gimbal, attitudes)
    if len(time) < 2:
        text = (
            f"The log's gimbal angles were not used: {gimbal.source} never overlaps "
            f"{attitudes.source}. The camera's direction is taken from `mount`: check it."
        )
        return np.zeros(0), np.zeros((0, 4)), (Message("warning", "gimbal-unused", text),)
    heading = ypr_from_matrix(ned_from_body)[0]
    ypr, stated = apply_stated_mount(mount, ypr, heading, gimbal.source)
    xyzw = xyzw_from_matrix(ENU_FROM_NED @ matrix_from_ypr(*ypr.T))
    span = (float(attitudes.time_boot_s[0]), float(attitudes.time_boot_s[-1]))
    time, xyzw, held = _held_to(time, xyzw, span, gimbal.source)
    return time, xyzw, (*stated, *held)


def _gimbal_angles(
    gimbal: GimbalSamples, attitudes: AttitudeSamples
) -> tuple[Floats, Floats, Floats]:
    """Return times (L,), the vehicle's attitudes (L, 3, 3), and yaw from north, pitch, roll (L, 3).

    Those within the span of the vehicle's attitudes.
    """
    vehicle_time = attitudes.time_boot_s
    inside = (gimbal.time_boot_s >= vehicle_time[0]) & (gimbal.time_boot_s <= vehicle_time[-1])
    time = gimbal.time_boot_s[inside]
    ned_from_body, _ = interpolate_rotation(vehicle_time, attitudes.ned_from_body_xyzw, time)
    ypr = np.stack([gimbal.yaw_rad, gimbal.pitch_rad, gimbal.roll_rad], axis=1)[inside]
    if gimbal.yaw_frame == "vehicle":
        ypr[:, 0] += ypr_from_matrix(ned_from_body)[0]
    return time, ned_from_body, ypr


def _report_unused(
    gimbal: GimbalSamples, attitudes: AttitudeSamples, mount: MountOptions
) -> tuple[Message, ...]:
    """Report how far a mount fixed to the vehicle is from the gimbal's angles in the log."""
    _, ned_from_body, ypr = _gimbal_angles(gimbal, attitudes)
    known = np.isfinite(ypr).all(axis=1)
    if not known.any():
        return ()
    fixed = ned_from_body[known] @ matrix_from_ypr(*np.radians(mount.angles_deg()))
    recorded = matrix_from_ypr(*ypr[known].T)
    return (report_stated_mount(mount, recorded, fixed, gimbal.source),)


def _held_to(
    time: Floats, xyzw: Floats, span: tuple[float, float], source: str
) -> tuple[Floats, Floats, tuple[Message, ...]]:
    """Extend the first and last gimbal attitude to the ends of the flight."""
    before, after = time[0] - span[0], span[1] - time[-1]
    messages: tuple[Message, ...] = ()
    if max(before, after) > _LONG_HOLD_S:
        text = (
            "The log's gimbal angles do not cover the whole flight: "
            f"{source} begins {before:.1f} s after and ends {after:.1f} s before the vehicle's "
            "attitude. Its first and last values were used there: check whether the gimbal moved."
        )
        messages = (Message("warning", "gimbal-held", text),)
    if before > 0:
        time, xyzw = np.r_[span[0], time], np.vstack([xyzw[:1], xyzw])
    if after > 0:
        time, xyzw = np.r_[time, span[1]], np.vstack([xyzw, xyzw[-1:]])
    return time, xyzw, messages


def _sigmas(
    sigmas: EstimatorSigmas | None, options: TelemetryOptions
) -> tuple[Floats, Floats, Floats]:
    """Return boot times (S,), position sigmas (S, 2) [m] and attitude sigmas (S, 2) [rad]."""
    time = np.zeros(1) if sigmas is None else sigmas.time_boot_s
    count = len(time)
    silent = np.full(count, np.nan)
    if options.position_sigma_m == "auto":
        stated = (silent, silent) if sigmas is None else (sigmas.horizontal_m, sigmas.vertical_m)
        # fmax takes the limit where the log states none (NaN)
        position = np.stack(stated, axis=1)
        fixed = np.zeros(1, np.bool_) if sigmas is None else sigmas.is_fixed
        fixed = (fixed & (position[:, 0] < RTK_MOST_M))[:, None] & np.isfinite(position)
        position = np.fmax(position, np.where(fixed, RTK_FLOOR_M, POSITION_FLOOR_M))
    else:
        position = np.tile(np.array(options.position_sigma_m), (count, 1))
    if options.attitude_sigma_deg == "auto":
        stated = (silent, silent) if sigmas is None else (sigmas.tilt_rad, sigmas.yaw_rad)
        floors = np.radians([TILT_FLOOR_DEG, YAW_FLOOR_DEG])
        attitude = np.fmax(np.stack(stated, axis=1), floors)
    else:
        attitude = np.tile(np.radians(options.attitude_sigma_deg), (count, 1))
    return time, position, attitude
