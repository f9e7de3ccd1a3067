"""PX4's ULog (.ulg) as a FlightLog."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from uavgram.errors import InputError
from uavgram.io.logs.mavlink_dialect import vehicle_kind
from uavgram.io.logs.quality.boots import checked_boot
from uavgram.io.logs.ulog import events as ulog_events
from uavgram.io.logs.ulog import samples as ulog_pose
from uavgram.io.logs.ulog.resets import stated_resets
from uavgram.io.logs.ulog.topics import UlogTables, read_tables
from uavgram.model.flight.log import FlightLog, MessageCount

# Lowest byte of ver_sw_release (PX4 src/lib/version/version.c)
_RELEASE_KINDS = {0: "development", 64: "alpha", 128: "beta", 192: "candidate", 255: "release"}

TOPICS = (
    *("vehicle_global_position", "vehicle_local_position", "vehicle_gps_position", "sensor_gps"),
    *("vehicle_attitude", "vehicle_angular_velocity", "vehicle_status", "home_position"),
    *("camera_capture", "camera_trigger", "gimbal_device_attitude_status", "mount_orientation"),
)


def read_ulog(path: str | Path) -> FlightLog:
    """Read a ULog: one boot of a PX4 autopilot.

    Raises
    ------
    InputError
        The file is missing, empty, no ULog, or damaged beyond use.
    """
    tables = read_tables(path, TOPICS)
    if not tables.counts:
        raise InputError(path, "holds no complete message: the file is cut; copy it once more")
    boot, notes = checked_boot(
        ulog_pose.positions(tables),
        ulog_pose.attitudes(tables),
        ulog_pose.gimbal(tables),
        ulog_events.camera_events(tables),
        sigmas=ulog_pose.sigmas(tables),
        home=ulog_events.home(tables),
        clocks=ulog_events.gps_clock(tables),
        turn_rates=ulog_pose.turn_rates(tables),
    )
    boot = replace(
        boot,
        velocities=ulog_pose.velocities(tables),
        receiver=ulog_pose.receiver_positions(tables),
        reception=ulog_pose.reception(tables),
        resets=stated_resets(tables),
    )
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


def _counts(tables: UlogTables) -> tuple[MessageCount, ...]:
    return tuple(
        MessageCount(name=name, count=found.rows, first_s=found.first_s, last_s=found.last_s)
        for name, found in sorted(tables.counts.items())
    )


def _vehicle(tables: UlogTables) -> str:
    """Kind of vehicle by vehicle_status, else by the parameter MAV_TYPE."""
    status = tables.topic("vehicle_status")
    stated = np.nan if status is None else float(status.column("system_type")[-1])
    number = stated if np.isfinite(stated) else tables.parameters.get("MAV_TYPE", 0)
    return vehicle_kind(int(number)) if isinstance(number, int | float) else ""


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
