"""MAVLink telemetry logs (.tlog) as a FlightLog."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from pymavlink.dialects.v20 import all as dialect

from uavgram.errors import InputError
from uavgram.io import tlog_pose
from uavgram.io.mavlink_frames import FrameTable, message_name, scan_frames
from uavgram.io.samples import in_order, is_height, is_place
from uavgram.io.tlog_stream import Stream, boots, vehicles
from uavgram.model.telemetry import (
    Boot,
    CameraEvents,
    ClockSamples,
    FlightLog,
    HomeSamples,
    MessageCount,
)

_EPOCH_USEC = 1e15  # a greater time is microseconds since 1970 (2001 on), a smaller one since boot
_WRAP_S = 2.0**32 * 1e-6
_FIRMWARE = re.compile(r"\b(Ardu\w+|APM:\w+|PX4)\s+[Vv]?\d[\w.\-]*(\s+\(\w+\))?")


def read_tlog(path: str | Path) -> FlightLog:
    """Read a telemetry log.

    Raises
    ------
    InputError
        The file is missing, empty, no telemetry log, or holds no position of a vehicle.
    """
    frames = _frames(str(path))
    systems = vehicles(frames)
    notes = _scan_notes(frames)
    if len(systems) > 1:
        notes.append(f"autopilots {systems} are in the log; number {systems[0]} was used")
    streams = boots(frames, systems[0]) if systems else []
    if len(streams) > 1:
        notes.append(f"the boot clock starts again {len(streams) - 1} times: several boots")
    found: list[Boot] = []
    for stream in streams:
        boot, remarks = _boot(stream)
        notes.extend(remarks)
        if boot.positions is not None:
            found.append(boot)
    if not found:
        raise InputError(path, _no_positions(frames))
    vehicle, firmware = _vehicle(frames, systems[0])
    return FlightLog(
        path=str(path),
        kind="tlog",
        vehicle=vehicle,
        firmware=firmware,
        boots=tuple(found),
        messages=_counts(frames, streams),
        undulation_m=_undulation_m(streams),
        notes=tuple(dict.fromkeys(notes)),
    )


def _frames(path: str) -> FrameTable:
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise InputError(path, f"cannot be read: {error.strerror}") from error
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


def _boot(stream: Stream) -> tuple[Boot, tuple[str, ...]]:
    events, notes = _events(stream)
    boot = Boot(
        positions=tlog_pose.positions(stream),
        attitudes=tlog_pose.attitudes(stream),
        gimbal=tlog_pose.gimbal(stream),
        sigmas=tlog_pose.sigmas(stream),
        events=events,
        home=_home(stream),
        clocks=_clocks(stream),
    )
    return boot, notes


def _events(stream: Stream) -> tuple[CameraEvents | None, tuple[str, ...]]:
    """CAMERA_FEEDBACK on the boot clock.

    Its time_usec changes its clock (ArduPilot, AP_Camera_Backend.cpp): UTC without a feedback pin,
    microseconds since boot in 32 bits with one. UTC is taken back to the boot clock by the
    vehicle's own SYSTEM_TIME, whose clock it is, right or wrong.
    """
    columns, rows = stream.columns("CAMERA_FEEDBACK")
    if not columns:
        return None, ()
    stated = columns["time_usec"].astype(np.float64)
    near = stream.boot_s(rows)
    since_boot = stated * 1e-6
    since_boot += np.round((near - since_boot) / _WRAP_S) * _WRAP_S
    is_utc = stated > _EPOCH_USEC
    notes = []
    if is_utc.any():
        offset, known = _utc_minus_boot(stream, rows)
        since_boot = np.where(is_utc, stated * 1e-6 - offset if known else np.nan, since_boot)
        if not known:
            notes.append(
                f"{int(is_utc.sum())} CAMERA_FEEDBACK messages state UTC but the log has no "
                "SYSTEM_TIME to place them; they were not used"
            )
    kept = in_order(since_boot, np.abs(since_boot - near) < 60.0)
    if not len(kept):
        return None, tuple(notes)
    events = CameraEvents(
        time_boot_s=since_boot[kept],
        image_number=columns["img_idx"].astype(np.int64)[kept],
        confirmed=np.ones(len(kept)),
        source="CAMERA_FEEDBACK",
    )
    return events, tuple(notes)


def _utc_minus_boot(stream: Stream, rows: np.ndarray) -> tuple[np.ndarray, bool]:
    """(K,) the vehicle's UTC minus its boot time at these frames; whether it states any."""
    columns, found = stream.columns("SYSTEM_TIME")
    if not columns:
        return np.zeros(len(rows)), False
    utc = columns["time_unix_usec"].astype(np.float64) * 1e-6
    some = utc > 0
    if not some.any():
        return np.zeros(len(rows)), False
    difference = utc - columns["time_boot_ms"] * 1e-3
    return np.interp(rows, found[some], difference[some]), True


def _clocks(stream: Stream) -> tuple[ClockSamples, ...]:
    clocks = []
    columns, _ = stream.columns("SYSTEM_TIME")
    if columns:
        utc = columns["time_unix_usec"].astype(np.float64) * 1e-6
        time = columns["time_boot_ms"] * 1e-3
        rows = in_order(time, utc > 0)
        if len(rows):
            clocks.append(
                ClockSamples(time_boot_s=time[rows], utc_s=utc[rows], source="system_time")
            )
    receive = stream.frames.receive_s[stream.clock_row]
    rows = in_order(stream.clock_boot_s, receive > 0)
    if len(rows):
        clocks.append(
            ClockSamples(
                time_boot_s=stream.clock_boot_s[rows], utc_s=receive[rows], source="receive"
            )
        )
    return tuple(clocks)


def _home(stream: Stream) -> HomeSamples | None:
    columns, found = stream.columns("HOME_POSITION")
    if not columns:
        return None
    time = stream.boot_s(found)
    latitude, longitude = columns["latitude"] / 1e7, columns["longitude"] / 1e7
    height = columns["altitude"] / 1e3
    rows = in_order(time, is_place(latitude, longitude) & is_height(height))
    if not len(rows):
        return None
    return HomeSamples(
        time_boot_s=time[rows],
        latitude_deg=latitude[rows],
        longitude_deg=longitude[rows],
        height_m=height[rows],
        datum="msl",
        source="HOME_POSITION",
    )


def _undulation_m(streams: list[Stream]) -> float:
    """Geoid above ellipsoid: median of alt_ellipsoid - alt in GPS_RAW_INT; NaN without (0)."""
    for stream in streams:
        columns, _ = stream.columns("GPS_RAW_INT")
        if not columns:
            continue
        ellipsoid, sea_level = columns["alt_ellipsoid"] / 1e3, columns["alt"] / 1e3
        stated = (columns["alt_ellipsoid"] != 0) & (columns["fix_type"] >= 3)
        stated &= np.abs(ellipsoid - sea_level) < 150
        if stated.any():
            return float(np.median((ellipsoid - sea_level)[stated]))
    return float("nan")


def _no_positions(frames: FrameTable) -> str:
    names = sorted({message_name(int(n)) for n in np.unique(frames.message_id)})
    held = ", ".join(names[:15]) + (", ..." if len(names) > 15 else "")
    return (
        "holds no usable GLOBAL_POSITION_INT of an autopilot; "
        f"it holds {held}. Was it recorded in flight, with GPS?"
    )


def _counts(frames: FrameTable, streams: list[Stream]) -> tuple[MessageCount, ...]:
    counts = []
    for number in np.unique(frames.message_id).tolist():
        rows = np.flatnonzero(frames.message_id == number)
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
    """Boot times of the first and last of these frames in every boot."""
    times: list[float] = []
    for stream in streams:
        inside = rows[(rows >= stream.first_row) & (rows < stream.end_row)]
        if len(inside):
            times.extend(stream.boot_s(inside[[0, -1]]).tolist())
    return times


def _vehicle(frames: FrameTable, system: int) -> tuple[str, str]:
    """Kind of vehicle by its heartbeat; firmware by its greeting, else by AUTOPILOT_VERSION."""
    mine = (frames.system == system) & (frames.component == 1)
    beats = frames.columns("HEARTBEAT", frames.rows("HEARTBEAT", mine)).get(
        "type", np.zeros(0, int)
    )
    kind = dialect.enums["MAV_TYPE"].get(int(beats[-1])) if len(beats) else None
    vehicle = kind.name.removeprefix("MAV_TYPE_").lower().replace("_", " ") if kind else ""
    for text in frames.columns("STATUSTEXT", frames.rows("STATUSTEXT", mine)).get("text", ()):
        found = _FIRMWARE.search(bytes(text).decode("latin-1"))
        if found:
            return vehicle, found.group(0)
    versions = frames.columns("AUTOPILOT_VERSION", frames.rows("AUTOPILOT_VERSION", mine))
    for number in versions.get("flight_sw_version", ()):
        parts = [int(number) >> shift & 0xFF for shift in (24, 16, 8)]
        return vehicle, ".".join(map(str, parts))
    return vehicle, ""
