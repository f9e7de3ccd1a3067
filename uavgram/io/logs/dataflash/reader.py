"""Reader of ArduPilot's DataFlash logs (.bin, .BIN, text .log): their table and its functions.

Field meanings: ArduPilot libraries/AP_AHRS/AP_AHRS_Logging.cpp, AP_NavEKF3_Logging.cpp, AP_GPS.cpp,
AP_Mount_Backend.cpp, AP_Camera_Backend.cpp (LogStructure.h of each). Numbers of events and errors:
AP_Logger/AP_Logger.h, LogEvent and LogErrorSubsystem.
"""

from __future__ import annotations

import re
import sys
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from typing import Literal

import numpy as np

from uavgram.errors import InputError
from uavgram.geometry.gps_time import utc_from_gps
from uavgram.input_files import read_bytes
from uavgram.io.logs.boots import ANY_CODE, StatedResets, Table, build_log
from uavgram.io.logs.camera_events import build_events, gimbal_from_angles, image_numbers
from uavgram.io.logs.dataflash.tables import (
    Columns,
    Tables,
    check_field_names,
    index_binary,
    index_text,
)
from uavgram.io.logs.messages import Found, Messages, Row, Topic, convert_to_numbers
from uavgram.io.logs.samples import clock_samples, find_plausible_rows, find_restarts, is_height
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.flight_log import CameraEvents, FlightLog, GimbalSamples, MessageCount

_FIRMWARE = re.compile(r"\b(Ardu\w+|APM:\w+|Blimp|AntennaTracker)\s+V?\d[\w.\-]*(\s+\(\w+\))?")
_ODD_ONES = 0.05  # share of all rows: fewer rows of another mount are damaged numbers of this one

# PX4's first log format uses DataFlash's framing with other meanings of the same names.
_SDLOG2 = (
    "is a PX4 log of the old form sdlog2 (.px4log), which is not read here: give the ground "
    "station's .tlog of this flight, or the photos' positions and angles as a table (`poses`); "
    "newer PX4 firmware writes .ulg, which is read"
)


class BootMessages(Messages):
    """Messages of one boot; those of the estimator are of the core that was used most of the time.

    Parameters
    ----------
    tables
        Of one boot.
    """

    def __init__(self, tables: Tables) -> None:
        self._tables = tables

    @cached_property
    def _core(self) -> int:
        for name in ("XKF4", "NKF4"):
            cores = convert_to_numbers(self._tables.columns(name).get("PI", np.zeros(0)))
            cores = cores[(cores >= 0) & (cores < 8)].astype(np.int64)
            if len(cores):
                return int(np.bincount(cores).argmax())
        return 0

    def read(self, name: str) -> Topic | None:
        """Return all messages of one type, or those of the core; None where there are none."""
        columns = self._tables.columns(name)
        topic = Topic(name, _boot_time_s(columns), columns)
        if "C" in columns:
            topic = topic.only(topic.column("C") == self._core)
        return topic if len(topic.time_s) else None


def _boot_time_s(columns: Columns) -> Floats:
    """Return (N,) seconds since boot: TimeUS, before ArduPilot 3.3 T (of GPS) or TimeMS."""
    for name, unit_s in (("TimeUS", 1e-6), ("T", 1e-3), ("TimeMS", 1e-3)):
        if name in columns:
            return convert_to_numbers(columns[name]) * unit_s
    rows = len(next(iter(columns.values()))) if columns else 0
    return np.full(rows, np.nan)


def _receiver(messages: BootMessages) -> Topic | None:
    """Return rows with a 3-D fix of the receiver in use (before 3.6 the second is GPS2)."""
    for name in ("GPS", "GPS2"):
        topic = messages.topic(name)
        if topic is None or "Lat" not in topic.fields:
            continue
        topic = topic.only(topic.column("Status") >= 3)
        # the one in use most of the time (U), else the one with most fixes, else the first
        used = topic.column("U") > 0
        seen, count = np.unique(
            _instance(topic)[used] if used.any() else _instance(topic), return_counts=True
        )
        if len(seen):
            return topic.only(_instance(topic) == seen[count.argmax()])
    return None


def _instance(topic: Topic) -> Floats:
    instance = topic.column("I")
    return np.where(np.isfinite(instance), instance, 0.0)


def _accuracies(messages: BootMessages) -> Topic | None:
    """Return the accuracies stated by the receiver in use."""
    gps = messages.topic(_receiver)
    if gps is None:
        return None
    topic = messages.topic({"GPS": "GPA", "GPS2": "GPA2"}[gps.name])
    if topic is None or "I" not in topic.fields:
        return topic
    return topic.only(_instance(topic) == _instance(gps)[0])


def _two_heights(messages: BootMessages) -> Topic | None:
    """Return GPS with the ellipsoidal heights of GPA, which have other times."""
    gps, gpa = messages.topic(_receiver), messages.topic(_accuracies)
    if gps is None or gpa is None:
        return None
    ellipsoid = gpa.column("AEl")
    rows = find_plausible_rows(gpa.time_s, is_height(ellipsoid))
    if not len(rows):
        return None
    at_fixes = np.interp(gps.time_s, gpa.time_s[rows], ellipsoid[rows])
    return replace(gps, fields=gps.fields | {"AEl": at_fixes})


def _gps_time(messages: BootMessages) -> Topic | None:
    """Return the UTC of each fix, at its arrival (GPA.SMS) where the log has it.

    TimeUS is the time at which the row was written, up to 40 ms later.
    """
    gps = messages.topic(_receiver)
    if gps is None:
        return None
    # before 3.3 GPS.TimeMS is the GPS time and T the boot time
    utc_s = _utc_s(gps.column("GWk", "Week"), gps.column("GMS", "TimeMS"))
    arrival = _arrival_s(messages.topic(_accuracies), gps.time_s)
    return Topic("gps", np.where(np.isnan(arrival), gps.time_s, arrival), {"utc_s": utc_s})


def _utc_s(week: Floats, milliseconds: Floats) -> Floats:
    """Convert GPS times to (N,) UTC; NaN for invalid ones."""
    sane = (week > 1000) & (week < 5000) & (milliseconds >= 0) & (milliseconds < 604800000)
    utc_s = utc_from_gps(np.where(sane, week, 0.0), np.where(sane, milliseconds, 0.0))
    return np.where(sane, utc_s, np.nan)


def _arrival_s(accuracies: Topic | None, logged_s: Floats) -> Floats:
    """Return (N,) GPA.SMS of the row logged at the same time, NaN where there is none."""
    nowhere = np.full(len(logged_s), np.nan)
    if accuracies is None:
        return nowhere
    time, sample = accuracies.time_s, accuracies.column("SMS") * 1e-3
    rows = find_plausible_rows(time, np.abs(time - sample) < 1.0)
    if not len(rows):
        return nowhere
    nearest = rows[np.clip(np.searchsorted(time[rows], logged_s), 0, len(rows) - 1)]
    return np.where(np.abs(time[nearest] - logged_s) < 1e-4, sample[nearest], np.nan)


def _origins(messages: BootMessages, kind: int) -> Topic | None:
    """Return ORGN of one type: 0, the origin of the estimator's offsets, or 1, home."""
    topic = messages.topic("ORGN")
    return None if topic is None else topic.only(topic.column("Type") == kind)


_ORIGIN, _HOME = partial(_origins, kind=0), partial(_origins, kind=1)


def _convert_offsets(messages: BootMessages) -> Topic | None:
    """Convert the estimator's offsets from its origin to latitude, longitude and altitude.

    With ArduPilot's own scale, with which the offsets were made (libraries/AP_Common/Location.cpp,
    LATLON_TO_M = 0.011131884502145034 m per 1e-7 degrees).
    """
    offsets, origins = messages.topic(*_CORES), messages.topic(_ORIGIN)
    if offsets is None or origins is None or not len(origins.time_s):
        return None
    time = offsets.time_s
    row = np.clip(np.searchsorted(origins.time_s, time, side="right") - 1, 0, None)
    latitude_0, longitude_0, height_0 = (origins.column(k)[row] for k in ("Lat", "Lng", "Alt"))
    meters_per_deg = 0.011131884502145034 * 1e7
    latitude = latitude_0 + offsets.column("PN") / meters_per_deg
    scale = np.cos(np.radians((latitude_0 + latitude) / 2))
    longitude = longitude_0 + offsets.column("PE") / (meters_per_deg * scale)
    height = height_0 - offsets.column("PD")
    fields = {"Lat": latitude, "Lng": longitude, "Alt": height}
    return Topic(f"{offsets.name}+ORGN", time, fields)


def _variances(messages: BootMessages) -> Topic | None:
    """Return the estimator's position variances V07, V08, V09 [m²] as standard deviations.

    XKF4's SP, SH... are test ratios instead of standard deviations. The estimator alone is
    over-confident where the receiver's error is correlated.
    """
    topic = messages.topic("XKV1", "NKV1")
    if topic is None:
        return None
    north, east, down = (topic.column(name) for name in ("V07", "V08", "V09"))
    horizontal, vertical = (np.sqrt(np.abs(v)) for v in ((north + east) / 2, down))
    return replace(topic, fields={"horizontal": horizontal, "vertical": vertical})


def _gimbal(messages: BootMessages) -> Found[GimbalSamples]:
    """Return MNT of the mount with most rows: yaw from north (YawE) if known, else from the nose.

    A mount without angles writes NaN; a remark counts rows with values that cannot be used.
    """
    topic = messages.topic("MNT")
    if topic is None:
        return None, ()
    angles = [topic.column(name) for name in ("Roll", "Pitch", "YawE", "YawB")]
    speaks = np.any(np.isfinite(angles), axis=0)
    if not speaks.any():
        return None, ()
    mine, notes = _select_mount(topic, speaks)
    roll, pitch, earth, vehicle = (column[mine] for column in angles)
    # yaw from north, if known in at least as many rows as yaw from the nose
    known, nose = int(np.isfinite(earth).sum()), int(np.isfinite(vehicle).sum())
    use_earth = known > 0 and known >= nose
    samples, remarks = gimbal_from_angles(
        topic.time_s[mine],
        np.stack([roll, pitch, earth if use_earth else vehicle], axis=1),
        "MNT",
        yaw_frame="earth" if use_earth else "vehicle",
        stated=np.ones(int(mine.sum()), dtype=bool),
    )
    notes += remarks
    if samples is None:
        missing = [name for name in ("Roll", "Pitch") if name not in topic.fields]
        why = f": they have no {' and no '.join(missing)}" if missing else ""
        notes = (*notes, f"the gimbal's attitude (MNT) could not be used{why}")
    return samples, notes


def _select_mount(topic: Topic, speaks: Bools) -> tuple[Bools, tuple[str, ...]]:
    """Return (N,) rows of the mount with most valid rows, and remarks on the others."""
    if "I" not in topic.fields:
        return speaks, ()
    stated = topic.column("I")
    seen, count = np.unique(stated[speaks & np.isfinite(stated)], return_counts=True)
    if not len(seen):
        return speaks, ("MNT rows name no mount: they were taken for one",)
    chosen = float(seen[count.argmax()])
    mine = speaks & (stated == chosen)
    others = int(speaks.sum() - mine.sum())
    if not others:
        return mine, ()
    if others < _ODD_ONES * len(stated):
        return mine, (f"{others} of {len(stated)} MNT rows name no mount that is there: dropped",)
    held = " and ".join(f"{number:g}" for number in seen)
    return mine, (f"MNT is of mounts {held}; number {chosen:g}, which has most rows, was used",)


def _events(messages: BootMessages) -> Found[CameraEvents]:
    """Join CAM with TRIG by the image number.

    With a feedback pin TRIG is the command and CAM the exposure (some 0.1 s later), and a TRIG
    whose number has no CAM is a missed shot; without one there is CAM only, at the command
    (ArduPilot, libraries/AP_Camera/AP_Camera_Backend.cpp).
    """
    cam_time, cam_number, notes = _shots(messages, "CAM")
    trig_time, trig_number, _ = _shots(messages, "TRIG")
    missed = ~np.isin(trig_number, cam_number) | (trig_number < 0)
    present = [name for name, has in (("TRIG", trig_time), ("CAM", cam_time)) if len(has)]
    instant: Literal["feedback", "command"] = "feedback" if len(present) == 2 else "command"
    events, remarks = build_events(
        "+".join(present),
        instant,
        (cam_time, cam_number, np.ones(len(cam_time))),
        (trig_time[missed], trig_number[missed]),
    )
    return events, (*notes, *remarks)


def _shots(messages: BootMessages, name: str) -> tuple[Floats, Ints, tuple[str, ...]]:
    """Return boot times and image numbers (-1: none) of CAM or TRIG, first camera only; remarks."""
    topic = messages.topic(name)
    if topic is None:
        return np.zeros(0), np.zeros(0, dtype=np.int64), ()
    notes: tuple[str, ...] = ()
    camera = topic.column("I")
    cameras = np.unique(camera[np.isfinite(camera)])
    if len(cameras) > 1:
        topic = topic.only(camera == cameras[0])
        held = " and ".join(f"{c:.0f}" for c in cameras)
        notes = (f"{name} is of cameras {held}; number {cameras[0]:.0f} was used",)
    time = topic.time_s
    if not any(field in topic.fields for field in ("TimeUS", "TimeMS", "T")):
        time = _compute_boot_times(messages, topic)
        remark = "carries no boot time (firmware before 3.3): placed by GPS time, up to 0.2 s early"
        notes = (*notes, f"{name} {remark}")
    rows = find_plausible_rows(time, np.ones(len(time), dtype=bool))
    return time[rows], image_numbers(topic.column("Img", "Image"))[rows], notes


def _compute_boot_times(messages: BootMessages, topic: Topic) -> Floats:
    """Return (N,) boot times of rows with the GPS time of the last fix; NaN where unknown."""
    stated = _CLOCK.read_values(messages)
    clock = None if stated is None else clock_samples(stated)
    if clock is None:
        return np.full(len(topic.time_s), np.nan)
    utc = _utc_s(topic.column("GPSWeek"), topic.column("GPSTime"))
    order = np.argsort(clock.utc_s, kind="stable")
    known, since_boot = clock.utc_s[order], clock.time_boot_s[order]
    inside = (utc >= known[0] - 1) & (utc <= known[-1] + 1)  # NaN compares False
    return np.where(inside, np.interp(utc, known, since_boot), np.nan)


_CORES = ("XKF1", "NKF1", "EKF1")
_QUATERNIONS = Row(("XKQ", "XKQ1", "NKQ", "NKQ1"), ("Q2", "Q3", "Q4", "Q1"))
_PLACE, _ANGLES = ("Lat", "Lng", "Alt"), ("Roll", "Pitch", "Yaw")
_ABOVE_HOME = ("RelHomeAlt", "RelAlt")
_LAGGING = "positions are the receiver's own (no POS, no XKF1 with ORGN): they lag by its delay"
_CLOCK = Row(_gps_time, ("utc_s",))

TABLE = Table(
    positions=(
        Row("POS", (*_PLACE, _ABOVE_HOME)),
        Row(_convert_offsets, _PLACE),
        Row(_receiver, (*_PLACE, _ABOVE_HOME), source="GPS", remark=_LAGGING),
    ),
    receiver=(Row(_receiver, (*_PLACE, _ABOVE_HOME), source="GPS"),),
    attitudes=(Row("ATT", _ANGLES), _QUATERNIONS),
    other_attitudes=(Row(("XKF1", "NKF1"), _ANGLES), _QUATERNIONS),
    gimbal=(_gimbal,),
    events=(_events,),
    velocities=(Row(_CORES, ("VN", "VE", "VD")),),
    turn_rates=(Row("RATE", ("R", "P", "Y"), factor=np.pi / 180),),  # actual, not desired
    sigmas=(
        Row(_variances, ("horizontal", "vertical")),
        Row(_accuracies, ("HAcc", "VAcc"), source="GPA"),
    ),
    tilts=(Row(("XKF4", "NKF4"), ("errRP",)),),
    fix=(Row(_receiver, ("Status",)),),
    home=(Row(_HOME, _PLACE),),
    origin=(Row(_ORIGIN, _PLACE),),
    reception=(Row(_receiver, ("NSats", "HDop"), source="GPS"),),
    clocks=(_CLOCK,),
    undulation=(Row(_two_heights, ("AEl", "Alt")),),
    resets=StatedResets(
        codes=(
            ("EV", ("Id",), {(60,): "reset of the height", (62,): "reset of the heading"}),
            (
                "ERR",
                ("Subsys", "ECode"),
                {
                    (11, 2): "glitch of the GPS",
                    (16, 2): "fault of the estimator (bad variances)",
                    (24, ANY_CODE): "change to another estimator",
                },
            ),
        ),
        texts=(("MSG", "Message"),),
    ),
)


def read_dataflash(path: str | Path) -> FlightLog:
    """Read a DataFlash log, binary or text.

    Raises
    ------
    InputError
        The file is missing, empty, not a DataFlash log (or PX4's sdlog2, which looks like one), or
        holds no complete message.
    """
    tables = _index(str(path))
    if "StartTime" in tables.ends("TIME"):
        raise InputError(path, _SDLOG2)
    if not tables.names:
        raise InputError(
            path, "holds no complete message: the file is cut or damaged; copy it once more"
        )
    formats = (piece.format for pieces in tables.pieces.values() for piece in pieces)
    vehicle, firmware = _vehicle(BootMessages(tables))
    log = FlightLog(
        path=str(path),
        kind="dataflash",
        vehicle=vehicle,
        firmware=firmware,
        messages=_counts(tables),
        notes=(*tables.notes, *(note for fmt in formats for note in check_field_names(fmt))),
    )
    return build_log(log, [BootMessages(part) for part in _parts(tables)], TABLE)


def _index(path: str) -> Tables:
    data = read_bytes(path, "name a flight log")
    if not data:
        raise InputError(path, "is empty: copy the log from the autopilot once more")
    if b"FMT," in data[:8000]:
        return index_text(path, data)
    return index_binary(path, data)


def _parts(tables: Tables) -> list[Tables]:
    """Return one set of tables for each boot."""
    guide = max(("ATT", "POS", "GPS"), key=tables.count)
    if tables.count(guide) == 0:
        return [tables]
    starts = tables.places(guide)[find_restarts(_boot_time_s(tables.columns(guide)))]
    edges = [0, *starts.tolist(), sys.maxsize]
    return [tables.between(edges[i], edges[i + 1]) for i in range(len(edges) - 1)]


def _counts(tables: Tables) -> tuple[MessageCount, ...]:
    found = []
    for name in tables.names:
        ends = tables.ends(name)
        times = _boot_time_s(ends) if "TimeUS" in ends else np.full(1, np.nan)
        first, last = float(times[0]), float(times[-1])
        count = tables.count(name)
        found.append(MessageCount(name=name, count=count, first_s=first, last_s=last))
    return tuple(found)


def _vehicle(messages: BootMessages) -> tuple[str, str]:
    """Return vehicle and firmware from the first MSG that names them, else from VER."""
    greetings, versions = messages.topic("MSG"), messages.topic("VER")
    for text in greetings.texts("Message") if greetings is not None else ():
        if found := _FIRMWARE.search(text):
            return found.group(1), found.group(0)
    for text in versions.texts("FWS") if versions is not None else ():
        return text.split(" ")[0], text
    return "", ""
