"""A boot's tables held against each other: what lies outside the flight has damaged bytes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.io.logs.quality.agreement import homes_in_doubt
from uavgram.io.logs.quality.neighbours import without_damaged_rows
from uavgram.io.logs.quality.samples import Found, rows_of
from uavgram.model.arrays import Bools
from uavgram.model.flight.log import (
    AttitudeSamples,
    Boot,
    CameraEvents,
    ClockSamples,
    EstimatorSigmas,
    GimbalSamples,
    HomeSamples,
    PositionSamples,
)
from uavgram.model.flight.second_opinions import TurnRateSamples

_MARGIN_S = 600.0  # a home or an event may come before the first position
_FARTHEST_DEG = 1.0  # of a home from the flight


def checked_boot(
    positions: Found[PositionSamples],
    attitudes: Found[AttitudeSamples],
    gimbal: Found[GimbalSamples],
    events: Found[CameraEvents],
    *,
    sigmas: EstimatorSigmas | None,
    home: HomeSamples | None,
    clocks: tuple[ClockSamples, ...],
    turn_rates: TurnRateSamples | None,
) -> tuple[Boot, tuple[str, ...]]:
    """A boot of what its messages say, less what cannot be; and what was odd about them.

    Parameters
    ----------
    positions, attitudes, gimbal, events
        With the remarks of those who read them.
    sigmas, home, clocks, turn_rates
        As in `Boot`.
    """
    boot = Boot(
        positions=positions[0],
        attitudes=attitudes[0],
        gimbal=gimbal[0],
        events=events[0],
        sigmas=sigmas,
        home=home,
        clocks=clocks,
        turn_rates=turn_rates,
    )
    boot, remarks = _consistent(boot)
    return boot, (*positions[1], *attitudes[1], *gimbal[1], *events[1], *remarks)


def _consistent(boot: Boot) -> tuple[Boot, tuple[str, ...]]:
    """The boot without what cannot be: rows off their neighbours, impossible events and homes."""
    boot, damaged = without_damaged_rows(boot)
    dense = [t for t in (boot.positions, boot.attitudes) if t is not None]
    if not dense:
        return boot, damaged
    first = min(float(t.time_boot_s[0]) for t in dense) - _MARGIN_S
    last = max(float(t.time_boot_s[-1]) for t in dense) + _MARGIN_S
    events, home, notes = boot.events, boot.home, list(damaged)
    if events is not None:
        inside = (events.time_boot_s >= first) & (events.time_boot_s <= last)
        if not inside.all():
            notes.append(f"{int((~inside).sum())} {events.source} events lie far outside the log")
            events = rows_of(events, inside) if inside.any() else None
    if home is not None and boot.positions is not None:
        doubted, remarks = homes_in_doubt(home, boot.positions)
        home = rows_of(home, ~doubted) if not doubted.all() else None
        notes += remarks
    if home is not None:
        inside = (home.time_boot_s >= first) & (home.time_boot_s <= last) & _is_near(home, boot)
        if not inside.all():
            notes.append(f"{int((~inside).sum())} {home.source} homes lie far outside the flight")
            home = rows_of(home, inside) if inside.any() else None
    return replace(boot, events=events, home=home), tuple(notes)


def _is_near(home: HomeSamples, boot: Boot) -> Bools:
    positions = boot.positions
    if positions is None:
        return np.ones(len(home.time_boot_s), dtype=bool)
    off_n = np.abs(home.latitude_deg - np.median(positions.latitude_deg))
    off_e = (home.longitude_deg - np.median(positions.longitude_deg) + 180) % 360 - 180
    scale = np.cos(np.radians(home.latitude_deg))
    return np.asarray((off_n < _FARTHEST_DEG) & (np.abs(off_e) * scale < _FARTHEST_DEG))
