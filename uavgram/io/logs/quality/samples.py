"""Columns that any log's rows state -> samples of those that make sense, remarks on the others."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any, Literal, TypeVar, cast

import numpy as np

from uavgram.geometry.motion.rotation import matrix_from_ypr, xyzw_from_matrix
from uavgram.io.logs.quality.rows import (
    are_body_angles,
    is_height,
    is_place,
    left_out,
    near_its_track,
    plausible_rows,
)
from uavgram.io.logs.topics import Found, Stated
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.flight.log import (
    AttitudeSamples,
    CameraEvents,
    ClockSamples,
    EstimatorSigmas,
    GimbalSamples,
    HomeSamples,
    PositionSamples,
    ReceptionSamples,
)
from uavgram.model.flight.second_opinions import TurnRateSamples, VelocitySamples

_LARGEST_UNDULATION_M = 150  # no geoid lies further from the ellipsoid
_FASTEST_M_S = 200.0
_FASTEST_RAD_S = 40.0  # beyond what gyroscopes of autopilots measure
_MOST_SATELLITES, _LARGEST_HDOP = 200.0, 90.0  # logs write 255 and 99.99 or more for none
_LARGEST_SIGMA_M, _LARGEST_SIGMA_RAD = 1000.0, 1.0

RTK_FIXED = 6
"""Type of fix with solved ambiguities: GPS_FIX_TYPE_RTK_FIXED, in ArduPilot and PX4 alike."""

Samples = TypeVar(
    "Samples", PositionSamples, AttitudeSamples, GimbalSamples, HomeSamples, CameraEvents
)


def rows_of(samples: Samples, keep: Bools) -> Samples:
    """Some rows (N,) of a table."""
    if keep.all():
        return samples
    columns = {field.name: getattr(samples, field.name) for field in fields(samples)}
    kept: dict[str, Any] = {n: c[keep] for n, c in columns.items() if isinstance(c, np.ndarray)}
    return replace(samples, **kept)


def position_samples(stated: Stated) -> Found[PositionSamples]:
    """Positions that are ones and fit their neighbours in time; their heights above home, if any.

    Rows that state no position are no loss.
    """
    time_s, valid = stated.time_s, stated.valid
    place = [c if valid is None else np.where(valid, c, np.nan) for c in stated.columns[:3]]
    rows = plausible_rows(time_s, near_its_track(time_s, *place), dense=True)
    notes = left_out(stated.source, time_s, rows, valid)
    if not len(rows):
        return None, notes
    home = stated.columns[3][rows] if len(stated.columns) > 3 else np.full(len(rows), np.nan)
    samples = PositionSamples(
        time_boot_s=time_s[rows],
        latitude_deg=place[0][rows],
        longitude_deg=place[1][rows],
        height_m=place[2][rows],
        height_home_m=np.where(is_height(home), home, np.nan),
        datum="msl",
        source=stated.source,
    )
    return samples, notes


def velocity_samples(stated: Stated) -> Found[VelocitySamples]:
    """Velocities north, east, down that an aircraft can have."""
    ned = np.stack(stated.columns, axis=1)
    if stated.valid is not None:
        ned = np.where(stated.valid[:, None], ned, np.nan)
    rows = _below(_FASTEST_M_S, stated.time_s, ned)
    if len(rows) < 2:
        return None, ()
    time_s = stated.time_s[rows]
    return VelocitySamples(time_boot_s=time_s, ned_m_s=ned[rows], source=stated.source), ()


def turn_rate_samples(stated: Stated) -> Found[TurnRateSamples]:
    """Rates of turn about forward, right, down that a gyroscope can measure."""
    body = np.stack(stated.columns, axis=1)
    rows = _below(_FASTEST_RAD_S, stated.time_s, body)
    if len(rows) < 2 or not body.any():  # firmware that knows no rates sends zeros throughout
        return None, ()
    time_s = stated.time_s[rows]
    return TurnRateSamples(time_boot_s=time_s, body_rad_s=body[rows], source=stated.source), ()


def _below(largest: float, time_s: Floats, rates: Floats) -> Ints:
    """Rows in order of time whose rates (N, 3) are possible."""
    return plausible_rows(time_s, np.asarray((np.abs(rates) < largest).all(axis=1)))


def unit_quaternions(xyzw: Floats) -> Floats:
    """(N, 4) quaternions, of length one; NaN where their length is not nearly one."""
    length = np.linalg.norm(xyzw, axis=1, keepdims=True)
    near = np.abs(length - 1) < 0.01
    return np.where(near, xyzw / np.where(near, length, 1.0), np.nan)


def quaternions_of_angles(rpy_rad: Floats, sane: Bools) -> Floats:
    """(N, 4) quaternions of roll, pitch, yaw (N, 3); NaN where these are no angles."""
    roll, pitch, yaw = np.where(sane[:, None], rpy_rad, 0.0).T
    xyzw = xyzw_from_matrix(matrix_from_ypr(yaw, pitch, roll))
    return np.where(sane[:, None], xyzw, np.nan)


def attitude_samples(stated: Stated) -> Found[AttitudeSamples]:
    """Attitudes of the vehicle, of quaternions x, y, z, w or of roll, pitch, yaw [deg]."""
    columns = np.stack(stated.columns, axis=1)
    if len(stated.columns) == 4:
        xyzw = unit_quaternions(columns)
    else:
        sane = are_body_angles(columns)
        xyzw = quaternions_of_angles(np.radians(np.where(sane[:, None], columns, 0.0)), sane)
    rows = plausible_rows(stated.time_s, np.asarray(np.isfinite(xyzw).all(axis=1)), dense=True)
    notes = left_out(stated.source, stated.time_s, rows)
    if not len(rows):
        return None, notes
    samples = AttitudeSamples(
        time_boot_s=stated.time_s[rows], ned_from_body_xyzw=xyzw[rows], source=stated.source
    )
    return samples, notes


def home_samples(stated: Stated) -> Found[HomeSamples]:
    """Places that are homes."""
    latitude, longitude, height = stated.columns
    sane = is_place(latitude, longitude) & is_height(height)
    sane = sane if stated.valid is None else np.asarray(sane & stated.valid)
    rows = plausible_rows(stated.time_s, sane)
    if not len(rows):
        return None, ()
    samples = HomeSamples(
        time_boot_s=stated.time_s[rows],
        latitude_deg=latitude[rows],
        longitude_deg=longitude[rows],
        height_m=height[rows],
        datum="msl",
        source=stated.source,
    )
    return samples, ()


def reception_samples(stated: Stated) -> Found[ReceptionSamples]:
    """Numbers of satellites and their geometry, where either is stated."""
    satellites, hdop = stated.columns
    satellites = np.where((satellites > 0) & (satellites < _MOST_SATELLITES), satellites, np.nan)
    hdop = np.where((hdop > 0) & (hdop < _LARGEST_HDOP), hdop, np.nan)
    rows = plausible_rows(stated.time_s, np.isfinite(satellites) | np.isfinite(hdop))
    if not len(rows):
        return None, ()
    samples = ReceptionSamples(
        time_boot_s=stated.time_s[rows],
        satellites=satellites[rows],
        hdop=hdop[rows],
        source=stated.source,
    )
    return samples, ()


def clock_samples(stated: Stated) -> ClockSamples | None:
    """A clock, where any row states a UTC."""
    (utc_s,) = stated.columns
    rows = plausible_rows(stated.time_s, utc_s > 0)  # NaN compares False
    if not len(rows):
        return None
    source = cast("Literal['gps', 'system_time', 'receive']", stated.source)
    return ClockSamples(time_boot_s=stated.time_s[rows], utc_s=utc_s[rows], source=source)


def median_undulation_m(ellipsoid_m: Floats, sea_level_m: Floats) -> float:
    """Geoid above ellipsoid of heights (N,) above both; NaN where none makes sense."""
    difference = ellipsoid_m - sea_level_m
    believable = difference[np.abs(difference) < _LARGEST_UNDULATION_M]
    return float(np.median(believable)) if len(believable) else float("nan")


def merged_sigmas(
    positions: list[Stated], tilts: list[Stated], fix: Stated | None = None
) -> EstimatorSigmas | None:
    """Accuracies that messages state, at the times of the first that states any.

    Parameters
    ----------
    positions
        Horizontal and vertical standard deviations [m]; where two messages state the same, the
        larger holds.
    tilts
        Those of roll and pitch [rad].
    fix
        The receiver's type of fix, as MAVLink counts them.
    """
    base: Floats | None = None
    used: list[str] = []
    merged: dict[str, Floats] = {}
    parts = [
        (stated, key, column, _LARGEST_SIGMA_M)
        for stated in positions
        for key, column in zip(("horizontal", "vertical"), stated.columns, strict=True)
    ]
    parts += [(stated, "tilt", stated.columns[0], _LARGEST_SIGMA_RAD) for stated in tilts]
    for stated, key, values, limit in parts:
        rows = plausible_rows(stated.time_s, (values > 0) & (values < limit))
        if not len(rows):
            continue
        time_s = stated.time_s[rows]
        base = time_s if base is None else base
        here = np.interp(base, time_s, values[rows])
        merged[key] = np.fmax(merged[key], here) if key in merged else here
        used.append(stated.source)
    if base is None:
        return None
    silent = np.full(len(base), np.nan)
    return EstimatorSigmas(
        time_boot_s=base,
        horizontal_m=merged.get("horizontal", silent),
        vertical_m=merged.get("vertical", silent),
        tilt_rad=merged.get("tilt", silent),
        yaw_rad=silent,
        is_fixed=_is_fixed(base, fix),
        source="+".join(dict.fromkeys(used)),
    )


def _is_fixed(at_s: Floats, fix: Stated | None) -> Bools:
    """(N,) whether the receiver's solutions before and after are fixed RTK ones."""
    if fix is None or not len(fix.time_s):
        return np.zeros(len(at_s), dtype=np.bool_)
    fixed = (fix.columns[0] == RTK_FIXED).astype(float)
    return np.asarray(np.interp(at_s, fix.time_s, fixed) == 1.0)
