"""Camera attitudes by the gimbal, and camera events, as samples from any log's rows."""

from __future__ import annotations

from typing import Literal

import numpy as np

from uavgram.geometry.motion.rotation import matrix_from_xyzw, ypr_from_matrix
from uavgram.io.logs.messages import Found, StatedValues
from uavgram.io.logs.samples import (
    are_angles,
    describe_left_out,
    find_plausible_rows,
    unit_quaternions,
)
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.flight_log import CameraEvents, GimbalSamples
from uavgram.model.naming import format_count

# GIMBAL_DEVICE_FLAGS, https://mavlink.io/en/messages/common.html
_YAW_LOCK, _YAW_IN_VEHICLE_FRAME, _YAW_IN_EARTH_FRAME = 16, 32, 64
_LARGEST_NUMBER = 1e6  # more exposures than in any flight: damaged bytes
_MANY = 20


def gimbal_samples(stated: StatedValues) -> Found[GimbalSamples]:
    """Return samples from quaternions (w first) and flags; or roll, pitch, relative yaw [deg]."""
    if len(stated.columns) == 5:
        return _from_device_status(stated)
    return gimbal_from_angles(stated.time_s, np.stack(stated.columns, axis=1), stated.source)


def _from_device_status(stated: StatedValues) -> Found[GimbalSamples]:
    """Return GIMBAL_DEVICE_ATTITUDE_STATUS: roll and pitch from the horizon, yaw by the flags.

    If rows differ in the frame of yaw, the more frequent one is kept.
    """
    wxyz = np.stack(stated.columns[:4], axis=1)
    flags = np.where(np.isfinite(stated.columns[4]), stated.columns[4], 0.0).astype(np.int64)
    xyzw = unit_quaternions(wxyz[:, [1, 2, 3, 0]])
    sane = np.asarray(np.isfinite(xyzw).all(axis=1))
    # Without a frame flag (older firmware) the lock flag determines the frame of the yaw.
    earth = (flags & _YAW_IN_EARTH_FRAME > 0) | (
        (flags & _YAW_IN_VEHICLE_FRAME == 0) & (flags & _YAW_LOCK > 0)
    )
    use_earth = bool(len(earth) and earth.mean() > 0.5)
    rows = find_plausible_rows(stated.time_s, sane & (earth == use_earth))
    states = np.asarray(np.isfinite(wxyz).all(axis=1))
    turned = np.where(sane[:, None], xyzw, [0.0, 0.0, 0.0, 1.0])
    rpy = np.stack(ypr_from_matrix(matrix_from_xyzw(turned))[::-1], axis=1)
    frame: Literal["earth", "vehicle"] = "earth" if use_earth else "vehicle"
    return _gimbal(stated.time_s, rpy, rows, states, stated.source, frame)


def gimbal_from_angles(
    time_s: Floats,
    rpy_deg: Floats,
    source: str,
    *,
    yaw_frame: Literal["earth", "vehicle"] = "vehicle",
    stated: Bools | None = None,
) -> Found[GimbalSamples]:
    """Return samples from angles: roll and pitch from the horizon, and yaw.

    Parameters
    ----------
    time_s
        (N,) since boot.
    rpy_deg
        (N, 3) roll, pitch, yaw.
    source
        The message's name.
    yaw_frame
        Whether yaw is from north or from the vehicle's nose.
    stated
        (N,) rows with values; None for those with a number among the three angles.
    """
    rows = find_plausible_rows(time_s, are_angles(rpy_deg))
    if stated is None:
        stated = np.asarray(np.isfinite(rpy_deg).any(axis=1))
    return _gimbal(time_s, np.radians(rpy_deg), rows, stated, source, yaw_frame)


def _gimbal(
    time_s: Floats,
    rpy_rad: Floats,
    rows: Ints,
    stated: Bools,
    source: str,
    yaw_frame: Literal["earth", "vehicle"],
) -> Found[GimbalSamples]:
    notes = describe_left_out(source, time_s, rows, stated)
    if not len(rows):
        return None, notes
    roll, pitch, yaw = rpy_rad[rows].T
    samples = GimbalSamples(
        time_boot_s=time_s[rows],
        roll_rad=roll,
        pitch_rad=pitch,
        yaw_rad=yaw,
        yaw_frame=yaw_frame,
        source=source,
    )
    return samples, notes


def event_samples(stated: StatedValues) -> Found[CameraEvents]:
    """Return exposures from image numbers and flags of confirmation (1)."""
    number, confirmed = stated.columns
    exposures = stated.time_s, image_numbers(number), (confirmed == 1).astype(np.float64)
    return build_events(stated.source, "command", exposures)


def image_numbers(stated: Floats) -> Ints:
    """Return (N,) image numbers as integers; -1 where missing or senseless."""
    sane = (stated >= 0) & (stated < _LARGEST_NUMBER)  # NaN compares False
    return np.where(sane, stated, -1.0).astype(np.int64)


def _repeated_numbers(number: Ints) -> tuple[int, ...]:
    """Return the numbers of (N,) that occur more than once; -1 is none."""
    seen, count = np.unique(number[number >= 0], return_counts=True)
    return tuple(seen[count > 1].tolist())


def _lost_numbers(number: Ints) -> tuple[int, ...]:
    """Return the numbers missing between the first and the last of (N,); -1 is none.

    If more are missing than present, the numbers are not a count of exposures, and none is
    reported.
    """
    seen = np.unique(number[number >= 0])
    if len(seen) < 2 or seen[-1] - seen[0] >= 2 * len(seen):
        return ()
    return tuple(np.setdiff1d(np.arange(seen[0], seen[-1]), seen).tolist())


def build_events(
    source: str,
    instant: Literal["feedback", "command"],
    exposures: tuple[Floats, Ints, Floats],
    missed: tuple[Floats, Ints] | None = None,
) -> Found[CameraEvents]:
    """Return exposures in the order of time, each instant once; remarks on their numbers.

    Parameters
    ----------
    source, instant
        As in `CameraEvents`.
    exposures
        Times since boot, image numbers (-1: none), and whether each is confirmed; each (N,).
    missed
        Times and numbers (M,) of commands without an exposure; None where unknown.
    """
    time, number, confirmed = exposures
    repeated = _repeated_numbers(number)
    if missed is not None:
        time, number = (np.concatenate(pair) for pair in zip(exposures[:2], missed, strict=True))
        confirmed = np.append(confirmed, np.zeros(len(missed[0])))
    # sort by time and drop repeated times
    order = np.argsort(time, kind="stable")
    rows = order[np.diff(time[order], prepend=-np.inf) > 0]
    if not len(rows):
        return None, ()
    events = CameraEvents(
        time_boot_s=time[rows],
        image_number=number[rows],
        confirmed=confirmed[rows],
        source=source,
        instant=instant,
        repeated=repeated,
        lost=_lost_numbers(number),
    )
    return events, _notes(events)


def _notes(events: CameraEvents) -> tuple[str, ...]:
    """Describe missed, repeated and lost shots in plain words."""
    untimed = events.confirmed == 0
    notes = []
    if untimed.any() and not untimed.all():
        missed = _join_numbers(events.image_number[untimed].tolist())
        several = format_count(int(untimed.sum()), "camera trigger")
        notes.append(
            f"{several} not confirmed by the camera: perhaps there is no photo (image {missed})"
        )
    if events.repeated:
        notes.append(
            f"{len(events.repeated)} image numbers occur more than once in {events.source}: "
            f"{_join_numbers(events.repeated)}"
        )
    if events.lost:
        notes.append(
            f"{len(events.lost)} image numbers are missing in {events.source}: "
            f"{_join_numbers(events.lost)}"
        )
    return tuple(notes)


def _join_numbers(numbers: list[int] | tuple[int, ...]) -> str:
    """Return numbers as text, the first twenty."""
    more = f", ... {len(numbers) - _MANY} more" if len(numbers) > _MANY else ""
    return ", ".join(str(n) for n in numbers[:_MANY]) + more
