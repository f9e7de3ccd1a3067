"""MAVLink telemetry logs (.tlog) as a FlightLog."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from uavgram.errors import InputError
from uavgram.io.logs.log_bytes import read_log_bytes
from uavgram.io.logs.mavlink_dialect import message_name, vehicle_kind
from uavgram.io.logs.quality.agreement import disagreements
from uavgram.io.logs.quality.boots import checked_boot
from uavgram.io.logs.quality.samples import clock_samples, home_samples, median_undulation_m
from uavgram.io.logs.tlog import samples as tlog_pose
from uavgram.io.logs.tlog.events import camera_events
from uavgram.io.logs.tlog.frames import FrameTable, scan_frames
from uavgram.io.logs.tlog.resets import stated_resets
from uavgram.io.logs.tlog.stream import Stream, boots, vehicles
from uavgram.model.flight.log import Boot, ClockSamples, FlightLog, HomeSamples, MessageCount

_FIRMWARE = re.compile(r"\b(Ardu\w+|APM:\w+|PX4)\s+[Vv]?\d[\w.\-]*(\s+\(\w+\))?")


def read_tlog(path: str | Path) -> FlightLog:
    """Read a telemetry log.

    Raises
    ------
    InputError
        The file is missing, empty, no telemetry log, or holds nothing of an autopilot.
    """
    frames = _frames(str(path))
    systems = vehicles(frames)
    notes = _scan_notes(frames)
    if len(systems) > 1:
        notes.append(f"autopilots {systems} are in the log; number {systems[0]} was used")
    streams = boots(frames, systems[0]) if systems else []
    if len(streams) > 1:
        notes.append(f"the boot clock starts again {len(streams) - 1} times: several boots")
    found = [_boot(stream) for stream in streams]
    notes += [note for _, remarks in found for note in remarks]
    if not found:
        raise InputError(path, _no_autopilot(frames))
    vehicle, firmware = _vehicle(frames, systems[0])
    return FlightLog(
        path=str(path),
        kind="tlog",
        vehicle=vehicle,
        firmware=firmware,
        boots=tuple(boot for boot, _ in found),
        messages=_counts(frames, streams),
        undulation_m=_undulation_m(streams),
        notes=tuple(dict.fromkeys(notes)),
    )


def _frames(path: str) -> FrameTable:
    data = read_log_bytes(path, "ground station")
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
    attitudes, heard = tlog_pose.attitudes(stream), tlog_pose.receiver(stream)
    boot, notes = checked_boot(
        tlog_pose.positions(stream),
        attitudes,
        tlog_pose.gimbal(stream, attitudes[0]),
        camera_events(stream),
        sigmas=tlog_pose.sigmas(stream, heard),
        home=_home(stream),
        clocks=_clocks(stream),
        turn_rates=tlog_pose.turn_rates(stream),
    )
    receiver, attitude = tlog_pose.second_opinions(stream, heard)
    boot = replace(
        boot,
        velocities=tlog_pose.velocities(stream),
        receiver=receiver,
        reception=tlog_pose.reception(stream, heard),
        resets=stated_resets(stream),
    )
    return boot, (*notes, *disagreements(boot, receiver, attitude))


def _clocks(stream: Stream) -> tuple[ClockSamples, ...]:
    stated: tuple[ClockSamples, ...] = ()
    columns, _ = stream.columns("SYSTEM_TIME")
    if columns:
        utc = columns["time_unix_usec"].astype(np.float64) * 1e-6
        stated = clock_samples("system_time", columns["time_boot_ms"] * 1e-3, utc, utc > 0)
    receive = stream.frames.receive_s(stream.clock_row)
    return (*stated, *clock_samples("receive", stream.clock_boot_s, receive, receive > 0))


def _home(stream: Stream) -> HomeSamples | None:
    columns, found = stream.columns("HOME_POSITION")
    if not columns:
        return None
    place = columns["latitude"] / 1e7, columns["longitude"] / 1e7, columns["altitude"] / 1e3
    return home_samples("HOME_POSITION", stream.boot_s(found), place)


def _undulation_m(streams: list[Stream]) -> float:
    """Geoid above ellipsoid: median of alt_ellipsoid - alt in GPS_RAW_INT; NaN without (0)."""
    for stream in streams:
        columns, _ = tlog_pose.receiver(stream)
        if not columns:
            continue
        stated = columns["alt_ellipsoid"] != 0
        heights = (columns[name][stated] / 1e3 for name in ("alt_ellipsoid", "alt"))
        if np.isfinite(found := median_undulation_m(*heights)):
            return found
    return float("nan")


def _no_autopilot(frames: FrameTable) -> str:
    names = sorted(message_name(number) for number in frames.rows_by_id)
    held = ", ".join(names[:15]) + (", ..." if len(names) > 15 else "")
    return (
        "holds no message of an autopilot that tells its time since boot; "
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
