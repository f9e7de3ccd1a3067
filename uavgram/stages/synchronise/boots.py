"""Boots of a log that photos can be matched to: with positions and a clock."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.errors import UavgramError
from uavgram.estimation.clocks.clock_line import fit_boot_clock, to_utc
from uavgram.geometry.gps_time import DAY_S, utc_text
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.flight_log import Boot, BootClock, FlightLog
from uavgram.model.message import Message

# From the event to the exposure, common to all frames: small behind a feedback pin, unknown
# behind a command (86 to 147 ms were measured in ArduPilot's simulator).
_FEEDBACK_LAG_SIGMA_S = 0.02
_COMMAND_LAG_SIGMA_S = 0.1


@dataclass(frozen=True, eq=False)
class ClockedBoot:
    """Usable boot: with positions and a clock."""

    boot: Boot
    clock: BootClock
    messages: tuple[Message, ...]

    def event_rows(self) -> Ints:
        """Return rows (E,) of the camera events: those with feedback where the log has any."""
        events = self.boot.events
        if events is None:
            return np.zeros(0, dtype=np.int64)
        confirmed = events.confirmed > 0
        return np.flatnonzero(confirmed if confirmed.any() else ~confirmed)

    def event_utc_s(self) -> Floats:
        """Return the instants (E,) of these events."""
        events = self.boot.events
        if events is None:
            return np.zeros(0)
        return to_utc(self.clock, events.time_boot_s[self.event_rows()])

    def span_utc_s(self) -> tuple[float, float]:
        """Return the interval in which position and attitude are both known."""
        tables = [t for t in (self.boot.positions, self.boot.attitudes) if t is not None]
        ends = np.array([to_utc(self.clock, t.time_boot_s[[0, -1]]) for t in tables])
        return float(ends[:, 0].max()), float(ends[:, 1].min())

    def lag_sigma_s(self) -> float:
        """Return the sigma of the common lag of exposures after their events."""
        events = self.boot.events
        feedback = events is not None and events.instant == "feedback"
        return _FEEDBACK_LAG_SIGMA_S if feedback else _COMMAND_LAG_SIGMA_S


NO_POSITIONS = (
    "the log has no positions, so it cannot place photos: use another one, or leave `log` out to "
    "measure by known lengths alone"
)


def usable_boots(log: FlightLog) -> list[ClockedBoot]:
    """Return boots with positions and UTC."""
    found: list[ClockedBoot] = []
    refusal = ""
    for boot in log.boots:
        if boot.positions is None:
            continue
        try:
            clock, messages = fit_boot_clock(boot)
        except UavgramError as error:
            refusal = str(error)
            continue
        found.append(ClockedBoot(boot, clock, messages))
    if not found:
        raise UavgramError(refusal or NO_POSITIONS)
    return found


def has_events(log: FlightLog) -> bool:
    """Return whether the log has camera events."""
    return any(boot.events is not None and len(boot.events.time_boot_s) for boot in log.boots)


def is_inside(time_utc_s: Floats, clocked: ClockedBoot) -> Bools:
    """Mark instants (F,) at which position and attitude are both known."""
    first, last = clocked.span_utc_s()
    return np.asarray((time_utc_s >= first) & (time_utc_s <= last))  # NaN compares False


def photos_span(time_s: Floats) -> str:
    """Describe first and last of the photos' instants; NaN is left out."""
    return f"{utc_text(float(np.nanmin(time_s)))} to {utc_text(float(np.nanmax(time_s)))}"


def log_spans(usable: list[ClockedBoot]) -> str:
    """Describe the intervals in which each boot has position and attitude."""
    spans = (clocked.span_utc_s() for clocked in usable)
    return " and ".join(f"{utc_text(first)} to {utc_text(last)}" for first, last in spans)


def apart(time_utc_s: Floats, usable: list[ClockedBoot]) -> tuple[float, str]:
    """Compute the time between photos and log [s], and describe both intervals.

    Parameters
    ----------
    time_utc_s
        (F,) known instants of the photos; NaN where a file has none.
    usable
        Boots of the log.
    """
    if not np.isfinite(time_utc_s).any():
        return 0.0, ""
    middle_s, spans = float(np.nanmedian(time_utc_s)), [each.span_utc_s() for each in usable]
    apart_s = min((middle_s - begin for begin, _ in spans), key=abs)
    about = f"{apart_s:+.0f} s ({apart_s / 3600:+.2f} h)"
    about = about if abs(apart_s) < DAY_S else f"{apart_s / DAY_S:+.0f} days"
    return apart_s, (
        f"no photo is from this flight: the photos were taken {photos_span(time_utc_s)} (file "
        f"times less time.offset_s), the log runs from {log_spans(usable)}. Is it the log of "
        f"another flight, or is the camera's clock wrong by about {about}? Then set time.offset_s"
    )
