"""Which rows of a log's table can be believed: finite, plausible, in the order of time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from uavgram.model.arrays import Bools, Floats, Ints

LONGEST_BOOT_S = 30 * 86400.0
RESTART_S = 1.0  # a clock that steps back by more has been restarted (or the byte is damaged)


def is_spike(time_s: Floats) -> Bools:
    """(N,) whether a time lies off its neighbours: damaged bytes, as DataFlash has no checksum.

    In an increasing sequence every value equals the median of its neighbourhood, whatever the
    gaps; only values out of order differ.
    """
    if len(time_s) < 3:
        return np.zeros(len(time_s), dtype=bool)
    return np.asarray(np.abs(time_s - median_filter(time_s, size=7, mode="nearest")) > RESTART_S)


def in_order(time_s: Floats, believable: Bools) -> Ints:
    """Rows to keep: believable, of a possible time, no spike; sorted, each instant once.

    Parameters
    ----------
    time_s
        (N,) seconds since boot.
    believable
        (N,) whether the row's values make sense.

    Returns
    -------
    (K,) indices, strictly increasing in `time_s`.
    """
    time = np.asarray(time_s, dtype=np.float64)
    possible = np.isfinite(time) & (time >= 0) & (time < LONGEST_BOOT_S)
    rows = np.flatnonzero(possible & believable)
    rows = rows[~is_spike(time[rows])]
    rows = rows[np.argsort(time[rows], kind="stable")]
    first_of_instant = np.diff(time[rows], prepend=-np.inf) > 0
    return rows[first_of_instant].astype(np.int64)


def restarts(time_s: Floats) -> Ints:
    """(K,) rows at which the boot clock has started again; spikes do not count."""
    rows = np.flatnonzero(~is_spike(time_s))
    falls = np.flatnonzero(np.diff(time_s[rows]) < -RESTART_S)
    return rows[falls + 1].astype(np.int64)


def is_place(latitude_deg: NDArray[np.floating], longitude_deg: NDArray[np.floating]) -> Bools:
    """(N,) whether latitude and longitude are a place on earth; 0, 0 means that there is no fix."""
    finite = np.isfinite(latitude_deg) & np.isfinite(longitude_deg)
    some = (latitude_deg != 0) | (longitude_deg != 0)
    return np.asarray(finite & some & (np.abs(latitude_deg) <= 90) & (np.abs(longitude_deg) <= 180))


def is_height(height_m: NDArray[np.floating]) -> Bools:
    """(N,) whether a height is one that an aircraft can have."""
    return np.asarray(np.isfinite(height_m) & (np.abs(height_m) < 20000))


def near_its_track(
    latitude_deg: NDArray[np.floating], longitude_deg: NDArray[np.floating]
) -> Bools:
    """(N,) whether a position lies near the median one, or else has damaged bytes."""
    if len(latitude_deg) == 0:
        return np.zeros(0, dtype=bool)
    place = is_place(latitude_deg, longitude_deg)
    if not place.any():
        return place
    far_n = np.abs(latitude_deg - np.median(latitude_deg[place]))
    far_e = np.abs(
        (longitude_deg - np.median(longitude_deg[place]) + 180) % 360 - 180
    )  # across the date line as well
    return np.asarray(place & (far_n < 2) & (far_e < 5))


def are_angles(angles_deg: Floats) -> Bools:
    """(N,) whether all angles of a row (N, K) [deg] are ones; NaN and wild values are none."""
    small = np.abs(angles_deg) <= 361  # NaN compares False; firmware writes 360.0 and rounds up
    return np.asarray(small.all(axis=1))
