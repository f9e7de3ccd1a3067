"""Comparison of a boot's messages with each other, and resets of its estimator.

Rows outside the flight have damaged bytes. If a log contains a quantity twice (a position, an
attitude, a home) and the two contradict each other, it is unknown which one is right: a remark
names it, and only a home is left out for it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from uavgram.geometry.motion.interpolation import interpolate_rotation
from uavgram.geometry.motion.rotation import matrix_from_xyzw
from uavgram.io.logs.quality.samples import remove_damaged_rows, select_rows
from uavgram.io.logs.topics import Messages
from uavgram.model.arrays import Bools, Floats
from uavgram.model.flight.log import (
    AttitudeSamples,
    Boot,
    EstimatorReset,
    HomeSamples,
    PositionSamples,
)

ANY_CODE = -1

# ArduPilot, libraries/AP_NavEKF3/*.cpp, AP_NavEKF/*.cpp, AP_AHRS.cpp and ArduCopter/events.cpp:
# parts of GCS_SEND_TEXT texts, in lower case.
_TEXTS = (
    ("lane switch", "change to another estimator"),
    ("primary changed", "change to another estimator"),
    ("yaw aligned", "reset of the heading"),
    ("yaw re-aligned", "reset of the heading"),
    ("yaw alignment complete", "reset of the heading"),
    ("yaw reset", "reset of the heading"),
    ("alt reset", "reset of the height"),
    ("gps glitch", "glitch of the GPS"),
    ("glitch cleared", "end of a glitch of the GPS"),
    ("is using gps", "change of the estimator's sensors"),
    ("stopped aiding", "change of the estimator's sensors"),
)


@dataclass(frozen=True, kw_only=True)
class StatedResets:
    """Messages of a format that report resets.

    Attributes
    ----------
    counters
        Message, field, and event when its number changes.
    codes
        Message, fields, and events by their numbers; the last number may be `ANY_CODE`.
    texts
        Message and field of texts to the ground station.
    """

    counters: tuple[tuple[str, str, str], ...] = ()
    codes: tuple[tuple[str, tuple[str, ...], Mapping[tuple[int, ...], str]], ...] = ()
    texts: tuple[tuple[str, str], ...] = ()


def find_stated_resets(messages: Messages, stated: StatedResets) -> tuple[EstimatorReset, ...]:
    """Return the resets of one boot, in the order of time, each once.

    Parameters
    ----------
    messages
        Of one boot.
    stated
        From the table of their format.
    """
    found = {
        *_counted(messages, stated),
        *_by_codes(messages, stated),
        *_in_messages(messages, stated),
    }
    return tuple(sorted(found, key=lambda reset: (reset.time_boot_s, reset.what)))


def _counted(messages: Messages, stated: StatedResets) -> Iterator[EstimatorReset]:
    for name, field, what in stated.counters:
        topic = messages.topic(name)
        if topic is not None:
            step = np.diff(topic.column(field))
            rows = np.flatnonzero(np.isfinite(step) & (step != 0)) + 1
            yield from (EstimatorReset(time, what) for time in topic.time_s[rows].tolist())


def _by_codes(messages: Messages, stated: StatedResets) -> Iterator[EstimatorReset]:
    for name, fields, known in stated.codes:
        topic = messages.topic(name)
        if topic is None:
            continue
        rows = zip(*(topic.column(field).tolist() for field in fields), strict=True)
        for time, code in zip(topic.time_s.tolist(), rows, strict=True):
            what = known.get(code) or known.get((*code[:-1], ANY_CODE))
            if what is not None and math.isfinite(time):
                yield EstimatorReset(time, what)


def _in_messages(messages: Messages, stated: StatedResets) -> Iterator[EstimatorReset]:
    for name, field in stated.texts:
        topic = messages.topic(name)
        if topic is not None and (lines := topic.texts(field)):
            yield from find_resets_in_texts(topic.time_s.tolist(), lines)


def find_resets_in_texts(time_s: Iterable[float], texts: Iterable[str]) -> Iterator[EstimatorReset]:
    """Find resets in messages to the ground station, (N,) times since boot and (N,) texts."""
    for time, text in zip(time_s, texts, strict=True):
        small = text.lower()
        what = next((words for part, words in _TEXTS if part in small), None)
        if what is not None and math.isfinite(time):
            yield EstimatorReset(float(time), what)


_MARGIN_S = 600.0  # a home or an event may precede the first position
_FARTHEST_M = 111e3  # largest distance of a home from the flight
_METERS_PER_DEG = 111e3
# In undamaged logs a receiver's positions lag by a quarter of a second and differ from the
# estimator's by 9 m at most; two messages of one attitude differ by 0.02 degrees, in steps of a
# cdeg.
_FAR_M, _LAG_S = 30.0, 1.0
_TURNED_DEG = 10.0
# Height of home is stated to the centimetre, as are positions above it; it settles by 3 m at first.
_HOME_OFF_M = 4.0
# Home moves when the vehicle is carried, at walking speed; the estimator sets its origin and home
# at the same place, unless the receiver still drifted in between or the vehicle was carried.
_HOME_AWAY_M, _CARRIED_M_S = 200.0, 2.0
_ORIGIN_OFF_M = 10.0


def remove_inconsistent(boot: Boot) -> tuple[Boot, tuple[str, ...]]:
    """Remove rows off their neighbours, and impossible events and homes; return remarks too."""
    boot, damaged = remove_damaged_rows(boot)
    dense = [t for t in (boot.positions, boot.attitudes) if t is not None]
    if not dense:
        return boot, damaged
    first = min(float(t.time_boot_s[0]) for t in dense) - _MARGIN_S
    last = max(float(t.time_boot_s[-1]) for t in dense) + _MARGIN_S
    events, home, notes = boot.events, boot.home, list(damaged)
    if events is not None:
        inside = (events.time_boot_s >= first) & (events.time_boot_s <= last)
        if not inside.all():
            notes.append(f"{int((~inside).sum())} {events.source} events are far outside the log")
            events = select_rows(events, inside) if inside.any() else None
    if home is not None and boot.positions is not None:
        doubted, remarks = _homes_in_doubt(home, boot.positions)
        home = select_rows(home, ~doubted) if not doubted.all() else None
        notes += remarks
    if home is not None:
        inside = (home.time_boot_s >= first) & (home.time_boot_s <= last)
        if boot.positions is not None:
            inside &= _away_m(home, boot.positions) < _FARTHEST_M
        if not inside.all():
            notes.append(f"{int((~inside).sum())} {home.source} homes are far outside the flight")
            home = select_rows(home, inside) if inside.any() else None
    return replace(boot, events=events, home=home), tuple(notes)


def find_disagreements(
    boot: Boot, other: AttitudeSamples | None, origin: HomeSamples | None
) -> tuple[str, ...]:
    """Return remarks on messages that contradict the used positions, attitudes and home.

    Parameters
    ----------
    boot
        Boot with the used positions and attitudes.
    other
        Attitudes of other messages of the log; None where it has none.
    origin
        Origin of the estimator's offsets; None where the log has none.
    """
    spare = replace(boot, positions=boot.receiver, attitudes=other, gimbal=None)
    spare, _ = remove_damaged_rows(spare)
    return (
        *_places(boot.positions, spare.positions),
        *_turns(boot.attitudes, spare.attitudes),
        *_off_origin(boot.home, origin),
    )


def _places(used: PositionSamples | None, other: PositionSamples | None) -> tuple[str, ...]:
    if used is None or other is None or used.source == other.source:
        return ()
    at = _during(other.time_boot_s, used.time_boot_s)
    time = other.time_boot_s[at]
    here, there = _flat_m(used, other, time), _flat_m(other, other, time)
    way = _flat_m(used, other, time + _LAG_S) - _flat_m(used, other, time - _LAG_S)
    apart = np.linalg.norm(here - there, axis=1)
    return _disagreement(
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
    return _disagreement(
        f"attitudes by {used.source} and by {other.source}",
        time,
        np.where(angle > _TURNED_DEG, angle, 0.0),
        "degrees",
    )


def _disagreement(what: str, time_s: Floats, apart: Floats, unit: str) -> tuple[str, ...]:
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
    """Return (K, 2) metres north and east of the other's first row, interpolated."""
    latitude, longitude = float(about.latitude_deg[0]), float(about.longitude_deg[0])
    east = (samples.longitude_deg - longitude + 180) % 360 - 180
    north_m = (samples.latitude_deg - latitude) * _METERS_PER_DEG
    east_m = east * _METERS_PER_DEG * np.cos(np.radians(latitude))
    axes = [np.interp(time_s, samples.time_boot_s, axis) for axis in (north_m, east_m)]
    return np.stack(axes, axis=1)


def _homes_in_doubt(home: HomeSamples, positions: PositionSamples) -> tuple[Bools, tuple[str, ...]]:
    """Return a (N,) mask of homes whose height the positions contradict; remarks on the homes.

    Positions include their height above the home in force.
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
        f"home by {home.source} at {home.time_boot_s[k]:.2f} s since boot is {-off_m[k]:+.1f} m "
        f"off the height that {positions.source} counts from: taken for damaged and left out"
        for k in np.flatnonzero(doubted)[:3]
    ]
    return doubted, (*notes, *_moved(home, ~doubted))


def _moved(home: HomeSamples, kept: Bools) -> tuple[str, ...]:
    """Return a remark if homes are further apart than a vehicle can be carried meanwhile."""
    if kept.sum() < 2:
        return ()
    time, latitude, longitude = (
        column[kept] for column in (home.time_boot_s, home.latitude_deg, home.longitude_deg)
    )
    step = _apart_m(latitude[1:], longitude[1:], latitude[:-1], longitude[:-1])
    allowed = np.minimum(_HOME_OFF_M + _CARRIED_M_S * np.diff(time), _HOME_AWAY_M)
    far = np.flatnonzero(step > allowed)
    if not len(far):
        return ()
    k = far[step[far].argmax()]
    return (
        f"home by {home.source} moves by {step[k]:.0f} m at {time[k + 1]:.2f} s since boot: was "
        "the vehicle carried there, or is the statement damaged?",
    )


def _off_origin(home: HomeSamples | None, origin: HomeSamples | None) -> tuple[str, ...]:
    """Return a remark if home is far from the origin that the estimator set at the same place."""
    if home is None or origin is None:
        return ()
    off_m = _away_m(home, origin)
    if off_m[k := int(off_m.argmax())] < _ORIGIN_OFF_M:
        return ()
    return (
        f"home by {home.source} at {home.time_boot_s[k]:.2f} s since boot is {off_m[k]:.0f} m "
        "off the estimator's origin: was the vehicle carried after it was switched on, or is one "
        "of the two damaged?",
    )


def _away_m(home: HomeSamples, others: HomeSamples | PositionSamples) -> Floats:
    """Return (N,) horizontal distances of homes from the median of other positions."""
    middle = float(np.median(others.latitude_deg)), float(np.median(others.longitude_deg))
    return _apart_m(home.latitude_deg, home.longitude_deg, *middle)


def _apart_m(
    latitude_deg: Floats,
    longitude_deg: Floats,
    other_latitude_deg: Floats | float,
    other_longitude_deg: Floats | float,
) -> Floats:
    """Return (N,) horizontal distances of nearby positions [deg]."""
    north = latitude_deg - other_latitude_deg
    east = (longitude_deg - other_longitude_deg + 180) % 360 - 180
    scale = np.cos(np.radians(latitude_deg))
    return np.asarray(np.hypot(north, east * scale) * _METERS_PER_DEG)
