"""Plausibility of the rows of a log's table: finite, possible, in the order of time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uavgram.geometry.motion.interpolation import compute_running_median
from uavgram.model.arrays import Bools, Floats, Ints

LONGEST_BOOT_S = 30 * 86400.0
_BESIDE = 7  # rows of a neighbourhood, centred on a row
_DENSE_ROWS, _LONE_ROWS, _LONE_GAP_S = 20, 3, 1800.0
# faster than aircraft that take photos of the ground, including gusts and estimator steps
_FASTEST_M_S, _FASTEST_CLIMB_M_S, _STEP_M = 200.0, 50.0, 30.0
_METERS_PER_DEG = 111e3
_NO_DEG = 0.5e-7  # smaller is zero in the last digit stored by autopilots
# Logs count microseconds; the resolution of UTC as a double is a quarter of one.
_SAME_INSTANT_S = 0.5e-6
RESTART_S = 1.0  # a clock that steps back by more was restarted (or the byte is damaged)


def is_spike(time_s: Floats) -> Bools:
    """Return a (N,) mask of times off their neighbours: damaged bytes, without a checksum.

    In an increasing sequence every value equals the median of its neighbourhood, independent of
    gaps; only values out of order differ. Values that are not finite are spikes too.
    """
    finite = np.isfinite(time_s)
    spike = ~finite
    time = time_s[finite]
    if len(time) >= 3 and (time[1:] < time[:-1]).any():
        spike[finite] = np.abs(time - compute_running_median(time, _BESIDE)) > RESTART_S
    return spike


def find_plausible_rows(time_s: Floats, believable: Bools, *, dense: bool = False) -> Ints:
    """Return the rows to keep: plausible, of a possible time, no spike; sorted, without repeats.

    Parameters
    ----------
    time_s
        (N,) seconds since boot.
    believable
        (N,) whether the row's values are plausible.
    dense
        The table has many rows a second: single ones half an hour from all others are damaged.

    Returns
    -------
    (K,) indices, strictly increasing in `time_s`.
    """
    time = np.asarray(time_s, dtype=np.float64)
    possible = np.isfinite(time) & (time >= 0) & (time < LONGEST_BOOT_S)
    rows = np.flatnonzero(possible & believable)
    rows = rows[~is_spike(time[rows])]
    rows = rows[np.argsort(time[rows], kind="stable")]
    if dense:
        rows = _without_lone_ends(time, rows)
    first_of_instant = np.diff(time[rows], prepend=-np.inf) > _SAME_INSTANT_S
    return rows[first_of_instant].astype(np.int64)


def describe_left_out(
    source: str, time_s: Floats, rows: Ints, stated: Bools | None = None
) -> tuple[str, ...]:
    """Return remarks on unused rows with a time of their own, and on rows out of order.

    Firmware writes some rows twice, such as the gimbal's at an exposure.

    Parameters
    ----------
    source
        The message's name.
    time_s
        (N,) since boot, in the order of the file.
    rows
        (K,) the used rows.
    stated
        (N,) rows with values, the used ones among them; None for all.
    """
    stated = np.ones(len(time_s), dtype=bool) if stated is None else stated
    used = np.isin(time_s, time_s[rows])
    unused = stated & ~used
    notes = _out_of_order(source, time_s[stated & used])
    if unused.any():
        dropped = f"{int(unused.sum())} of {int(stated.sum())} {source} rows"
        notes = (f"{dropped} make no sense and were dropped", *notes)
    return notes


def _out_of_order(source: str, time_s: Floats) -> tuple[str, ...]:
    """Return a remark if times (N,) of used rows, in the order of the file, decrease."""
    back = np.flatnonzero(np.diff(time_s) < 0)
    if not len(back):
        return ()
    return (
        f"{len(back)} {source} rows are out of the order of time (the first at "
        f"{time_s[back[0] + 1]:.2f} s since boot): damaged, or exchanged on the way",
    )


def _without_lone_ends(time_s: Floats, rows: Ints) -> Ints:
    """Remove single rows of a dense table far before its first or after its last.

    `is_spike` cannot find a damaged time at an end, which is in order.
    """
    if len(rows) < _DENSE_ROWS:
        return rows
    apart = np.diff(time_s[rows])
    far = np.flatnonzero(apart > _LONE_GAP_S)
    first = int(far[far < _LONE_ROWS].max(initial=-1)) + 1
    last = int(far[far >= len(apart) - _LONE_ROWS].min(initial=len(rows) - 1)) + 1
    return rows[first:last]


def find_restarts(time_s: Floats) -> Ints:
    """Return the (K,) rows at which the boot clock has restarted, ignoring spikes."""
    rows = np.flatnonzero(~is_spike(time_s))
    falls = np.flatnonzero(np.diff(time_s[rows]) < -RESTART_S)
    return rows[falls + 1].astype(np.int64)


def is_place(latitude_deg: NDArray[np.floating], longitude_deg: NDArray[np.floating]) -> Bools:
    """Return (N,) whether latitude and longitude are on earth; 0, 0 means that there is no fix."""
    finite = np.isfinite(latitude_deg) & np.isfinite(longitude_deg)
    some = (np.abs(latitude_deg) > _NO_DEG) | (np.abs(longitude_deg) > _NO_DEG)
    return np.asarray(finite & some & (np.abs(latitude_deg) <= 90) & (np.abs(longitude_deg) <= 180))


def is_height(height_m: NDArray[np.floating]) -> Bools:
    """Return (N,) whether a height is possible for an aircraft."""
    return np.asarray(np.isfinite(height_m) & (np.abs(height_m) < 20000))


def is_near_track(
    time_s: Floats,
    latitude_deg: NDArray[np.floating],
    longitude_deg: NDArray[np.floating],
    height_m: NDArray[np.floating],
) -> Bools:
    """Return a (N,) mask of valid positions that agree with their neighbours in time.

    The limit is the distance from the median of seven neighbours that the fastest aircraft flies
    meanwhile; other rows have damaged bytes. A lasting step (a fix found, an origin set) is no
    damage.

    Parameters
    ----------
    time_s
        (N,) since boot.
    latitude_deg, longitude_deg
        (N,) WGS 84.
    height_m
        (N,) above any one datum.
    """
    fits = is_place(latitude_deg, longitude_deg) & is_height(height_m) & np.isfinite(time_s)
    rows = np.flatnonzero(fits)
    rows = rows[~is_spike(time_s[rows])]
    if len(rows) < 2:
        return fits
    time, middle = time_s[rows], float(np.median(latitude_deg[rows]))
    longitude = longitude_deg[rows]
    # also across the date line
    east = (longitude - longitude[len(rows) // 2] + 180) % 360 - 180
    reach = np.abs(time - _shifted(time, 3)) + np.abs(time - _shifted(time, -3))
    reach = np.minimum(reach, 10.0)
    allowed = _STEP_M + _FASTEST_M_S * reach
    off_n = _off_its_median(latitude_deg[rows]) * _METERS_PER_DEG
    off_e = _off_its_median(east) * _METERS_PER_DEG * np.cos(np.radians(middle))
    off_u = _off_its_median(height_m[rows])
    if len(rows) == 2:  # the median cannot decide between two rows: both are rejected
        off_n = np.full(2, np.abs(np.diff(latitude_deg[rows])) * _METERS_PER_DEG)
        off_e = np.full(2, np.abs(np.diff(east)) * _METERS_PER_DEG * np.cos(np.radians(middle)))
        off_u = np.full(2, np.abs(np.diff(height_m[rows])))
    near = (off_n < allowed) & (off_e < allowed)
    near &= off_u < _STEP_M + _FASTEST_CLIMB_M_S * reach
    fits[rows[~near]] = False
    return fits


def _shifted(values: Floats, by: int) -> Floats:
    """Return the (N,) values `by` rows before each; the end's own value beyond it."""
    at = np.clip(np.arange(len(values)) - by, 0, len(values) - 1)
    return np.asarray(values[at])


def _off_its_median(values: NDArray[np.floating]) -> Floats:
    """Return (N,) distances from the median of seven neighbours, or of the seven end rows."""
    found = compute_running_median(values, _BESIDE)
    found[:3], found[-3:] = np.median(values[:7]), np.median(values[-7:])
    return np.asarray(np.abs(values - found))


def are_body_angles(rpy_deg: Floats) -> Bools:
    """Return (N,) whether rows of roll, pitch, yaw (N, 3) [deg] are a vehicle's attitude."""
    rounded_up = 0.1
    limits = np.array([180.0, 90.0, 360.0]) + rounded_up
    return np.asarray((np.abs(rpy_deg) <= limits).all(axis=1))


def are_angles(rpy_deg: Floats) -> Bools:
    """Return (N,) whether rows of roll, pitch, yaw (N, 3) [deg] are possible angles; NaN is not.

    Firmware writes 360.0 and rounds up, and a gimbal may report 270 for -90.
    """
    small = np.abs(rpy_deg) <= 361  # NaN compares False
    return np.asarray(small.all(axis=1))
