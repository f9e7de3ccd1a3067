"""Reader of PX4's ULog (.ulg): its table and its functions.

Field meanings: PX4-Autopilot msg/*.msg; names of fields changed over the years, both are read.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from uavgram.errors import InputError
from uavgram.geometry.gps_time import MAX_PLAUSIBLE_UTC_S, MIN_PLAUSIBLE_UTC_S
from uavgram.io.logs.boots import StatedResets, Table, build_log
from uavgram.io.logs.camera_events import build_events, image_numbers
from uavgram.io.logs.messages import Found, Row, Topic, vehicle_kind
from uavgram.io.logs.samples import find_plausible_rows
from uavgram.io.logs.ulog.tables import UlogTables, read_tables
from uavgram.model.arrays import Bools, Floats
from uavgram.model.flight_log import CameraEvents, FlightLog, MessageCount

# lowest byte of ver_sw_release (PX4 src/lib/version/version.c)
_RELEASE_KINDS = {0: "development", 64: "alpha", 128: "beta", 192: "candidate", 255: "release"}
_EARTH_RADIUS_M = 6371000.0  # PX4 src/lib/geo/geo.h, CONSTANTS_RADIUS_OF_EARTH
_LATEST_FEEDBACK_S = 1.0  # after its command
_EARLIEST_FEEDBACK_S = -0.02

TOPICS = (
    *("vehicle_global_position", "vehicle_local_position", "vehicle_gps_position", "sensor_gps"),
    *("vehicle_attitude", "vehicle_angular_velocity", "vehicle_status", "home_position"),
    *("camera_capture", "camera_trigger", "gimbal_device_attitude_status", "mount_orientation"),
)


def _receiver(tables: UlogTables) -> Topic | None:
    """Return the GPS topic that has a 3-D fix; vehicle_gps_position before sensor_gps.

    Since 2023 in degrees and metres, before as integers of 1e-7 degrees and millimetres.
    """
    for name in ("vehicle_gps_position", "sensor_gps"):
        for topic in tables.instances(name):
            if not _has_fix(topic).any():
                continue
            fields = dict(topic.fields)
            if "latitude_deg" not in fields:
                fields["latitude_deg"] = topic.column("lat") / 1e7
                fields["longitude_deg"] = topic.column("lon") / 1e7
                fields["altitude_msl_m"] = topic.column("alt") / 1e3
            if "alt_ellipsoid" in fields:
                fields["altitude_ellipsoid_m"] = topic.column("alt_ellipsoid") / 1e3
            return replace(topic, fields=fields)
    return None


def _has_fix(topic: Topic) -> Bools:
    return np.asarray(topic.column("fix_type") >= 3)


def _has_ellipsoid(topic: Topic) -> Bools:
    return np.asarray(_has_fix(topic) & (topic.column("altitude_ellipsoid_m") != 0))


def _is_called_valid(topic: Topic) -> Bools:
    """Return (N,) whether no flag marks a position as invalid; old firmware has none of them."""
    flags = ("lat_lon_valid", "alt_valid", "valid_hpos", "valid_alt")
    return np.asarray(~np.any([topic.column(flag) == 0 for flag in flags], axis=0))


def _is_global(topic: Topic) -> Bools:
    """Return (N,) whether the local frame is georeferenced."""
    tied = (topic.column("xy_global") > 0) & (topic.column("z_global") > 0)
    finite = np.isfinite(topic.column("ref_lat")) & np.isfinite(topic.column("ref_lon"))
    return np.asarray(tied & finite)


def _from_local(tables: UlogTables) -> Topic | None:
    """Return vehicle_local_position in geodetic coordinates."""
    topic = tables.topic("vehicle_local_position")
    if topic is None:
        return None
    latitude, longitude, height = unproject_local(topic)
    return replace(topic, fields=topic.fields | {"lat": latitude, "lon": longitude, "alt": height})


def unproject_local(topic: Topic) -> tuple[Floats, Floats, Floats]:
    """Compute latitude, longitude [deg] and altitude [m], each (N,), of local north, east, down.

    PX4's own projection, with which the local frame was made: azimuthal equidistant on a sphere
    (PX4 src/lib/geo/geo.cpp, MapProjection::reproject).
    """
    latitude_0, longitude_0 = (
        np.radians(topic.column("ref_lat")),
        np.radians(topic.column("ref_lon")),
    )
    north, east = topic.column("x") / _EARTH_RADIUS_M, topic.column("y") / _EARTH_RADIUS_M
    angle = np.hypot(north, east)
    ratio = np.sinc(angle / np.pi)  # sin(angle) / angle, 1 at the origin
    latitude = np.arcsin(
        np.clip(np.cos(angle) * np.sin(latitude_0) + north * ratio * np.cos(latitude_0), -1.0, 1.0)
    )
    longitude = longitude_0 + np.arctan2(
        east * ratio, np.cos(latitude_0) * np.cos(angle) - north * np.sin(latitude_0) * ratio
    )
    height = topic.column("ref_alt") - topic.column("z")
    return np.degrees(latitude), np.degrees(longitude), height


def _utc(tables: UlogTables) -> Topic | None:
    """Return the receiver's UTC, one for each 3-D fix."""
    topic = tables.topic(_receiver)
    if topic is None:
        return None
    # time of the UTC stamp, where it differs from that of publication (msg/SensorGps.msg)
    relative = topic.column("timestamp_time_relative") * 1e-6
    time = topic.time_s + np.where(np.abs(relative) < 1.0, relative, 0.0)
    utc = topic.column("time_utc_usec") * 1e-6
    dated = (utc > MIN_PLAUSIBLE_UTC_S) & (utc < MAX_PLAUSIBLE_UTC_S) & _has_fix(topic)
    return Topic("gps", time, {"utc_s": np.where(dated, utc, np.nan)})


def _events(tables: UlogTables) -> Found[CameraEvents]:
    """Join camera_capture with the commands of camera_trigger; else use camera_trigger alone.

    The trigger and the capture driver of PX4 count independently (src/drivers/camera_trigger,
    src/drivers/camera_capture), so a missed shot shifts one count against the other: commands are
    joined with feedback by time.
    """
    capture, trigger = tables.topic("camera_capture"), tables.topic("camera_trigger")
    if capture is None and trigger is None:
        return None, ()
    fed_back = np.zeros(0, dtype=bool) if trigger is None else trigger.column("feedback") > 0
    main, confirmed = _main(capture, trigger, fed_back)
    number = image_numbers(main.column("seq"))
    rows = find_plausible_rows(main.time_s, np.ones(len(main.time_s), dtype=bool))
    time, number, confirmed = main.time_s[rows], number[rows], confirmed[rows]
    missed, source = None, main.name
    if trigger is not None and fed_back.any():
        commands = trigger.time_s[find_plausible_rows(trigger.time_s, ~fed_back)]
        unanswered = commands[~_is_answered(commands, time)]
        missed = unanswered, np.full(len(unanswered), -1)
        source = "camera_capture+camera_trigger" if capture is not None else source
    instant: Literal["feedback", "command"] = "feedback" if fed_back.any() else "command"
    return build_events(source, instant, (time, number, confirmed), missed)


def _main(capture: Topic | None, trigger: Topic | None, fed_back: Bools) -> tuple[Topic, Floats]:
    """Return the topic whose rows are the exposures, and whether each is confirmed."""
    if capture is not None:
        # result: 1 success, 0 failure, -1 the camera gives no feedback (msg/CameraCapture.msg)
        return capture, np.where(capture.column("result") == 0, 0.0, 1.0)
    assert trigger is not None  # noqa: S101 - one of the two is there
    if not fed_back.any():
        return trigger, np.zeros(len(trigger.time_s))  # commands only
    return trigger.only(fed_back), np.ones(int(fed_back.sum()))


def _is_answered(command_s: Floats, feedback_s: Floats) -> Bools:
    """Return (C,) whether feedback follows a command, before the next one and within a second."""
    until = np.minimum(
        np.append(command_s[1:] + _EARLIEST_FEEDBACK_S, np.inf), command_s + _LATEST_FEEDBACK_S
    )
    first = np.searchsorted(feedback_s, command_s + _EARLIEST_FEEDBACK_S)
    return np.asarray(first < np.searchsorted(feedback_s, until))


_PLACE = ("lat", "lon", "alt")
_RECEIVER = Row(_receiver, ("latitude_deg", "longitude_deg", "altitude_msl_m"), valid=_has_fix)
_LAGGING = "positions are the receiver's own (no estimator's): they lag by its delay"
_COUNTERS = (
    ("vehicle_local_position", "xy_reset_counter", "reset of the position"),
    ("vehicle_local_position", "z_reset_counter", "reset of the height"),
    ("vehicle_local_position", "heading_reset_counter", "reset of the heading"),
    ("vehicle_global_position", "lat_lon_reset_counter", "reset of the position"),
    ("vehicle_global_position", "alt_reset_counter", "reset of the height"),
    ("vehicle_attitude", "quat_reset_counter", "reset of the attitude"),
)

TABLE = Table(
    positions=(
        Row("vehicle_global_position", _PLACE, valid=_is_called_valid),
        Row(_from_local, _PLACE, valid=_is_global),
        replace(_RECEIVER, remark=_LAGGING),
    ),
    receiver=(_RECEIVER,),
    attitudes=(Row("vehicle_attitude", ("q[1]", "q[2]", "q[3]", "q[0]")),),
    gimbal=(
        Row("gimbal_device_attitude_status", ("q[0]", "q[1]", "q[2]", "q[3]", "device_flags")),
        Row(
            "mount_orientation",
            tuple(f"attitude_euler_angle[{k}]" for k in range(3)),
            factor=180 / np.pi,
        ),
    ),
    events=(_events,),
    velocities=(
        Row("vehicle_local_position", ("vx", "vy", "vz")),
        Row("vehicle_global_position", ("vel_n", "vel_e", "vel_d")),
    ),
    turn_rates=(
        Row("vehicle_angular_velocity", ("xyz[0]", "xyz[1]", "xyz[2]")),
        Row("vehicle_attitude", ("rollspeed", "pitchspeed", "yawspeed")),
    ),
    # the test ratios of estimator_status are not standard deviations
    sigmas=(
        Row(("vehicle_global_position", "vehicle_local_position"), ("eph", "epv")),
        Row(_receiver, ("eph", "epv")),
    ),
    fix=(Row(_receiver, ("fix_type",)),),
    home=(Row("home_position", _PLACE, valid=_is_called_valid),),
    reception=(Row(_receiver, ("satellites_used", "hdop")),),
    clocks=(Row(_utc, ("utc_s",)),),
    undulation=(Row(_receiver, ("altitude_ellipsoid_m", "altitude_msl_m"), valid=_has_ellipsoid),),
    resets=StatedResets(counters=_COUNTERS),
)


def read_ulog(path: str | Path) -> FlightLog:
    """Read a ULog: one boot of a PX4 autopilot.

    Raises
    ------
    InputError
        The file is missing, empty, not a ULog, or damaged beyond use.
    """
    tables = read_tables(path, TOPICS)
    if not tables.counts:
        raise InputError(path, "holds no complete message: the file is cut; copy it once more")
    log = FlightLog(
        path=str(path),
        kind="ulog",
        vehicle=_vehicle(tables),
        firmware=_firmware(tables),
        messages=_counts(tables),
        notes=tables.notes,
    )
    return build_log(log, [tables], TABLE)


def _counts(tables: UlogTables) -> tuple[MessageCount, ...]:
    return tuple(
        MessageCount(name=name, count=found.rows, first_s=found.first_s, last_s=found.last_s)
        for name, found in sorted(tables.counts.items())
    )


def _vehicle(tables: UlogTables) -> str:
    """Return the kind of vehicle by vehicle_status, else by the parameter MAV_TYPE."""
    status = tables.topic("vehicle_status")
    stated = np.nan if status is None else float(status.column("system_type")[-1])
    number = stated if np.isfinite(stated) else tables.parameters.get("MAV_TYPE", 0)
    return vehicle_kind(int(number)) if isinstance(number, int | float) else ""


def _firmware(tables: UlogTables) -> str:
    """Return the firmware, such as ``PX4 v1.11.2 (development, 8583f1da)``."""
    name = str(tables.info.get("sys_name", "PX4"))
    version = tables.info.get("ver_sw_release")
    commit = str(tables.info.get("ver_sw", ""))[:8]
    if not isinstance(version, int):
        return f"{name} ({commit})" if commit else name
    number = ".".join(str(version >> shift & 0xFF) for shift in (24, 16, 8))
    kind = _RELEASE_KINDS.get(version & 0xFF, "unknown kind")
    return f"{name} v{number} ({kind}, {commit})" if commit else f"{name} v{number} ({kind})"
