"""Reader of MAVLink telemetry logs (.tlog): their table and its functions.

Fields, units and frames: https://mavlink.io/en/messages/common.html and ardupilotmega.html.
"""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from uavgram.errors import InputError
from uavgram.geometry.motion.interpolation import interpolate_rotation
from uavgram.geometry.motion.rotation import matrix_from_ypr, ypr_from_matrix
from uavgram.input_files import read_bytes
from uavgram.io.logs.boots import StatedResets, Table, build_log, read_first
from uavgram.io.logs.camera_events import build_events, gimbal_from_angles, image_numbers
from uavgram.io.logs.messages import Found, Row, Topic, message_name, vehicle_kind
from uavgram.io.logs.samples import attitude_samples, find_plausible_rows, quaternions_of_angles
from uavgram.io.logs.tlog.frames import FrameTable, Stream, find_vehicles, scan_frames, split_boots
from uavgram.model.arrays import Bools, Floats
from uavgram.model.flight_log import CameraEvents, FlightLog, GimbalSamples, MessageCount

_FIRMWARE = re.compile(r"\b(Ardu\w+|APM:\w+|PX4)\s+[Vv]?\d[\w.\-]*(\s+\(\w+\))?")
_LARGEST_RAD = 7.0  # of an angle: some firmware sends 2 pi for 0
_EPOCH_USEC = 1e15  # larger times are microseconds since 1970 (from 2001), smaller since boot
_WRAP_S = 2.0**32 * 1e-6
_LONGEST_DELAY_S = 60.0  # from an exposure to its message


def _receiver(stream: Stream) -> Topic | None:
    """Return messages with a 3-D fix of the first receiver that has any."""
    for name in ("GPS_RAW_INT", "GPS2_RAW"):
        topic = stream.topic(name)
        if topic is not None and (fixed := topic.column("fix_type") >= 3).any():
            return topic.only(fixed)
    return None


def _has_place(topic: Topic) -> Bools:
    return np.asarray((topic.column("lat") != 0) | (topic.column("lon") != 0))


def _knows_velocity(topic: Topic) -> Bools:
    """Return (N,) False if all velocities are zero, as sent by firmware that knows none."""
    knows = topic.column("vx").any() or topic.column("vy").any()
    return np.full(len(topic.time_s), bool(knows))


def _has_ellipsoid(topic: Topic) -> Bools:
    return np.asarray(topic.column("alt_ellipsoid") != 0)


def _convert_attitude(stream: Stream) -> Topic | None:
    """Return ATTITUDE as quaternions."""
    topic = stream.topic("ATTITUDE")
    if topic is None:
        return None
    angles = np.stack([topic.column(k) for k in ("roll", "pitch", "yaw")], axis=1)
    sane = np.abs(angles).max(axis=1) < _LARGEST_RAD  # NaN compares False
    xyzw = quaternions_of_angles(angles, sane)
    return replace(topic, fields=dict(zip(_XYZW, xyzw.T, strict=True)))


def _make_reception_topic(stream: Stream) -> Topic | None:
    """Return the ground station's clock at the messages that state their time since boot."""
    received = stream.frames.receive_s(stream.clock_row)
    return Topic("receive", stream.clock_boot_s, {"utc_s": received})


def _mount_status(stream: Stream) -> Found[GimbalSamples]:
    """Return MOUNT_STATUS: servo angles from the vehicle's frame for a servo mount (until 4.2).

    ArduPilot 3.x, AP_Mount_Servo.cpp status_msg() sends _angle_bf_output_deg, the other mounts send
    angles from the horizon; the message does not distinguish them. Servo angles cancel the
    vehicle's, and are recognised by that.
    """
    topic = stream.topic("MOUNT_STATUS")
    if topic is None:
        return None, ()
    # pointing_a, b, c are pitch, roll, yaw in centidegrees; the message has no time of its own
    names = ("pointing_b", "pointing_a", "pointing_c")
    angles_deg = np.stack([topic.column(name) / 100.0 for name in names], axis=1)
    if not angles_deg.any():
        return None, ()  # no mount is configured
    samples, notes = gimbal_from_angles(topic.time_s, angles_deg, topic.name)
    attitudes, _ = read_first(stream, _ATTITUDES, attitude_samples)
    if samples is None or attitudes is None or len(attitudes.time_boot_s) < 2:
        return samples, notes
    vehicle, _ = interpolate_rotation(
        attitudes.time_boot_s,
        attitudes.ned_from_body_xyzw,
        np.clip(samples.time_boot_s, *attitudes.time_boot_s[[0, -1]]),
    )
    if not _cancels(samples, vehicle):
        return samples, notes
    note = (
        "MOUNT_STATUS states servo angles, which cancel the vehicle's roll and pitch: they were "
        "turned by the vehicle's attitude"
    )
    return _on_vehicle(samples, vehicle), (*notes, note)


def _cancels(samples: GimbalSamples, ned_from_body: Floats) -> bool:
    """Return whether the angles cancel the vehicle's: their sum varies far less than they do."""
    _, pitch, roll = ypr_from_matrix(ned_from_body)
    apart = np.var(samples.roll_rad) + np.var(samples.pitch_rad)
    together = np.var(samples.roll_rad + roll) + np.var(samples.pitch_rad + pitch)
    return bool(apart > np.radians(0.5) ** 2 and together < 0.25 * apart)


def _on_vehicle(samples: GimbalSamples, ned_from_body: Floats) -> GimbalSamples:
    """Convert angles from the vehicle's frame to angles from the horizon and north."""
    body_from_gimbal = matrix_from_ypr(samples.yaw_rad, samples.pitch_rad, samples.roll_rad)
    yaw, pitch, roll = ypr_from_matrix(ned_from_body @ body_from_gimbal)
    return replace(samples, roll_rad=roll, pitch_rad=pitch, yaw_rad=yaw, yaw_frame="earth")


def _read_stamped_events(
    stream: Stream, name: str, count: str, *, fed_back: bool
) -> Found[CameraEvents]:
    """Return events with time_usec, and their number in the field `count`.

    The clock of CAMERA_FEEDBACK varies (ArduPilot, AP_Camera_Backend.cpp): UTC without a feedback
    pin, microseconds since boot in 32 bits with one.
    """
    topic = stream.topic(name)
    if topic is None:
        return None, ()
    time, is_utc, notes = _since_boot(stream, topic)
    kept = find_plausible_rows(time, np.abs(time - topic.time_s) < _LONGEST_DELAY_S)
    if not len(kept):
        return None, notes
    pinned = fed_back and (~is_utc[kept]).mean() > 0.5
    number = image_numbers(topic.column(count))[kept]
    confirmed = np.full(len(kept), float(fed_back))
    events, remarks = build_events(
        name, "feedback" if pinned else "command", (time[kept], number, confirmed)
    )
    return events, (*notes, *remarks)


def _since_boot(stream: Stream, topic: Topic) -> tuple[Floats, Bools, tuple[str, ...]]:
    """Return (K,) boot times of stamps in UTC or since boot, by magnitude; mask of UTC; remarks.

    UTC is converted to the boot clock by the vehicle's own SYSTEM_TIME, which is the same clock,
    right or wrong; a stamp since boot of 32 bits is unwrapped to its message's own time.
    """
    stated = topic.column("time_usec")
    since_boot = stated * 1e-6
    since_boot += np.round((topic.time_s - since_boot) / _WRAP_S) * _WRAP_S
    is_utc = stated > _EPOCH_USEC
    if not is_utc.any():
        return since_boot, is_utc, ()
    offset = _utc_minus_boot(stream, topic)
    if offset is not None:
        return np.where(is_utc, stated * 1e-6 - offset, since_boot), is_utc, ()
    text = (
        f"{int(is_utc.sum())} {topic.name} messages state UTC but the log has no SYSTEM_TIME to "
        "place them; they were not used"
    )
    return np.where(is_utc, np.nan, since_boot), is_utc, (text,)


def _utc_minus_boot(stream: Stream, topic: Topic) -> Floats | None:
    """Return (K,) the vehicle's UTC minus its boot time at these messages; None without any."""
    system = stream.topic("SYSTEM_TIME")
    if system is None:
        return None
    utc = system.column("time_unix_usec") * 1e-6
    some = utc > 0
    if not some.any():
        return None
    difference = utc - system.time_s
    rows = stream.rows(topic.name), stream.rows(system.name)
    return np.interp(rows[0], rows[1][some], difference[some])


def _read_captures(stream: Stream) -> Topic | None:
    """Return CAMERA_IMAGE_CAPTURED, without repetitions requested by a ground station."""
    topic = stream.topic("CAMERA_IMAGE_CAPTURED")
    if topic is None:
        return None
    # repeated ones have the same time and may come long after it: keep the first of each
    time, kept = np.unique(topic.time_s, return_index=True)
    latest = stream.boot_s(stream.rows(topic.name)[kept]) + _LONGEST_DELAY_S
    return topic.only(kept[(time > 0) & (time <= latest)])


_PLACE, _UNITS = ("lat", "lon", "alt"), (1e7, 1e7, 1e3)
_XYZW = ("q2", "q3", "q4", "q1")
_RATES = ("rollspeed", "pitchspeed", "yawspeed")
_LAGGING = "positions are the receiver's own (no GLOBAL_POSITION_INT): they lag by its delay"
_ANGLES = Row(_convert_attitude, _XYZW)
_ATTITUDES = (Row("ATTITUDE_QUATERNION", _XYZW), _ANGLES)
_RECEIVER = Row(_receiver, _PLACE, _UNITS, valid=_has_place, source="GPS_RAW_INT")

TABLE = Table(
    positions=(
        Row("GLOBAL_POSITION_INT", (*_PLACE, "relative_alt"), (*_UNITS, 1e3), valid=_has_place),
        replace(_RECEIVER, remark=_LAGGING),
    ),
    receiver=(_RECEIVER,),
    attitudes=_ATTITUDES,
    other_attitudes=(_ANGLES,),
    gimbal=(
        Row("GIMBAL_DEVICE_ATTITUDE_STATUS", ("q[0]", "q[1]", "q[2]", "q[3]", "flags")),
        Row("MOUNT_ORIENTATION", ("roll", "pitch", "yaw")),
        _mount_status,
    ),
    events=(
        partial(_read_stamped_events, name="CAMERA_FEEDBACK", count="img_idx", fed_back=True),
        Row(_read_captures, ("image_index", "capture_result")),
        partial(
            _read_stamped_events, name="CAMERA_TRIGGER", count="seq", fed_back=False
        ),  # commands only
    ),
    velocities=(Row("GLOBAL_POSITION_INT", ("vx", "vy", "vz"), 100.0, valid=_knows_velocity),),
    turn_rates=(Row("ATTITUDE_QUATERNION", _RATES), Row("ATTITUDE", _RATES)),
    # EKF_STATUS_REPORT's variances are test ratios instead of standard deviations
    sigmas=(
        Row("ESTIMATOR_STATUS", ("pos_horiz_accuracy", "pos_vert_accuracy")),
        Row(_receiver, ("h_acc", "v_acc"), 1e3, source="GPS_RAW_INT"),
    ),
    fix=(Row(_receiver, ("fix_type",)),),
    home=(Row("HOME_POSITION", ("latitude", "longitude", "altitude"), _UNITS),),
    reception=(Row(_receiver, ("satellites_visible", "eph"), (1.0, 100.0), source="GPS_RAW_INT"),),
    clocks=(
        Row("SYSTEM_TIME", ("time_unix_usec",), factor=1e-6, source="system_time"),
        Row(_make_reception_topic, ("utc_s",)),
    ),
    undulation=(Row(_receiver, ("alt_ellipsoid", "alt"), 1e3, valid=_has_ellipsoid),),
    resets=StatedResets(texts=(("STATUSTEXT", "text"),)),
)


def read_tlog(path: str | Path) -> FlightLog:
    """Read a telemetry log.

    Raises
    ------
    InputError
        The file is missing, empty, not a telemetry log, or holds no message of an autopilot.
    """
    frames = _frames(str(path))
    systems = find_vehicles(frames)
    notes = _scan_notes(frames)
    if len(systems) > 1:
        notes.append(f"autopilots {systems} are in the log; number {systems[0]} was used")
    streams = split_boots(frames, systems[0]) if systems else []
    if not streams:
        raise InputError(path, _explain_missing_autopilot(frames))
    vehicle, firmware = _vehicle(frames, systems[0])
    log = FlightLog(
        path=str(path),
        kind="tlog",
        vehicle=vehicle,
        firmware=firmware,
        messages=_counts(frames, streams),
        notes=tuple(notes),
    )
    return build_log(log, streams, TABLE)


def _frames(path: str) -> FrameTable:
    data = read_bytes(path, "name a flight log")
    if not data:
        raise InputError(path, "is empty: copy the log from the ground station once more")
    frames = scan_frames(data)
    if not len(frames.start):
        raise InputError(path, "holds no intact MAVLink frame; is it a .tlog of a ground station?")
    return frames


def _scan_notes(frames: FrameTable) -> list[str]:
    notes = []
    if frames.skipped_bytes:
        notes.append(f"{frames.skipped_bytes} of {len(frames.data)} bytes belong to no frame")
    if frames.bad_checksum:
        notes.append(f"{frames.bad_checksum} frames failed their checksum and were dropped")
    if frames.unknown:
        notes.append(f"{frames.unknown} frames are of unknown messages and were skipped")
    return notes


def _explain_missing_autopilot(frames: FrameTable) -> str:
    names = sorted(message_name(number) for number in frames.rows_by_id)
    held = ", ".join(names[:15]) + (", ..." if len(names) > 15 else "")
    return (
        "holds no message of an autopilot with its time since boot; "
        f"it holds {held}. Was it recorded with the autopilot connected?"
    )


def _counts(frames: FrameTable, streams: list[Stream]) -> tuple[MessageCount, ...]:
    counts = []
    for number, rows in frames.rows_by_id.items():
        times = _boot_times(rows, streams)
        counts.append(
            MessageCount(
                name=message_name(number),
                count=len(rows),
                first_s=min(times, default=float("nan")),
                last_s=max(times, default=float("nan")),
            )
        )
    return tuple(sorted(counts, key=lambda count: count.name))


def _boot_times(rows: np.ndarray, streams: list[Stream]) -> list[float]:
    """Return boot times of the first and last of these frames in every boot."""
    times: list[float] = []
    for stream in streams:
        inside = rows[(rows >= stream.first_row) & (rows < stream.end_row)]
        if len(inside):
            times.extend(stream.boot_s(inside[[0, -1]]).tolist())
    return times


def _vehicle(frames: FrameTable, system: int) -> tuple[str, str]:
    """Return the kind of vehicle by its heartbeat; firmware by its greeting, else its version."""
    mine = (frames.system == system) & (frames.component == 1)
    beats = frames.columns("HEARTBEAT", frames.rows("HEARTBEAT", mine))["type"]
    vehicle = vehicle_kind(int(beats[-1])) if len(beats) else ""
    for text in frames.columns("STATUSTEXT", frames.rows("STATUSTEXT", mine)).get("text", ()):
        found = _FIRMWARE.search(bytes(text).decode("latin-1"))
        if found:
            return vehicle, found.group(0)
    versions = frames.columns("AUTOPILOT_VERSION", frames.rows("AUTOPILOT_VERSION", mine))
    for number in versions.get("flight_sw_version", ()):
        parts = [int(number) >> shift & 0xFF for shift in (24, 16, 8)]
        return vehicle, ".".join(map(str, parts))
    return vehicle, ""
