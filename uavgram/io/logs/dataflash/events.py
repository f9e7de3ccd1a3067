"""Exposures, home and GPS time in a DataFlash log."""

from __future__ import annotations

import numpy as np

from uavgram.geometry.earth.gps_time import utc_from_gps
from uavgram.io.logs.dataflash.formats import Columns
from uavgram.io.logs.dataflash.samples import boot_time_s, numbers, place_of, receiver, rows_where
from uavgram.io.logs.dataflash.tables import Tables
from uavgram.io.logs.quality.image_numbers import events_of, image_numbers
from uavgram.io.logs.quality.rows import is_height, plausible_rows
from uavgram.io.logs.quality.samples import Found, clock_samples, home_samples, median_undulation_m
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.flight.log import CameraEvents, ClockSamples, HomeSamples


def camera_events(tables: Tables, clocks: tuple[ClockSamples, ...]) -> Found[CameraEvents]:
    """CAM joined with TRIG by the image number.

    With a feedback pin TRIG is the command and CAM the exposure (some 0.1 s later), and a TRIG
    whose number has no CAM is a missed shot; without one there is CAM only, at the command
    (ArduPilot, libraries/AP_Camera/AP_Camera_Backend.cpp).

    Parameters
    ----------
    tables
        Of one boot.
    clocks
        Its GPS clock, if any, for firmware before 3.3, whose CAM has no boot time.
    """
    cam_time, cam_number, notes = _shots(tables, "CAM", clocks)
    trig_time, trig_number, _ = _shots(tables, "TRIG", clocks)
    missed = ~np.isin(trig_number, cam_number) | (trig_number < 0)
    present = [name for name, has in (("TRIG", trig_time), ("CAM", cam_time)) if len(has)]
    events, remarks = events_of(
        "+".join(present),
        "feedback" if present == ["TRIG", "CAM"] else "command",
        (cam_time, cam_number, np.ones(len(cam_time))),
        (trig_time[missed], trig_number[missed]),
    )
    return events, (*notes, *remarks)


def _shots(
    tables: Tables, name: str, clocks: tuple[ClockSamples, ...]
) -> tuple[Floats, Ints, tuple[str, ...]]:
    """Boot times and image numbers (-1: none) of CAM or TRIG, first camera only; remarks."""
    columns = tables.columns(name)
    if not columns:
        return np.zeros(0), np.zeros(0, dtype=np.int64), ()
    notes: tuple[str, ...] = ()
    camera = numbers(columns, "I")
    if "I" in columns and len(cameras := np.unique(camera[np.isfinite(camera)])) > 1:
        columns = rows_where(columns, camera == cameras[0])
        held = " and ".join(f"{c:.0f}" for c in cameras)
        notes = (f"{name} is of cameras {held}; number {cameras[0]:.0f} was used",)
    if any(field in columns for field in ("TimeUS", "TimeMS", "T")):
        time = boot_time_s(columns)
    else:
        time = _by_gps_time(columns, clocks)
        remark = "carries no boot time (firmware before 3.3): placed by GPS time, up to 0.2 s early"
        notes = (*notes, f"{name} {remark}")
    rows = plausible_rows(time, np.ones(len(time), dtype=bool))
    return time[rows], image_numbers(numbers(columns, "Img", "Image"))[rows], notes


def _by_gps_time(columns: Columns, clocks: tuple[ClockSamples, ...]) -> Floats:
    """(N,) boot times of rows that state the GPS time of the last fix; NaN where unknown."""
    if not clocks:
        return np.full(len(next(iter(columns.values()))), np.nan)
    clock = clocks[0]
    week, milliseconds = numbers(columns, "GPSWeek"), numbers(columns, "GPSTime")
    sane = _is_gps_time(week, milliseconds)
    utc = utc_from_gps(np.where(sane, week, 0.0), np.where(sane, milliseconds, 0.0))
    order = np.argsort(clock.utc_s, kind="stable")
    known, since_boot = clock.utc_s[order], clock.time_boot_s[order]
    inside = sane & (utc >= known[0] - 1) & (utc <= known[-1] + 1)
    return np.where(inside, np.interp(utc, known, since_boot), np.nan)


def _is_gps_time(week: Floats, milliseconds: Floats) -> Bools:
    return np.asarray(
        (week > 1000) & (week < 5000) & (milliseconds >= 0) & (milliseconds < 604800000)
    )


def home(tables: Tables) -> HomeSamples | None:
    """ORGN rows of type 1."""
    return _origins(tables, 1)


def estimator_origin(tables: Tables) -> HomeSamples | None:
    """ORGN rows of type 0: where the estimator counts its offsets from."""
    return _origins(tables, 0)


def _origins(tables: Tables, kind: int) -> HomeSamples | None:
    columns = tables.columns("ORGN")
    if not columns:
        return None
    columns = rows_where(columns, numbers(columns, "Type") == kind)
    return home_samples("ORGN", boot_time_s(columns), place_of(columns))


def gps_clock(tables: Tables) -> tuple[ClockSamples, ...]:
    """Pairs of boot time and GPS time as UTC, one for each 3-D fix.

    The boot time is that of the fix's arrival (GPA.SMS) where the log has it: TimeUS is when the
    row was written, up to 40 ms later.
    """
    columns, accuracies = receiver(tables)
    if not columns:
        return ()
    week = numbers(columns, "GWk", "Week")
    # before 3.3 GPS.TimeMS is the GPS time and T the boot time
    milliseconds = numbers(columns, "GMS") if "GMS" in columns else numbers(columns, "TimeMS")
    time = boot_time_s(columns)
    time = np.where(np.isnan(arrival := _arrival_s(accuracies, time)), time, arrival)
    sane = _is_gps_time(week, milliseconds)
    utc = utc_from_gps(np.where(sane, week, 0.0), np.where(sane, milliseconds, 0.0))
    return clock_samples("gps", time, utc, sane)


def _arrival_s(columns: Columns, logged_s: Floats) -> Floats:
    """(N,) GPA.SMS of the row logged at the same time, NaN where there is none."""
    if "SMS" not in columns:
        return np.full(len(logged_s), np.nan)
    time, sample = boot_time_s(columns), numbers(columns, "SMS") * 1e-3
    rows = plausible_rows(time, np.abs(time - sample) < 1.0)
    if not len(rows):
        return np.full(len(logged_s), np.nan)
    nearest = rows[np.clip(np.searchsorted(time[rows], logged_s), 0, len(rows) - 1)]
    return np.where(np.abs(time[nearest] - logged_s) < 1e-4, sample[nearest], np.nan)


def undulation_m(tables: Tables) -> float:
    """Geoid above ellipsoid: median of GPA.AEl - GPS.Alt; NaN where the log has it not."""
    gps, gpa = receiver(tables)
    if not gps or "AEl" not in gpa:
        return float("nan")
    height = numbers(gps, "Alt")
    gpa_time, ellipsoid = boot_time_s(gpa), numbers(gpa, "AEl")
    rows = plausible_rows(gpa_time, is_height(ellipsoid))
    if not len(rows) or not len(height):
        return float("nan")
    above_ellipsoid = np.interp(boot_time_s(gps), gpa_time[rows], ellipsoid[rows])
    return median_undulation_m(above_ellipsoid, height)
