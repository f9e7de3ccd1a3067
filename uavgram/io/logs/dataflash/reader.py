"""ArduPilot's DataFlash logs (.bin, .BIN, text .log) as a FlightLog."""

from __future__ import annotations

import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from uavgram.errors import InputError
from uavgram.io.logs.dataflash import events as dataflash_events
from uavgram.io.logs.dataflash import gimbal as dataflash_gimbal
from uavgram.io.logs.dataflash import samples as dataflash_pose
from uavgram.io.logs.dataflash.binary import index_binary
from uavgram.io.logs.dataflash.formats import odd_names
from uavgram.io.logs.dataflash.resets import stated_resets
from uavgram.io.logs.dataflash.samples import boot_time_s
from uavgram.io.logs.dataflash.tables import Tables
from uavgram.io.logs.dataflash.text import index_text
from uavgram.io.logs.log_bytes import read_log_bytes
from uavgram.io.logs.quality.agreement import disagreements
from uavgram.io.logs.quality.boots import checked_boot
from uavgram.io.logs.quality.rows import restarts
from uavgram.model.flight.log import Boot, FlightLog, MessageCount

_FIRMWARE = re.compile(r"\b(Ardu\w+|APM:\w+|Blimp|AntennaTracker)\s+V?\d[\w.\-]*(\s+\(\w+\))?")

# PX4's first log format borrows DataFlash's framing and means other things by the same names.
_SDLOG2 = (
    "is a PX4 log of the old form sdlog2 (.px4log), which is not read here: give the ground "
    "station's .tlog of this flight, or the photos' positions and angles as a table (`poses`); "
    "newer PX4 firmware writes .ulg, which is read"
)


def read_dataflash(path: str | Path) -> FlightLog:
    """Read a DataFlash log, binary or text.

    Raises
    ------
    InputError
        The file is missing, empty, no DataFlash log (or PX4's sdlog2, which looks like one), or
        holds no complete message.
    """
    tables = _index(str(path))
    if "StartTime" in tables.ends("TIME"):
        raise InputError(path, _SDLOG2)
    parts = _parts(tables)
    formats = (piece.format for pieces in tables.pieces.values() for piece in pieces)
    notes = [*tables.notes, *(note for fmt in formats for note in odd_names(fmt))]
    if len(parts) > 1:
        notes.append(f"the boot clock starts again {len(parts) - 1} times: several boots")
    boots = [_boot(part) for part in parts]
    notes += [note for _, remarks in boots for note in remarks]
    if not tables.names:
        raise InputError(
            path, "holds no complete message: the file is cut or damaged; copy it once more"
        )
    vehicle, firmware = _vehicle(tables)
    return FlightLog(
        path=str(path),
        kind="dataflash",
        vehicle=vehicle,
        firmware=firmware,
        boots=tuple(boot for boot, _ in boots),
        messages=_counts(tables),
        undulation_m=dataflash_events.undulation_m(tables),
        notes=tuple(dict.fromkeys(notes)),
    )


def _index(path: str) -> Tables:
    data = read_log_bytes(path, "autopilot")
    if b"FMT," in data[:8000]:
        return index_text(path, data)
    return index_binary(path, data)


def _parts(tables: Tables) -> list[Tables]:
    """One set of tables for each boot."""
    guide = max(("ATT", "POS", "GPS"), key=tables.count)
    if tables.count(guide) == 0:
        return [tables]
    starts = tables.places(guide)[restarts(boot_time_s(tables.columns(guide)))]
    edges = [0, *starts.tolist(), sys.maxsize]
    return [tables.between(edges[i], edges[i + 1]) for i in range(len(edges) - 1)]


def _boot(tables: Tables) -> tuple[Boot, tuple[str, ...]]:
    core = dataflash_pose.primary_core(tables)
    clocks = dataflash_events.gps_clock(tables)
    heard = dataflash_pose.receiver(tables)
    boot, notes = checked_boot(
        dataflash_pose.positions(tables, core),
        dataflash_pose.attitudes(tables, core),
        dataflash_gimbal.gimbal(tables),
        dataflash_events.camera_events(tables, clocks),
        sigmas=dataflash_pose.sigmas(tables, core, heard),
        home=dataflash_events.home(tables),
        clocks=clocks,
        turn_rates=dataflash_pose.turn_rates(tables),
    )
    receiver, attitude = dataflash_pose.second_opinions(tables, core, heard[0])
    boot = replace(
        boot,
        velocities=dataflash_pose.velocities(tables, core),
        receiver=receiver,
        reception=dataflash_pose.reception(heard[0]),
        resets=stated_resets(tables),
    )
    origin = dataflash_events.estimator_origin(tables)
    doubts = disagreements(boot, receiver, attitude, origin)
    return boot, (*notes, *doubts)


def _counts(tables: Tables) -> tuple[MessageCount, ...]:
    found = []
    for name in tables.names:
        ends = tables.ends(name)
        times = boot_time_s(ends) if "TimeUS" in ends else np.full(1, np.nan)
        first, last = float(times[0]), float(times[-1])
        count = tables.count(name)
        found.append(MessageCount(name=name, count=count, first_s=first, last_s=last))
    return tuple(found)


def _vehicle(tables: Tables) -> tuple[str, str]:
    """Vehicle and firmware as the first MSG that names them has it; VER as the fallback."""
    for text in tables.columns("MSG").get("Message", ()):
        found = _FIRMWARE.search(bytes(text).split(b"\0")[0].decode("latin-1"))
        if found:
            return found.group(1), found.group(0)
    for text in tables.columns("VER").get("FWS", ()):
        firmware = bytes(text).split(b"\0")[0].decode("latin-1")
        return firmware.split(" ")[0], firmware
    return "", ""
