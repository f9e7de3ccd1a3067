"""What a log says twice, held against each other: place, attitude and home, each from two messages.

Nothing is left out for it but a home, as nobody knows which of the two is right: it is told.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.geometry.motion.interpolation import interpolate_rotation
from uavgram.geometry.motion.rotation import matrix_from_xyzw
from uavgram.io.logs.quality.neighbours import without_damaged_rows
from uavgram.model.arrays import Bools, Floats
from uavgram.model.flight.log import AttitudeSamples, Boot, HomeSamples, PositionSamples

_METERS_PER_DEG = 111e3
# Undamaged logs: a receiver's positions lag by a quarter of a second and lie 9 m off the
# estimator's at most; two messages of one attitude differ by 0.02 degrees, in steps of a cdeg.
_FAR_M, _LAG_S = 30.0, 1.0
_TURNED_DEG = 10.0
# A home states its height to the centimetre, as do positions above it; it settles by 3 m at first.
_HOME_OFF_M = 4.0
_HOME_AWAY_M = 200.0


def disagreements(
    boot: Boot, receiver: PositionSamples | None, other: AttitudeSamples | None
) -> tuple[str, ...]:
    """Where the receiver's positions and another message's attitudes contradict those used.

    Parameters
    ----------
    boot
        Of which positions and attitudes are used.
    receiver, other
        The same from other messages of the log; None where it has none.
    """
    spare = replace(boot, positions=receiver, attitudes=other, gimbal=None)
    spare, _ = without_damaged_rows(spare)
    return (*_places(boot.positions, spare.positions), *_turns(boot.attitudes, spare.attitudes))


def _places(used: PositionSamples | None, other: PositionSamples | None) -> tuple[str, ...]:
    if used is None or other is None or used.source == other.source:
        return ()
    at = _during(other.time_boot_s, used.time_boot_s)
    time = other.time_boot_s[at]
    here, there = _flat_m(used, other, time), _flat_m(other, other, time)
    way = _flat_m(used, other, time + _LAG_S) - _flat_m(used, other, time - _LAG_S)
    apart = np.linalg.norm(here - there, axis=1)
    return _told(
        f"positions by {used.source} and by the receiver ({other.source})",
        time,
        np.where(apart > _FAR_M + np.linalg.norm(way, axis=1), apart, 0.0),
        "m",
    )


def _turns(used: AttitudeSamples | None, other: AttitudeSamples | None) -> tuple[str, ...]:
    if used is None or other is None or used.source == other.source:
        return ()
    if len(used.time_boot_s) < 2:
        return ()
    time = other.time_boot_s[at := _during(other.time_boot_s, used.time_boot_s)]
    here, _ = interpolate_rotation(used.time_boot_s, used.ned_from_body_xyzw, time)
    there = matrix_from_xyzw(other.ned_from_body_xyzw[at])
    cosine = (np.einsum("nij,nij->n", here, there) - 1) / 2
    angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return _told(
        f"attitudes by {used.source} and by {other.source}",
        time,
        np.where(angle > _TURNED_DEG, angle, 0.0),
        "degrees",
    )


def _told(what: str, time_s: Floats, apart: Floats, unit: str) -> tuple[str, ...]:
    rows = np.flatnonzero(apart)
    if not len(rows):
        return ()
    worst = rows[apart[rows].argmax()]
    return (
        f"{what} contradict each other at {len(rows)} of {len(time_s)} times, by "
        f"{apart[worst]:.3g} {unit} at {time_s[worst]:.2f} s since boot: one of the two is "
        "damaged, or the autopilot was lost",
    )


def _during(time_s: Floats, span_s: Floats) -> Bools:
    return np.asarray((time_s >= span_s[0]) & (time_s <= span_s[-1]))


def _flat_m(samples: PositionSamples, about: PositionSamples, time_s: Floats) -> Floats:
    """(K, 2) metres north and east of the other's first row, between the samples."""
    latitude, longitude = float(about.latitude_deg[0]), float(about.longitude_deg[0])
    east = (samples.longitude_deg - longitude + 180) % 360 - 180
    north_m = (samples.latitude_deg - latitude) * _METERS_PER_DEG
    east_m = east * _METERS_PER_DEG * np.cos(np.radians(latitude))
    axes = [np.interp(time_s, samples.time_boot_s, axis) for axis in (north_m, east_m)]
    return np.stack(axes, axis=1)


def homes_in_doubt(home: HomeSamples, positions: PositionSamples) -> tuple[Bools, tuple[str, ...]]:
    """(N,) homes whose height the positions contradict; what is odd about the homes.

    A position states its height above the home that is in force.
    """
    off_m = np.zeros(len(home.time_boot_s))
    implied = positions.height_m - positions.height_home_m
    edges = np.append(home.time_boot_s, np.inf)
    for k, stated in enumerate(home.height_m):
        during = (positions.time_boot_s >= edges[k]) & (positions.time_boot_s < edges[k + 1])
        if np.isfinite(found := implied[during]).any() and home.datum == positions.datum:
            off_m[k] = float(np.nanmedian(found)) - stated
    doubted = np.abs(off_m) > _HOME_OFF_M
    notes = [
        f"home by {home.source} at {home.time_boot_s[k]:.2f} s since boot lies {-off_m[k]:+.1f} m "
        f"off the height that {positions.source} counts from: taken for damaged and left out"
        for k in np.flatnonzero(doubted)[:3]
    ]
    return doubted, (*notes, *_moved(home, ~doubted))


def _moved(home: HomeSamples, kept: Bools) -> tuple[str, ...]:
    """A remark where homes lie far from each other."""
    if kept.sum() < 2:
        return ()
    latitude, longitude = home.latitude_deg[kept], home.longitude_deg[kept]
    north = (latitude[1:] - latitude[:-1]) * _METERS_PER_DEG
    east = (longitude[1:] - longitude[:-1] + 180) % 360 - 180
    step = np.hypot(north, east * _METERS_PER_DEG * np.cos(np.radians(latitude[1:])))
    if (k := int(step.argmax())) < 0 or step[k] < _HOME_AWAY_M:
        return ()
    at = home.time_boot_s[kept][k + 1]
    return (
        f"home by {home.source} moves by {step[k]:.0f} m at {at:.2f} s since boot: was the "
        "vehicle carried there, or is the statement damaged?",
    )
