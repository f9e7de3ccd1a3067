"""Draw: the axes of each measured profile."""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.maps.profile_sheet import ProfileSheet
from uavgram.model.result.profiles import ProfileResults

TWO_SIDED_95 = 1.959963984540054
"""Sigmas to either side that hold 95 % of a normal distribution."""

_EXAGGERATIONS = (1, 2, 5, 10, 20, 50, 100)
_HEIGHT_SHARE = 0.3  # of the length is the height of a drawing, at most
_LEAST_SHARE = 0.06  # and so much it is at least
_STATION_TICKS, _HEIGHT_TICKS = 8, 5


def profile_sheets(profiles: ProfileResults, unit_m: float = 1.0) -> tuple[ProfileSheet, ...]:
    """All profiles, each with axes that show its points and the intervals of their heights.

    Parameters
    ----------
    profiles
        As measured.
    unit_m
        Length in which the numbers at the axes are round.
    """
    return tuple(
        _sheet(
            name,
            [profiles.label[i] for i in rows],
            profiles.place_m[rows],
            profiles.sigma_m[rows],
            unit_m,
        )
        for name, rows in profiles.each()
    )


def _sheet(
    name: str, label: list[str], place_m: Floats, sigma_m: Floats, unit_m: float
) -> ProfileSheet:
    station, _, height, ground = place_m.T
    station_sigma, _, height_sigma, ground_sigma = sigma_m.T
    bounds = np.concatenate(
        [height + side * TWO_SIDED_95 * height_sigma for side in (-1, 1)]
        + [ground + side * TWO_SIDED_95 * ground_sigma for side in (-1, 1)]
    )
    low, high = float(bounds.min()), float(bounds.max())
    length = float(np.ptp(station))
    wanted = [x for x in _EXAGGERATIONS if x * (high - low) <= _HEIGHT_SHARE * length]
    exaggeration = max(wanted, default=1)
    missing = _LEAST_SHARE * length / exaggeration - (high - low)
    if missing > 0:
        low, high = low - missing / 2, high + missing / 2
    return ProfileSheet(
        name=name,
        label=tuple(label),
        station_m=station,
        height_m=height,
        ground_m=ground,
        station_sigma_m=station_sigma,
        height_sigma_m=height_sigma,
        ground_sigma_m=ground_sigma,
        station_ticks_m=unit_m
        * ticks(float(station.min()) / unit_m, float(station.max()) / unit_m, _STATION_TICKS),
        height_ticks_m=unit_m * ticks(low / unit_m, high / unit_m, _HEIGHT_TICKS),
        exaggeration=exaggeration,
    )


def ticks(low: float, high: float, most: int) -> Floats:
    """Multiples of 1, 2 or 5 times a power of ten, from at or below `low` to at or above `high`.

    Parameters
    ----------
    low, high
        What they enclose; they differ.
    most
        Steps in between, at most; one or two more where the ends are no multiples.
    """
    least = (high - low) / most
    power = 10.0 ** np.floor(np.log10(least))
    step = power * min(f for f in (1, 2, 5, 10) if f * power >= least * (1 - 1e-9))
    first, last = np.floor(low / step + 1e-9), np.ceil(high / step - 1e-9)
    return np.arange(first, last + 0.5) * float(step)
