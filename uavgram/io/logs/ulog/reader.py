"""PX4's ULog (.ulg) as a FlightLog."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from uavgram.errors import InputError
from uavgram.io.logs.mavlink_dialect import vehicle_kind
from uavgram.io.logs.quality.boots import consistent
from uavgram.io.logs.ulog import events as ulog_events
from uavgram.io.logs.ulog import samples as ulog_pose
from uavgram.io.logs.ulog.topics import ULOG_MAGIC, UlogTables, read_tables
from uavgram.model.flight.log import Boot, FlightLog, MessageCount

__all__ = ["ULOG_MAGIC", "read_ulog"]

# Lowest byte of ver_sw_release (PX4 src/lib/version/version.c)
_RELEASE_KINDS = {0: "development", 64: "alpha", 128: "beta", 192: "candidate", 255: "release"}


def read_ulog(path: str | Path) -> FlightLog:
    """Read a ULog: one boot of a PX4 autopilot.

    Raises
    ------
    InputError
        The file is missing, empty, no ULog, or damaged beyond use.
    """
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise InputError(path, f"cannot be read: {error.strerror}") from error
    if not data:
        raise InputError(path, "is empty: copy the log from the autopilot once more")
    tables = read_tables(str(path), data)
    if not tables.topics:
        raise InputError(path, "holds no complete message: the file is cut; copy it once more")
    boot, notes = _boot(tables)
    return FlightLog(
        path=str(path),
        kind="ulog",
        vehicle=_vehicle(tables),
        firmware=_firmware(tables),
        boots=(boot,),
        messages=_counts(tables),
        undulation_m=ulog_pose.undulation_m(tables),
        notes=(*tables.notes, *notes),
    )


def _boot(tables: UlogTables) -> tuple[Boot, tuple[str, ...]]:
    positions, position_notes = ulog_pose.positions(tables)
    events, event_notes = ulog_events.camera_events(tables)
    attitudes, attitude_notes = ulog_pose.attitudes(tables)
    gimbal, gimbal_notes = ulog_pose.gimbal(tables)
    boot = Boot(
        positions=positions,
        attitudes=attitudes,
        gimbal=gimbal,
        sigmas=ulog_pose.sigmas(tables),
        events=events,
        home=ulog_events.home(tables),
        clocks=ulog_events.gps_clock(tables),
    )
    boot, remarks = consistent(boot)
    return boot, (*position_notes, *attitude_notes, *gimbal_notes, *event_notes, *remarks)


def _counts(tables: UlogTables) -> tuple[MessageCount, ...]:
    """Rows of every topic, its instances together; PX4 stamps what was never published with 0."""
    counts = []
    for name, topics in sorted(tables.topics.items()):
        time = np.concatenate([topic.time_s for topic in topics])
        stamped = time[time + tables.started_s > 0]
        first, last = (stamped.min(), stamped.max()) if len(stamped) else (np.nan, np.nan)
        counts.append(
            MessageCount(name=name, count=len(time), first_s=float(first), last_s=float(last))
        )
    return tuple(counts)


def _vehicle(tables: UlogTables) -> str:
    """Kind of vehicle by vehicle_status, else by the parameter MAV_TYPE."""
    status = tables.topic("vehicle_status")
    stated = np.nan if status is None else float(status.column("system_type")[-1])
    number = stated if np.isfinite(stated) else tables.parameters.get("MAV_TYPE", 0)
    return vehicle_kind(int(number))


def _firmware(tables: UlogTables) -> str:
    """Such as ``PX4 v1.11.2 (development, 8583f1da)``."""
    name = str(tables.info.get("sys_name", "PX4"))
    version = tables.info.get("ver_sw_release")
    commit = str(tables.info.get("ver_sw", ""))[:8]
    if not isinstance(version, int):
        return f"{name} ({commit})" if commit else name
    number = ".".join(str(version >> shift & 0xFF) for shift in (24, 16, 8))
    kind = _RELEASE_KINDS.get(version & 0xFF, "unknown kind")
    return f"{name} v{number} ({kind}, {commit})" if commit else f"{name} v{number} ({kind})"
