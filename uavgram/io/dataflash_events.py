"""Exposures, home and GPS time in a DataFlash log."""

from __future__ import annotations

import numpy as np

from uavgram.geometry.gps_time import utc_from_gps
from uavgram.io.dataflash_pose import Tables, boot_time_s, numbers, receiver, rows_where
from uavgram.io.samples import in_order, is_height, is_place
from uavgram.model.arrays import Floats, Ints
from uavgram.model.telemetry import CameraEvents, ClockSamples, HomeSamples


def camera_events(tables: Tables) -> tuple[CameraEvents | None, tuple[str, ...]]:
    """CAM joined with TRIG by the image number.

    With a feedback pin TRIG is the command and CAM the exposure (some 0.1 s later), and a TRIG
    whose number has no CAM is a missed shot; without one there is CAM only, at the command.
    """
    cam_time, cam_number = _shots(tables, "CAM")
    trig_time, trig_number = _shots(tables, "TRIG")
    missed = ~np.isin(trig_number, cam_number) | (trig_number < 0)
    notes = []
    if tables.count("CAM") and "TimeUS" not in tables.columns("CAM", slice(0, 1)):
        notes.append("CAM rows carry no boot time (firmware before 3.3) and were not used")
    time = np.concatenate([cam_time, trig_time[missed]])
    number = np.concatenate([cam_number, trig_number[missed]])
    confirmed = np.concatenate([np.ones(len(cam_time)), np.zeros(int(missed.sum()))])
    order = np.argsort(time, kind="stable")  # spikes were taken out of each type by itself
    rows = order[np.diff(time[order], prepend=-np.inf) > 0]
    if not len(rows):
        return None, tuple(notes)
    if missed.any() and len(cam_time):
        numbers_text = ", ".join(str(n) for n in trig_number[missed][:20])
        notes.append(f"{int(missed.sum())} triggers without feedback (image {numbers_text})")
    doubled = len(cam_number) - len(np.unique(cam_number)) if (cam_number >= 0).all() else 0
    if doubled:
        notes.append(f"{doubled} CAM messages repeat an image number")
    present = [name for name, has in (("TRIG", trig_time), ("CAM", cam_time)) if len(has)]
    events = CameraEvents(
        time_boot_s=time[rows],
        image_number=number[rows],
        confirmed=confirmed[rows],
        source="+".join(present),
    )
    return events, tuple(notes)


def _shots(tables: Tables, name: str) -> tuple[Floats, Ints]:
    """Boot times and image numbers (-1: none) of CAM or TRIG, first camera only."""
    columns = tables.columns(name)
    if not columns:
        return np.zeros(0), np.zeros(0, dtype=np.int64)
    if "I" in columns:
        camera = numbers(columns, "I")
        columns = rows_where(columns, camera == camera.min())
    number = np.nan_to_num(numbers(columns, "Img", "Image"), nan=-1.0).astype(np.int64)
    time = boot_time_s(columns) if "TimeUS" in columns else np.full(len(number), np.nan)
    rows = in_order(time, np.ones(len(time), dtype=bool))
    return time[rows], number[rows]


def home(tables: Tables) -> HomeSamples | None:
    """ORGN rows of type 1."""
    columns = tables.columns("ORGN")
    if not columns:
        return None
    columns = rows_where(columns, numbers(columns, "Type") == 1)
    time = boot_time_s(columns)
    latitude, longitude = numbers(columns, "Lat"), numbers(columns, "Lng")
    height = numbers(columns, "Alt")
    rows = in_order(time, is_place(latitude, longitude) & is_height(height))
    if not len(rows):
        return None
    return HomeSamples(
        time_boot_s=time[rows],
        latitude_deg=latitude[rows],
        longitude_deg=longitude[rows],
        height_m=height[rows],
        datum="msl",
        source="ORGN",
    )


def gps_clock(tables: Tables) -> ClockSamples | None:
    """Pairs of boot time and GPS time as UTC, one for each 3-D fix.

    The boot time is that of the fix's arrival (GPA.SMS) where the log has it: TimeUS is when the
    row was written, up to 40 ms later.
    """
    columns = receiver(tables)
    if not columns:
        return None
    week = numbers(columns, "GWk", "Week")
    # before 3.3 GPS.TimeMS is the GPS time and T the boot time
    milliseconds = numbers(columns, "GMS") if "GMS" in columns else numbers(columns, "TimeMS")
    time = boot_time_s(columns)
    time = np.where(np.isnan(arrival := _arrival_s(tables, time)), time, arrival)
    sane = (week > 1000) & (week < 5000) & (milliseconds >= 0) & (milliseconds < 604800000)
    rows = in_order(time, sane)
    if not len(rows):
        return None
    return ClockSamples(
        time_boot_s=time[rows],
        utc_s=utc_from_gps(week[rows], milliseconds[rows]),
        source="gps",
    )


def _arrival_s(tables: Tables, logged_s: Floats) -> Floats:
    """(N,) GPA.SMS of the row logged at the same time, NaN where there is none."""
    columns = tables.columns("GPA")
    if "SMS" not in columns:
        return np.full(len(logged_s), np.nan)
    if "I" in columns:
        instance = numbers(columns, "I")
        columns = rows_where(columns, instance == instance.min())
    time, sample = boot_time_s(columns), numbers(columns, "SMS") * 1e-3
    rows = in_order(time, np.abs(time - sample) < 1.0)
    if not len(rows):
        return np.full(len(logged_s), np.nan)
    nearest = rows[np.clip(np.searchsorted(time[rows], logged_s), 0, len(rows) - 1)]
    return np.where(np.abs(time[nearest] - logged_s) < 1e-4, sample[nearest], np.nan)


def undulation_m(tables: Tables) -> float:
    """Geoid above ellipsoid: median of GPA.AEl - GPS.Alt; NaN where the log has it not."""
    gps, gpa = receiver(tables), tables.columns("GPA")
    if not gps or "AEl" not in gpa:
        return float("nan")
    height = numbers(gps, "Alt")
    gpa_time, ellipsoid = boot_time_s(gpa), numbers(gpa, "AEl")
    rows = in_order(gpa_time, is_height(ellipsoid))
    if not len(rows) or not len(height):
        return float("nan")
    difference = np.interp(boot_time_s(gps), gpa_time[rows], ellipsoid[rows]) - height
    believable = difference[np.abs(difference) < 150]  # no geoid lies further from the ellipsoid
    return float(np.median(believable)) if len(believable) else float("nan")
