"""Simulated camera triggering with truth: which photo belongs to which event."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Floats, Ints


class Case(NamedTuple):
    """Photos and events of one flight; `truth` is the photo's event, -1 where it was lost."""

    photo_s: Floats
    event_s: Floats
    resolution_s: float
    truth: Ints
    trigger: str
    offset_s: float  # camera clock minus events' clock at `middle_s`
    drift: float
    middle_s: float
    uneven: bool  # see `looks_like_itself`


def by_distance(rng: np.random.Generator, count: int) -> Floats:
    """Exposure times (count,): a distance flown between two, in legs with wind, gusts, turns."""
    distance, airspeed = rng.uniform(5, 40), rng.uniform(4, 18)
    wind, least = rng.uniform(0, 0.35) * airspeed, rng.uniform(0.4, 1.5)
    per_leg = int(rng.integers(6, 40))
    spacing, heading = [], rng.uniform(0, 2 * np.pi)
    gust = 0.0
    for k in range(count):
        place = k % per_leg
        if place == 0:
            heading += np.pi
            if k:
                spacing.append(rng.uniform(4, 20))  # the turn
                continue
        gust = 0.8 * gust + 0.6 * rng.normal(0, rng.uniform(0.02, 0.08))
        ends = min(place, per_leg - place)
        ramp = 1 - 0.5 * np.exp(-ends / 1.5)  # slower at both ends of a leg
        speed = (airspeed * ramp + wind * np.cos(heading)) * (1 + gust)
        spacing.append(max(distance / max(speed, 1.0), least))
    return np.cumsum(spacing)


def by_time(rng: np.random.Generator, count: int) -> Floats:
    """Exposure times (count,) at an even interval, as a 50 Hz loop keeps it."""
    interval = rng.choice([1.0, 1.5, 2.0, 2.5, 3.0, 4.0])
    times: Floats = np.arange(1, count + 1) * interval + rng.uniform(0, 0.02, count)
    return times


def looks_like_itself(exposure_s: Floats, tolerance_s: float) -> float:
    """Largest share of exposures that fall on other exposures when all are shifted alike.

    By brute force over every difference of two exposures, with nothing lost: 1 minus 1 / n for an
    even interval.
    """
    shift = np.sort((exposure_s[:, None] - exposure_s).ravel())
    shift = shift[shift > 2 * tolerance_s]
    window = np.searchsorted(shift, shift + 2 * tolerance_s, side="right") - np.arange(len(shift))
    return float(window.max() / len(exposure_s))


def make_case(seed: int | tuple[int, ...]) -> Case:
    """A random flight: 10 to 400 photos, up to 15 % lost on either side."""
    rng = np.random.default_rng(seed)
    trigger = "distance" if rng.random() < 0.8 else "time"
    count = int(np.exp(rng.uniform(np.log(12), np.log(400))))
    exposure = 1.7e9 + 300 + (by_distance if trigger == "distance" else by_time)(rng, count)
    resolution = 1.0 if rng.random() < 0.5 else 0.001
    shutter = rng.uniform(0.001, 0.012)
    lost_photos, lost_events = rng.uniform(0, 0.15, 2)
    has_photo, has_event = rng.random((2, count)) >= np.array([[lost_photos], [lost_events]])
    offset, drift = rng.uniform(-14, 14) * 3600, rng.uniform(-1e-4, 1e-4)
    middle = exposure.mean()
    reading = exposure + offset + drift * (exposure - middle)
    reading = np.floor(reading / resolution) * resolution
    event = exposure + rng.normal(0, shutter, count)
    number = np.cumsum(has_event) - 1
    return Case(
        photo_s=reading[has_photo],
        event_s=event[has_event],
        resolution_s=resolution,
        truth=np.where(has_event, number, -1)[has_photo],
        trigger=trigger,
        offset_s=offset - resolution / 2,
        drift=drift,
        middle_s=middle,
        uneven=looks_like_itself(exposure, resolution / 2 + 0.03) < 0.7,
    )
