"""ArduPilot's DataFlash logs (.bin, .BIN, text .log) as a FlightLog."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from uavgram.errors import InputError
from uavgram.io import dataflash_events, dataflash_pose
from uavgram.io.dataflash_pose import Tables, boot_time_s
from uavgram.io.dataflash_tables import DataflashTables, index_binary
from uavgram.io.dataflash_text import TextTables, index_text
from uavgram.io.samples import restarts
from uavgram.model.telemetry import Boot, FlightLog, MessageCount

_FIRMWARE = re.compile(r"\b(Ardu\w+|APM:\w+|Blimp|AntennaTracker)\s+V?\d[\w.\-]*(\s+\(\w+\))?")


def read_dataflash(path: str | Path) -> FlightLog:
    """Read a DataFlash log, binary or text.

    Raises
    ------
    InputError
        The file is missing, empty, no DataFlash log, or holds no position.
    """
    tables = _index(str(path))
    parts = _parts(tables)
    notes = list(tables.notes)
    if len(parts) > 1:
        notes.append(f"the boot clock starts again {len(parts) - 1} times: several boots")
    boots: list[Boot] = []
    for part in parts:
        boot, remarks = _boot(part)
        notes.extend(remarks)
        if boot.positions is not None:
            boots.append(boot)
    if not boots:
        raise InputError(path, _no_positions(tables))
    vehicle, firmware = _vehicle(tables)
    return FlightLog(
        path=str(path),
        kind="dataflash",
        vehicle=vehicle,
        firmware=firmware,
        boots=tuple(boots),
        messages=_counts(tables),
        undulation_m=dataflash_events.undulation_m(tables),
        notes=tuple(dict.fromkeys(notes)),
    )


def _index(path: str) -> DataflashTables | TextTables:
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise InputError(path, f"cannot be read: {error.strerror}") from error
    if not data:
        raise InputError(path, "is empty: copy the log from the autopilot once more")
    if b"FMT," in data[:8000]:
        return index_text(path, data)
    return index_binary(path, data)


def _parts(tables: DataflashTables | TextTables) -> list[Tables]:
    """One set of tables for each boot; binary files only, text has no common order."""
    if isinstance(tables, TextTables):
        return [tables]
    guide = max(("ATT", "POS", "GPS"), key=tables.count)
    if tables.count(guide) == 0:
        return [tables]
    starts = tables.offsets[guide][restarts(boot_time_s(tables.columns(guide)))]
    edges = [0, *starts.tolist(), len(tables.data)]
    return [_between(tables, edges[i], edges[i + 1]) for i in range(len(edges) - 1)]


def _between(tables: DataflashTables, start: int, end: int) -> DataflashTables:
    inside = {name: o[(o >= start) & (o < end)] for name, o in tables.offsets.items()}
    return replace(tables, offsets=inside)


def _boot(tables: Tables) -> tuple[Boot, tuple[str, ...]]:
    core = dataflash_pose.primary_core(tables)
    positions, position_notes = dataflash_pose.positions(tables, core)
    events, event_notes = dataflash_events.camera_events(tables)
    clock = dataflash_events.gps_clock(tables)
    boot = Boot(
        positions=positions,
        attitudes=dataflash_pose.attitudes(tables, core),
        gimbal=dataflash_pose.gimbal(tables),
        sigmas=dataflash_pose.sigmas(tables, core),
        events=events,
        home=dataflash_events.home(tables),
        clocks=() if clock is None else (clock,),
    )
    return boot, (*position_notes, *event_notes)


def _names(tables: DataflashTables | TextTables) -> list[str]:
    names = tables.rows if isinstance(tables, TextTables) else tables.offsets
    return sorted(name for name in names if tables.count(name))


def _no_positions(tables: DataflashTables | TextTables) -> str:
    names = _names(tables)
    if not names:
        return "holds no complete message: the file is cut or damaged; copy it once more"
    held = ", ".join(names[:15]) + (", ..." if len(names) > 15 else "")
    return (
        "holds no usable position (POS, XKF1 with ORGN, or GPS with a 3-D fix); "
        f"it holds {held}. Was it recorded in flight, with GPS?"
    )


def _counts(tables: DataflashTables | TextTables) -> tuple[MessageCount, ...]:
    found = []
    for name in _names(tables):
        ends = [tables.columns(name, rows) for rows in (slice(0, 1), slice(-1, None))]
        first, last = (boot_time_s(c)[0] if c and "TimeUS" in c else np.nan for c in ends)
        found.append(
            MessageCount(
                name=name, count=tables.count(name), first_s=float(first), last_s=float(last)
            )
        )
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
