"""Leap seconds against known dates, and the GPS epoch against pymavlink."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np
import pytest
from pymavlink.DFReader import DFReaderClock

from uavgram.geometry.gps_time import (
    GPS_EPOCH_UTC_S,
    MAX_PLAUSIBLE_UTC_S,
    MIN_PLAUSIBLE_UTC_S,
    span_text,
    utc_from_gps,
    utc_text,
)


def utc(year: int, month: int, day: int, hour: int = 0, minute: int = 0, second: int = 0) -> float:
    return datetime(year, month, day, hour, minute, second, tzinfo=UTC).timestamp()


def from_gps(gps_s: float) -> float:
    """UTC of GPS seconds since the Unix epoch."""
    week, second = divmod(gps_s - GPS_EPOCH_UTC_S, 604800.0)
    return float(utc_from_gps(week, 1e3 * second))


# (year, month) from whose first day on GPS minus UTC is one more: IERS, "UTC-TAI history" less 19 s
STEPS = [
    *[(1981, 7), (1982, 7), (1983, 7), (1985, 7), (1988, 1), (1990, 1), (1991, 1), (1992, 7)],
    *[(1993, 7), (1994, 7), (1996, 1), (1997, 7), (1999, 1), (2006, 1), (2009, 1), (2012, 7)],
    *[(2015, 7), (2017, 1)],
]


@pytest.mark.parametrize(("count", "month"), list(enumerate(STEPS, 1)))
def test_leap_seconds_step_on_the_days_of_the_bulletin(count: int, month: tuple[int, int]) -> None:
    midnight = utc(*month, 1)

    assert from_gps(midnight - 0.5 + count - 1) == midnight - 0.5
    assert from_gps(midnight + count) == midnight


@pytest.mark.parametrize(
    ("date", "expected"),
    [((1970, 1, 1), 0), ((1980, 1, 6), 0), ((2000, 1, 1), 13), ((2026, 1, 1), 18)],
)
def test_leap_seconds_of_known_dates(date: tuple[int, int, int], expected: int) -> None:
    assert from_gps(utc(*date) + expected) == utc(*date)


def test_the_gps_epoch_is_the_one_of_pymavlink() -> None:
    # GPS seconds 315964800 after the Unix epoch; pymavlink takes 18 s off all of them.
    assert utc_from_gps(0, 0) == 315964800.0 == GPS_EPOCH_UTC_S
    expected = DFReaderClock()._gpsTimeToTime(2300, 345_600_000)
    assert utc_from_gps(2300, 345_600_000) == expected


def test_a_known_instant() -> None:
    # Week 1930 began on Sunday 2017-01-01 at 00:00:00 GPS time = 2016-12-31 23:59:43 UTC.
    assert utc_from_gps(1930, 0) == utc(2016, 12, 31, 23, 59, 43)
    assert utc_from_gps(1930, 20_500) == utc(2017, 1, 1) + 2.5


def test_the_leap_second_itself_is_counted_as_the_next_second() -> None:
    at = utc_from_gps(1930, np.array([16_999, 17_000, 17_500, 17_999, 18_000, 18_500]))
    midnight = utc(2017, 1, 1)
    np.testing.assert_allclose(at - midnight, [-0.001, 0, 0.5, 0.999, 0, 0.5], atol=1e-6)


def test_utc_and_back_over_all_weeks() -> None:
    week = np.arange(0, 3000)
    at = utc_from_gps(week, 3_600_000.0)
    steps = [utc(*month, 1) for month in STEPS]
    gps = at + np.searchsorted(steps, at, side="right")
    np.testing.assert_array_equal(gps, GPS_EPOCH_UTC_S + week * 604800.0 + 3600)


def test_bounds_of_a_clock_that_was_set() -> None:
    assert utc(2009, 1, 1) == MIN_PLAUSIBLE_UTC_S
    assert utc(2080, 1, 1) == MAX_PLAUSIBLE_UTC_S
    rolled_over = utc_from_gps(2400 - 1024, 0)
    assert rolled_over < MIN_PLAUSIBLE_UTC_S


def test_instants_and_spans_are_written_for_people() -> None:
    assert utc_text(1533430850.0) == "2018-08-05 01:00:50 UTC"
    assert utc_text(-5.0) == "-5 s since 1970"
    assert span_text(36000.04) == "36000.0 s"
    assert span_text(261822435.844) == "3030 days"
