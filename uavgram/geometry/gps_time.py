"""Conversion of GPS weeks to UTC, with leap seconds.

Times are UTC seconds since the Unix epoch as float64, with a resolution of 0.2 microseconds today.
"""

from __future__ import annotations

from datetime import UTC, date, datetime

import numpy as np
from numpy.typing import ArrayLike

from uavgram.model.arrays import Floats


def _utc_s(year: int, month: int, day: int) -> float:
    return datetime(year, month, day, tzinfo=UTC).timestamp()


#: Start of GPS time, 1980-01-06, when GPS and UTC agreed.
GPS_EPOCH_UTC_S = _utc_s(1980, 1, 6)

#: Limits of plausible times; outside them the clock was not set. MAVLink did not exist before 2009;
#: an unset clock shows 1970 or 1980, and a receiver after a week rollover is 20 years early.
MIN_PLAUSIBLE_UTC_S = _utc_s(2009, 1, 1)
MAX_PLAUSIBLE_UTC_S = _utc_s(2080, 1, 1)

SECONDS_PER_WEEK = 604800.0
DAY_S = 86400.0
"""Length of a day [s]: clocks that differ by more than any time zone are of different days."""

# IERS Bulletin C: days at whose start GPS gained one more second on UTC. None had been announced
# after that of 2017 when this was written (program version 0.1).
_LEAP_DAYS = tuple(
    date.fromisoformat(day)
    for day in (
        *("1981-07-01", "1982-07-01", "1983-07-01", "1985-07-01", "1988-01-01", "1990-01-01"),
        *("1991-01-01", "1992-07-01", "1993-07-01", "1994-07-01", "1996-01-01", "1997-07-01"),
        *("1999-01-01", "2006-01-01", "2009-01-01", "2012-07-01", "2015-07-01", "2017-01-01"),
    )
)
_LEAP_UTC_S = np.array([_utc_s(day.year, day.month, day.day) for day in _LEAP_DAYS])
# The same moments counted without leap seconds, as GPS does.
_LEAP_GPS_S = _LEAP_UTC_S + np.arange(1, len(_LEAP_UTC_S) + 1)


def utc_from_gps(week: ArrayLike, milliseconds: ArrayLike) -> Floats:
    """Convert GPS weeks and milliseconds of the week to UTC.

    Parameters
    ----------
    week
        (...) full week number since 1980-01-06 (not modulo 1024).
    milliseconds
        (...) since the start of the week.

    Returns
    -------
    (...)
        UTC seconds since the Unix epoch, with the leap seconds in force at that instant. A leap
        second itself (23:59:60) gets the number of the second after it.
    """
    gps_s = (
        GPS_EPOCH_UTC_S
        + np.asarray(week, np.float64) * SECONDS_PER_WEEK
        + np.asarray(milliseconds, np.float64) * 1e-3
    )
    leaps = np.searchsorted(_LEAP_GPS_S, gps_s, side="right")
    return np.asarray(gps_s - leaps, np.float64)


def utc_text(time_utc_s: float) -> str:
    """Format an instant for readers, such as ``2018-08-05 01:00:50 UTC``."""
    if not 0 <= time_utc_s < 1e11:
        return f"{time_utc_s:.0f} s since 1970"
    return datetime.fromtimestamp(time_utc_s, tz=UTC).strftime("%Y-%m-%d %H:%M:%S UTC")


def span_text(span_s: float) -> str:
    """Format a span of time for readers: in seconds, from one day on in days."""
    return f"{span_s:.1f} s" if span_s < DAY_S else f"{span_s / DAY_S:.0f} days"
