"""Columns of any log's messages -> samples of the rows that make sense, remarks on the others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any, Literal, TypeVar

import numpy as np

from uavgram.io.logs.quality.rows import (
    is_height,
    is_place,
    left_out,
    near_its_track,
    plausible_rows,
)
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.flight.log import (
    AttitudeSamples,
    CameraEvents,
    ClockSamples,
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

T = TypeVar("T")
Found = tuple[T | None, tuple[str, ...]]
"""What a log says of one thing, None where it says nothing; and what was odd about it."""


def first_found(*reads: Callable[[], Found[T]]) -> Found[T]:
    """What the first of several messages says that says anything; the remarks on all before."""
    notes: tuple[str, ...] = ()
    for read in reads:
        samples, remarks = read()
        notes = (*notes, *remarks)
        if samples is not None:
            return samples, notes
    return None, notes


Place = tuple[Floats, Floats, Floats]
"""Latitudes, longitudes [deg] and heights above sea level [m], each (N,)."""

Samples = TypeVar(
    "Samples", PositionSamples, AttitudeSamples, GimbalSamples, HomeSamples, CameraEvents
)


def median_undulation_m(ellipsoid_m: Floats, sea_level_m: Floats) -> float:
    """Geoid above ellipsoid of heights (N,) above both; NaN where none makes sense."""
    difference = ellipsoid_m - sea_level_m
    believable = difference[np.abs(difference) < _LARGEST_UNDULATION_M]
    return float(np.median(believable)) if len(believable) else float("nan")


def rows_of(samples: Samples, keep: Bools) -> Samples:
    """Some rows (N,) of a table."""
    if keep.all():
        return samples
    columns = {field.name: getattr(samples, field.name) for field in fields(samples)}
    kept: dict[str, Any] = {n: c[keep] for n, c in columns.items() if isinstance(c, np.ndarray)}
    return replace(samples, **kept)


def position_samples(
    source: str,
    time_s: Floats,
    place: Place,
    above_home_m: Floats | None = None,
    stated: Bools | None = None,
) -> Found[PositionSamples]:
    """Positions that are ones and fit their neighbours in time.

    Parameters
    ----------
    source
        The message's name.
    time_s
        (N,) since boot.
    place
        Where, by the message.
    above_home_m
        (N,) heights above home; None where the message has none.
    stated
        (N,) rows that state a position; None for all. The others are no loss.
    """
    if stated is not None:
        latitude, longitude, height = (np.where(stated, column, np.nan) for column in place)
        place = latitude, longitude, height
    rows = plausible_rows(time_s, near_its_track(time_s, *place), dense=True)
    notes = left_out(source, time_s, rows, stated)
    if not len(rows):
        return None, notes
    home = np.full(len(rows), np.nan) if above_home_m is None else above_home_m[rows]
    samples = PositionSamples(
        time_boot_s=time_s[rows],
        latitude_deg=place[0][rows],
        longitude_deg=place[1][rows],
        height_m=place[2][rows],
        height_home_m=np.where(is_height(home), home, np.nan),
        datum="msl",
        source=source,
    )
    return samples, notes


def velocity_samples(
    source: str, time_s: Floats, north_east_down: tuple[Floats, Floats, Floats]
) -> VelocitySamples | None:
    """Velocities that an aircraft can have.

    Parameters
    ----------
    source
        The message's name.
    time_s
        (N,) since boot.
    north_east_down
        (N,) each [m/s].
    """
    ned = np.stack(north_east_down, axis=1)
    rows = _below(_FASTEST_M_S, time_s, ned)
    if len(rows) < 2:
        return None
    return VelocitySamples(time_boot_s=time_s[rows], ned_m_s=ned[rows], source=source)


def turn_rate_samples(
    source: str, time_s: Floats, forward_right_down: tuple[Floats, Floats, Floats]
) -> TurnRateSamples | None:
    """Rates of turn that a gyroscope can measure.

    Parameters
    ----------
    source
        The message's name.
    time_s
        (N,) since boot.
    forward_right_down
        (N,) each, about these axes of the body [rad/s].
    """
    body = np.stack(forward_right_down, axis=1)
    rows = _below(_FASTEST_RAD_S, time_s, body)
    if len(rows) < 2 or not body.any():  # firmware that knows no rates sends zeros throughout
        return None
    return TurnRateSamples(time_boot_s=time_s[rows], body_rad_s=body[rows], source=source)


def _below(largest: float, time_s: Floats, rates: Floats) -> Ints:
    """Rows in order of time whose rates (N, 3) are possible."""
    return plausible_rows(time_s, np.asarray((np.abs(rates) < largest).all(axis=1)))


def unit_quaternions(xyzw: Floats) -> Floats:
    """(N, 4) quaternions, of length one; NaN where their length is not nearly one."""
    length = np.linalg.norm(xyzw, axis=1, keepdims=True)
    near = np.abs(length - 1) < 0.01
    return np.where(near, xyzw / np.where(near, length, 1.0), np.nan)


def attitude_samples(source: str, time_s: Floats, xyzw: Floats) -> Found[AttitudeSamples]:
    """Attitudes of the vehicle.

    Parameters
    ----------
    source
        The message's name.
    time_s
        (N,) since boot.
    xyzw
        (N, 4) unit quaternions, body to north-east-down; NaN where a row makes no sense.
    """
    rows = plausible_rows(time_s, np.asarray(np.isfinite(xyzw).all(axis=1)), dense=True)
    notes = left_out(source, time_s, rows)
    if not len(rows):
        return None, notes
    samples = AttitudeSamples(
        time_boot_s=time_s[rows], ned_from_body_xyzw=xyzw[rows], source=source
    )
    return samples, notes


def home_samples(
    source: str, time_s: Floats, place: Place, valid: Bools | None = None
) -> HomeSamples | None:
    """Places that are homes.

    Parameters
    ----------
    source
        The message's name.
    time_s
        (N,) since boot.
    place
        Where, by the message.
    valid
        (N,) which the message calls valid; None for all.
    """
    latitude, longitude, height = place
    sane = is_place(latitude, longitude) & is_height(height)
    rows = plausible_rows(time_s, sane if valid is None else np.asarray(sane & valid))
    if not len(rows):
        return None
    return HomeSamples(
        time_boot_s=time_s[rows],
        latitude_deg=latitude[rows],
        longitude_deg=longitude[rows],
        height_m=height[rows],
        datum="msl",
        source=source,
    )


def reception_samples(
    source: str, time_s: Floats, satellites: Floats, hdop: Floats
) -> ReceptionSamples | None:
    """Numbers of satellites and their geometry, where either is stated.

    Parameters
    ----------
    source
        The message's name.
    time_s
        (N,) since boot.
    satellites, hdop
        (N,) as stated.
    """
    satellites = np.where((satellites > 0) & (satellites < _MOST_SATELLITES), satellites, np.nan)
    hdop = np.where((hdop > 0) & (hdop < _LARGEST_HDOP), hdop, np.nan)
    rows = plausible_rows(time_s, np.isfinite(satellites) | np.isfinite(hdop))
    if not len(rows):
        return None
    return ReceptionSamples(
        time_boot_s=time_s[rows], satellites=satellites[rows], hdop=hdop[rows], source=source
    )


def clock_samples(
    source: Literal["gps", "system_time", "receive"], time_s: Floats, utc_s: Floats, sane: Bools
) -> tuple[ClockSamples, ...]:
    """One clock, or none where no row makes sense.

    Parameters
    ----------
    source
        Whose clock.
    time_s, utc_s
        (N,) since boot; since 1970.
    sane
        (N,) rows whose UTC makes sense.
    """
    rows = plausible_rows(time_s, sane)
    if not len(rows):
        return ()
    return (ClockSamples(time_boot_s=time_s[rows], utc_s=utc_s[rows], source=source),)
