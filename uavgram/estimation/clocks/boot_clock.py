"""UTC from a boot clock: which of a log's clocks is right, and the line to it."""

from __future__ import annotations

import numpy as np

from uavgram.errors import UavgramError
from uavgram.estimation.clocks.clock_line import (
    BOOT_DRIFT_SIGMA,
    ClockLine,
    fit_line,
    fit_lower_envelope,
)
from uavgram.geometry.earth.gps_time import DAY_S, MAX_PLAUSIBLE_UTC_S, MIN_PLAUSIBLE_UTC_S
from uavgram.model.arrays import Floats
from uavgram.model.flight.log import Boot, BootClock, ClockSamples
from uavgram.model.message import Message

_WORST_DRIFT = 2e-3
_WORST_SCATTER_S = 0.5
_WORST_STATION_SCATTER_S = 2.0
_JUMP_S = 0.4
# A fix reaches the autopilot 60 to 220 ms after its epoch, by receiver (ArduPilot pull requests
# #5405 and #8763), and its arrival is what the log has: common to the flight, unknown.
RECEIVER_LAG_SIGMA_S = 0.1
# The least delayed message of a radio link is late as well.
LINK_DELAY_SIGMA_S = 0.1


def fit_boot_clock(boot: Boot) -> tuple[BootClock, tuple[Message, ...]]:
    """Find the line from one boot's clock to UTC, from all pairs that the log has.

    GPS time first (DataFlash); else the autopilot's SYSTEM_TIME where it keeps its own rate and
    lies within a day of the ground station's clock; else the latter's lower envelope.

    Raises
    ------
    UavgramError
        The log ties its boot clock to no other.
    """
    by_source = {samples.source: samples for samples in boot.clocks}
    gps, system, receive = (by_source.get(name) for name in ("gps", "system_time", "receive"))
    reason = ""
    if gps is not None:
        line = _line(gps)
        if _is_plausible(line, gps):
            return _clock(line, RECEIVER_LAG_SIGMA_S, "gps"), _jumps(line, gps)
        reason = f"its GPS time {_gps_objection(line, gps)}"
    station = None if receive is None else fit_lower_envelope(receive.time_boot_s, receive.utc_s)
    station_is_dated = (
        station is not None
        and receive is not None
        and station.scatter_s < _WORST_STATION_SCATTER_S
        and _is_dated(station, receive.time_boot_s)
    )
    if system is not None:
        line = _line(system)
        objection = _objection(line, system, station if station_is_dated else None)
        if not objection:
            remarks = (*_jumps(line, system), *_difference(line, station))
            return _clock(line, RECEIVER_LAG_SIGMA_S, "system_time"), remarks
        reason = f"its SYSTEM_TIME {objection}"
    if station is None or not station_is_dated:
        raise UavgramError(
            "the log ties its boot clock to no UTC"
            + f" ({reason or 'no GPS time, no SYSTEM_TIME'})"
            + ": photos cannot be matched to it; "
            + (
                "give their positions as a table (`poses`), or the ground station's .tlog"
                if gps is not None
                else "use a log that was recorded with a GPS fix"
            )
        )
    text = (
        "The log has no SYSTEM_TIME" if not reason else f"The log's {reason.removeprefix('its ')}"
    )
    remark = Message(
        "warning" if reason else "info",
        "clock-receive",
        f"{text}: the ground station's clock was used, where its delay is least.",
    )
    return _clock(station, LINK_DELAY_SIGMA_S, "receive"), (remark,)


def to_utc(clock: BootClock, time_boot_s: Floats) -> Floats:
    """UTC seconds since the Unix epoch of boot times."""
    return np.asarray(clock.offset_s + clock.rate * np.asarray(time_boot_s, dtype=np.float64))


def to_boot(clock: BootClock, time_utc_s: Floats | float) -> Floats:
    """Boot times of UTC seconds."""
    return np.asarray((np.asarray(time_utc_s, dtype=np.float64) - clock.offset_s) / clock.rate)


def _line(samples: ClockSamples) -> ClockLine:
    return fit_line(samples.time_boot_s, samples.utc_s, BOOT_DRIFT_SIGMA)


def _clock(line: ClockLine, systematic_s: float, source: str) -> BootClock:
    return BootClock(
        offset_s=line.at(0.0),
        rate=1.0 + line.drift,
        # what scatters need not be independent from reading to reading: no mean is better
        sigma_s=float(np.hypot(max(line.offset_sigma_s, line.scatter_s), systematic_s)),
        source=source,
        drift_sigma=line.drift_sigma,
        scatter_s=line.scatter_s,
    )


def _jumps(line: ClockLine, samples: ClockSamples) -> tuple[Message, ...]:
    """A warning where readings lie a good part of a second off the line: late leap seconds."""
    off_s = line.residual_s(samples.time_boot_s, samples.utc_s)
    jumped = np.abs(off_s) > _JUMP_S
    if not jumped.any():
        return ()
    text = (
        f"{int(jumped.sum())} of {len(off_s)} {samples.source} clock readings jump off the others, "
        f"by {float(np.median(off_s[jumped])):+.2f} s in the median: they were left out."
    )
    return (Message("warning", "clock-jumps", text),)


def _is_dated(line: ClockLine, time_boot_s: Floats) -> bool:
    """Whether the line tells times at which there were autopilots."""
    return MIN_PLAUSIBLE_UTC_S < line.at(float(np.median(time_boot_s))) < MAX_PLAUSIBLE_UTC_S


def _is_plausible(line: ClockLine, samples: ClockSamples) -> bool:
    steady = abs(line.drift) < _WORST_DRIFT and line.scatter_s < _WORST_SCATTER_S
    return steady and _is_dated(line, samples.time_boot_s)


def _gps_objection(line: ClockLine, gps: ClockSamples) -> str:
    """Why GPS time cannot be tied to the boot clock by a line."""
    if not _is_dated(line, gps.time_boot_s):
        return "is nonsense: it is of no year in which there were autopilots"
    half = len(gps.utc_s) // 2
    apart_s = gps.time_boot_s[half:] - gps.time_boot_s[: len(gps.utc_s) - half]
    utc_s = gps.utc_s[half:] - gps.utc_s[: len(gps.utc_s) - half]
    rates = apart_s[utc_s > 0] / utc_s[utc_s > 0]
    rate = float(np.median(rates)) if len(rates) else 1.0
    if abs(rate - 1) > _WORST_DRIFT:
        how = "slow" if rate < 1 else "fast"
        off = abs(rate - 1) * 100
        return f"is there, but the boot clock runs {off:.1f} % {how} against it"
    return f"scatters by {line.scatter_s:.1f} s about the boot clock"


def _objection(line: ClockLine, system: ClockSamples, station: ClockLine | None) -> str:
    """Why SYSTEM_TIME cannot be believed; empty where it can."""
    middle = float(np.median(system.time_boot_s))
    stated = line.at(middle)
    if not _is_dated(line, system.time_boot_s):
        return f"is nonsense ({stated / (365.2425 * DAY_S) + 1970:.0f} as the year)"
    if not _is_plausible(line, system):
        return "does not keep pace with its boot clock"
    if station is not None:
        apart = stated - station.at(middle)
        if abs(apart) > DAY_S:
            return f"lies {apart / DAY_S:.1f} days off the ground station's clock"
    return ""


def _difference(line: ClockLine, station: ClockLine | None) -> tuple[Message, ...]:
    """A remark where the ground station's clock tells another time."""
    apart = 0.0 if station is None else station.at(0.0) - line.at(0.0)
    if abs(apart) < 1.0:
        return ()
    text = f"The ground station's clock is {apart:+.1f} s off the autopilot's UTC, which was used."
    return (Message("info", "clock-station-off", text),)
