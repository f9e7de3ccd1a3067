"""One vehicle's frames in a telemetry log, with the boot clock at each of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.io.logs.quality.rows import LONGEST_BOOT_S, restarts
from uavgram.io.logs.tlog.frames import Columns, FrameTable
from uavgram.model.arrays import Floats, Ints

# Sent by every autopilot while it runs, each with time_boot_ms.
_CLOCKED = (
    "SYSTEM_TIME",
    "GLOBAL_POSITION_INT",
    "LOCAL_POSITION_NED",
    "ATTITUDE",
    "ATTITUDE_QUATERNION",
)
_AUTOPILOT_COMPONENT = 1
_NO_AUTOPILOT = 8  # MAV_AUTOPILOT_INVALID: a ground station, a camera, a gimbal


@dataclass(frozen=True, eq=False)
class Stream:
    """The frames of one boot of one vehicle.

    Attributes
    ----------
    frames
        The whole file.
    system
        Number of the vehicle.
    first_row, end_row
        Which frames belong to this boot.
    clock_row, clock_boot_s
        (C,) frames that state the boot time, and what they state.
    """

    frames: FrameTable
    system: int
    first_row: int
    end_row: int
    clock_row: Ints
    clock_boot_s: Floats

    def rows(self, name: str) -> Ints:
        """(K,) frames of one message type, from the autopilot; else from the vehicle's others."""
        rows = self.frames.rows(name)
        rows = rows[np.searchsorted(rows, self.first_row) : np.searchsorted(rows, self.end_row)]
        rows = rows[self.frames.system[rows] == self.system]
        component = self.frames.component[rows]
        own = component == _AUTOPILOT_COMPONENT
        if own.any() or not len(rows):
            return np.asarray(rows[own])
        return np.asarray(rows[component == np.bincount(component).argmax()], dtype=np.int64)

    def columns(self, name: str) -> tuple[Columns, Ints]:
        """Fields of one message type and the rows of its frames; no fields where there is none."""
        rows = self.rows(name)
        return (self.frames.columns(name, rows) if len(rows) else {}), rows

    def boot_s(self, rows: Ints) -> Floats:
        """(K,) boot time at frames that state none: between those of their neighbours."""
        return np.interp(rows, self.clock_row, self.clock_boot_s)


def vehicles(frames: FrameTable) -> list[int]:
    """Numbers of the autopilots that the log hears, the one with the most positions first."""
    beats = frames.rows("HEARTBEAT", frames.component == _AUTOPILOT_COMPONENT)
    kinds = frames.columns("HEARTBEAT", beats).get("autopilot", np.zeros(0))
    systems = set(frames.system[beats[kinds != _NO_AUTOPILOT]].tolist())
    placed = frames.system[frames.rows("GLOBAL_POSITION_INT")]
    systems = systems or set(placed.tolist())
    return sorted(systems, key=lambda system: (-int((placed == system).sum()), system))


def boots(frames: FrameTable, system: int) -> list[Stream]:
    """One stream for each time that the vehicle's boot clock starts."""
    mine = (frames.system == system) & (frames.component == _AUTOPILOT_COMPONENT)
    rows_of = [frames.rows(name, mine) for name in _CLOCKED]
    if not any(len(rows) for rows in rows_of):
        return []
    times_of = [
        frames.columns(name, rows)["time_boot_ms"].astype(np.float64) * 1e-3
        for name, rows in zip(_CLOCKED, rows_of, strict=True)
    ]
    row, time = np.concatenate(rows_of), np.concatenate(times_of)
    sane = (time > 0) & (time < LONGEST_BOOT_S)
    row, time = row[sane], time[sane]
    order = np.argsort(row, kind="stable")
    row, time = row[order], time[order]
    if not len(row):
        return []
    edges = [0, *restarts(time).tolist(), len(row)]
    streams = []
    for k in range(len(edges) - 1):
        part = slice(edges[k], edges[k + 1])
        first = 0 if k == 0 else int(row[edges[k]])
        end = len(frames.start) if k == len(edges) - 2 else int(row[edges[k + 1]])
        streams.append(Stream(frames, system, first, end, row[part], time[part]))
    return streams
