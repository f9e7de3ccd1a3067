"""Flight log of any format, built from the format's table: quantity <- message.field, unit.

A new format defines a `Table` and a class of `Messages`; `build_log` does the rest. Quantities that
no row can express are functions of the format's own messages, given in the table instead of the
row.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from uavgram.io.logs.quality.boots import (
    StatedResets,
    find_disagreements,
    find_stated_resets,
    remove_inconsistent,
)
from uavgram.io.logs.quality.camera import event_samples, gimbal_samples
from uavgram.io.logs.quality.samples import (
    attitude_samples,
    clock_samples,
    home_samples,
    median_undulation_m,
    merge_sigmas,
    position_samples,
    reception_samples,
    turn_rate_samples,
    velocity_samples,
)
from uavgram.io.logs.topics import Found, Messages, Row, StatedValues, T
from uavgram.model.flight.log import Boot, CameraEvents, FlightLog, GimbalSamples


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
    clocks = (clock_samples(stated) for stated in _all_stated(messages, table.clocks))
    boot = Boot(
        positions=positions,
        attitudes=attitudes,
        gimbal=gimbal,
        events=events,
        sigmas=merge_sigmas(
            _all_stated(messages, table.sigmas),
            _all_stated(messages, table.tilts),
            next(iter(_all_stated(messages, table.fix)), None),
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
        elif (stated := row.stated(messages)) is not None:
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
    for stated in _all_stated(messages, table.undulation):
        ellipsoid, sea_level = stated.columns
        rows = np.isfinite(ellipsoid) if stated.valid is None else stated.valid
        return median_undulation_m(ellipsoid[rows], sea_level[rows])
    return float("nan")


def _all_stated(messages: Messages, rows: Iterable[Row]) -> list[StatedValues]:
    found = (row.stated(messages) for row in rows)
    return [stated for stated in found if stated is not None]
