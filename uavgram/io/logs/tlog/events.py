"""Exposures in a MAVLink telemetry log.

Fields: https://mavlink.io/en/messages/common.html and ardupilotmega.html, message by message.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from uavgram.io.logs.quality.image_numbers import events_of, image_numbers
from uavgram.io.logs.quality.rows import plausible_rows
from uavgram.io.logs.quality.samples import Found, first_found
from uavgram.io.logs.tlog.stream import Stream
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.flight.log import CameraEvents

_EPOCH_USEC = 1e15  # a greater time is microseconds since 1970 (2001 on), a smaller one since boot
_WRAP_S = 2.0**32 * 1e-6
_LONGEST_DELAY_S = 60.0  # from the event to its message


def camera_events(stream: Stream) -> Found[CameraEvents]:
    """CAMERA_FEEDBACK (ArduPilot); else CAMERA_IMAGE_CAPTURED; else CAMERA_TRIGGER (PX4)."""
    return first_found(*(partial(read, stream) for read in (_feedback, _image_captured, _trigger)))


def _feedback(stream: Stream) -> Found[CameraEvents]:
    """CAMERA_FEEDBACK on the boot clock.

    Its time_usec changes its clock (ArduPilot, AP_Camera_Backend.cpp): UTC without a feedback pin,
    microseconds since boot in 32 bits with one.
    """
    return _stamped(stream, "CAMERA_FEEDBACK", "img_idx", fed_back=True)


def _trigger(stream: Stream) -> Found[CameraEvents]:
    """CAMERA_TRIGGER: commands only."""
    return _stamped(stream, "CAMERA_TRIGGER", "seq", fed_back=False)


def _stamped(stream: Stream, name: str, count: str, *, fed_back: bool) -> Found[CameraEvents]:
    """Events with time_usec, and their number in the field `count`."""
    columns, rows = stream.columns(name)
    if not columns:
        return None, ()
    time, is_utc, notes = _since_boot(stream, rows, columns["time_usec"], name)
    kept = plausible_rows(time, np.abs(time - stream.boot_s(rows)) < _LONGEST_DELAY_S)
    if not len(kept):
        return None, notes
    pinned = fed_back and (~is_utc[kept]).mean() > 0.5
    number = image_numbers(columns[count].astype(np.float64))[kept]
    confirmed = np.full(len(kept), float(fed_back))
    events, remarks = events_of(
        name, "feedback" if pinned else "command", (time[kept], number, confirmed)
    )
    return events, (*notes, *remarks)


def _image_captured(stream: Stream) -> Found[CameraEvents]:
    """CAMERA_IMAGE_CAPTURED; a ground station may ask for one again, with the same time."""
    columns, rows = stream.columns("CAMERA_IMAGE_CAPTURED")
    if not columns:
        return None, ()
    time = columns["time_boot_ms"] * 1e-3
    # may come long after its event, so out of order: asked for again, or kept without a link
    _, kept = np.unique(time, return_index=True)
    kept = kept[(time[kept] > 0) & (time[kept] <= stream.boot_s(rows[kept]) + _LONGEST_DELAY_S)]
    if not len(kept):
        return None, ()
    number = image_numbers(columns["image_index"].astype(np.float64))[kept]
    succeeded = (columns["capture_result"][kept] == 1).astype(np.float64)
    return events_of("CAMERA_IMAGE_CAPTURED", "command", (time[kept], number, succeeded))


def _since_boot(
    stream: Stream, rows: Ints, time_usec: np.ndarray, name: str
) -> tuple[Floats, Bools, tuple[str, ...]]:
    """(K,) boot times of stamps that are UTC or since boot, by magnitude; which are UTC.

    UTC is taken back to the boot clock by the vehicle's own SYSTEM_TIME, whose clock it is, right
    or wrong; a stamp since boot of 32 bits is unwrapped to its message's own time.
    """
    stated = time_usec.astype(np.float64)
    since_boot = stated * 1e-6
    since_boot += np.round((stream.boot_s(rows) - since_boot) / _WRAP_S) * _WRAP_S
    is_utc = stated > _EPOCH_USEC
    if not is_utc.any():
        return since_boot, is_utc, ()
    offset, known = _utc_minus_boot(stream, rows)
    since_boot = np.where(is_utc, stated * 1e-6 - offset if known else np.nan, since_boot)
    if known:
        return since_boot, is_utc, ()
    text = (
        f"{int(is_utc.sum())} {name} messages state UTC but the log has no SYSTEM_TIME to place "
        "them; they were not used"
    )
    return since_boot, is_utc, (text,)


def _utc_minus_boot(stream: Stream, rows: Ints) -> tuple[Floats, bool]:
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
