"""Flight log of any format, boot by boot, from the table of the format: quantity <- message.field.

A new format defines a `Table` and a class of `Messages`; `build_log` does the rest. Quantities that
no row can express are functions of the format's own messages, given in the table instead of the
row.

The messages of a boot are compared with each other. Rows at impossible times or places have damaged
bytes and are removed. If a log contains a quantity twice (position, attitude, home) and the two
contradict each other, nothing shows which one is right. A remark reports it; only a contradictory
home is left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from uavgram.geometry.motion.interpolation import interpolate_rotation
from uavgram.geometry.motion.rotation import matrix_from_xyzw
from uavgram.io.logs.camera_events import event_samples, gimbal_samples
from uavgram.io.logs.messages import Found, Messages, Row, StatedValues, T
from uavgram.io.logs.samples import (
    attitude_samples,
    clock_samples,
    home_samples,
    median_undulation_m,
    merge_sigmas,
    position_samples,
    reception_samples,
    remove_damaged_rows,
    select_rows,
    turn_rate_samples,
    velocity_samples,
)
from uavgram.model.arrays import Bools, Floats
from uavgram.model.flight_log import (
    AttitudeSamples,
    Boot,
    CameraEvents,
    EstimatorReset,
    FlightLog,
    GimbalSamples,
    HomeSamples,
    PositionSamples,
)
from uavgram.model.naming import format_digits

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
        *_find_counted_resets(messages, stated),
        *_find_coded_resets(messages, stated),
        *_in_messages(messages, stated),
    }
    return tuple(sorted(found, key=lambda reset: (reset.time_boot_s, reset.what)))


def _find_counted_resets(messages: Messages, stated: StatedResets) -> Iterator[EstimatorReset]:
    for name, counter, what in stated.counters:
        topic = messages.topic(name)
        if topic is not None:
            step = np.diff(topic.column(counter))
            rows = np.flatnonzero(np.isfinite(step) & (step != 0)) + 1
            yield from (EstimatorReset(time, what) for time in topic.time_s[rows].tolist())


def _find_coded_resets(messages: Messages, stated: StatedResets) -> Iterator[EstimatorReset]:
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
    for name, text_field in stated.texts:
        topic = messages.topic(name)
        if topic is not None and (lines := topic.texts(text_field)):
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
        f"{format_digits(apart[worst], 3)} {unit} at {time_s[worst]:.2f} s since boot: one of the "
        "two is damaged, or the autopilot was lost",
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
    return doubted, (*notes, *_report_moved_home(home, ~doubted))


def _report_moved_home(home: HomeSamples, kept: Bools) -> tuple[str, ...]:
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


@dataclass(frozen=True, kw_only=True, eq=False)
class Table:
    """Table of a format: rows for each quantity, the preferred one first.

    The first row that gives samples is used; for accuracies and clocks all rows are.

    Attributes
    ----------
    positions, receiver
        Latitude, longitude [deg], height above sea level [m], height above home [m] if stated; of
        the estimator, else of the receiver; and of the receiver alone.
    attitudes, other_attitudes
        x, y, z, w of quaternions from body to north-east-down; or roll, pitch, yaw [deg]. The
        others are compared with the used ones.
    gimbal
        w, x, y, z of quaternions and GIMBAL_DEVICE_FLAGS; or roll and pitch from the horizon and
        yaw from the vehicle's nose [deg].
    events
        Image number, and 1 where the exposure is confirmed.
    velocities
        North, east, down [m/s].
    turn_rates
        About the axes forward, right, down [rad/s].
    sigmas, tilts
        Standard deviations: horizontal and vertical [m]; of roll and pitch [rad].
    fix
        Type of the receiver's fix, in MAVLink's numbers.
    home, origin
        Latitude, longitude [deg], height above sea level [m]; of home, and of the origin of the
        estimator's offsets.
    reception
        Number of satellites, horizontal dilution of precision.
    clocks
        UTC, seconds since 1970; the source is ``gps``, ``system_time`` or ``receive``.
    undulation
        Heights above the ellipsoid and above sea level [m].
    resets
        Messages with which the autopilot reports resets of its estimator.
    """

    positions: tuple[Row, ...]
    attitudes: tuple[Row, ...]
    receiver: tuple[Row, ...] = ()
    other_attitudes: tuple[Row, ...] = ()
    gimbal: tuple[Row | Callable[[Any], Found[GimbalSamples]], ...] = ()
    events: tuple[Row | Callable[[Any], Found[CameraEvents]], ...] = ()
    velocities: tuple[Row, ...] = ()
    turn_rates: tuple[Row, ...] = ()
    sigmas: tuple[Row, ...] = ()
    tilts: tuple[Row, ...] = ()
    fix: tuple[Row, ...] = ()
    home: tuple[Row, ...] = ()
    origin: tuple[Row, ...] = ()
    reception: tuple[Row, ...] = ()
    clocks: tuple[Row, ...] = ()
    undulation: tuple[Row, ...] = ()
    resets: StatedResets = field(default_factory=StatedResets)


def build_log(log: FlightLog, boots: Sequence[Messages], table: Table) -> FlightLog:
    """Return a log completed by the contents of its messages.

    Parameters
    ----------
    log
        Header data of the file; its boots and its undulation are still unknown.
    boots
        The messages of each boot.
    table
        Of their format.
    """
    several = f"the boot clock starts again {len(boots) - 1} times: several boots"
    built = [build_boot(messages, table) for messages in boots]
    remarks = [note for _, notes in built for note in notes]
    notes = [*log.notes, *([several] if len(boots) > 1 else []), *remarks]
    undulations = (_undulation_m(messages, table) for messages in boots)
    return replace(
        log,
        boots=tuple(boot for boot, _ in built),
        undulation_m=next(filter(np.isfinite, undulations), float("nan")),
        notes=tuple(dict.fromkeys(notes)),
    )


def build_boot(messages: Messages, table: Table) -> tuple[Boot, tuple[str, ...]]:
    """Build a boot from its messages without impossible rows; return remarks on irregularities too.

    Parameters
    ----------
    messages
        Of one boot.
    table
        Of their format.
    """
    positions, of_positions = read_first(messages, table.positions, position_samples)
    attitudes, of_attitudes = read_first(messages, table.attitudes, attitude_samples)
    gimbal, of_gimbal = read_first(messages, table.gimbal, gimbal_samples)
    events, of_events = read_first(messages, table.events, event_samples)
    clocks = (clock_samples(stated) for stated in _read_stated_values(messages, table.clocks))
    boot = Boot(
        positions=positions,
        attitudes=attitudes,
        gimbal=gimbal,
        events=events,
        sigmas=merge_sigmas(
            _read_stated_values(messages, table.sigmas),
            _read_stated_values(messages, table.tilts),
            next(iter(_read_stated_values(messages, table.fix)), None),
        ),
        home=read_first(messages, table.home, home_samples)[0],
        clocks=tuple(clock for clock in clocks if clock is not None),
        velocities=read_first(messages, table.velocities, velocity_samples)[0],
        turn_rates=read_first(messages, table.turn_rates, turn_rate_samples)[0],
        receiver=read_first(messages, table.receiver, position_samples)[0],
        reception=read_first(messages, table.reception, reception_samples)[0],
        resets=find_stated_resets(messages, table.resets),
    )
    boot, of_rows = remove_inconsistent(boot)
    other, _ = read_first(messages, table.other_attitudes, attitude_samples)
    origin, _ = read_first(messages, table.origin, home_samples)
    doubts = find_disagreements(boot, other, origin)
    return boot, (*of_positions, *of_attitudes, *of_gimbal, *of_events, *of_rows, *doubts)


def read_first(
    messages: Messages,
    rows: Iterable[Row | Callable[[Any], Found[T]]],
    make: Callable[[StatedValues], Found[T]],
) -> Found[T]:
    """Return samples of the first row that gives any, and the remarks on all rows up to it.

    Parameters
    ----------
    messages
        Of one boot.
    rows
        The preferred one first; or functions that make samples of the messages themselves.
    make
        Converts the values of a row to samples.
    """
    notes: tuple[str, ...] = ()
    for row in rows:
        if not isinstance(row, Row):
            samples, remarks = row(messages)
            notes = (*notes, *remarks)
        elif (stated := row.read_values(messages)) is not None:
            samples, remarks = make(stated)
            notes = (*notes, *remarks)
            if samples is not None and row.remark:
                notes = (*notes, row.remark)
        else:
            continue
        if samples is not None:
            return samples, notes
    return None, notes


def _undulation_m(messages: Messages, table: Table) -> float:
    """Return geoid above ellipsoid from the receiver's two heights; NaN where they are missing."""
    for stated in _read_stated_values(messages, table.undulation):
        ellipsoid, sea_level = stated.columns
        rows = np.isfinite(ellipsoid) if stated.valid is None else stated.valid
        return median_undulation_m(ellipsoid[rows], sea_level[rows])
    return float("nan")


def _read_stated_values(messages: Messages, rows: Iterable[Row]) -> list[StatedValues]:
    found = (row.read_values(messages) for row in rows)
    return [stated for stated in found if stated is not None]
