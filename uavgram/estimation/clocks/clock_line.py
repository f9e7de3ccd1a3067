"""Lines between two clocks, and UTC from the boot clock of an autopilot."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from uavgram.errors import UavgramError
from uavgram.geometry.gps_time import DAY_S, MAX_PLAUSIBLE_UTC_S, MIN_PLAUSIBLE_UTC_S
from uavgram.model.arrays import Floats
from uavgram.model.flight_log import Boot, BootClock, ClockSamples
from uavgram.model.message import Message

# Measured autopilots ran 18 to 146 ppm off; a short log must not give more than that.
BOOT_DRIFT_SIGMA = 2e-4
# Drift of a camera's clock against the autopilot's: quartz without temperature control stays within
# some 50 ppm.
CAMERA_DRIFT_SIGMA = 1e-4
COARSE_STEP_S = 0.1  # step above which it exceeds the scatter of shutters
MIN_JITTER_S = 0.001
COARSE_JITTER_S = 0.02  # scatter of shutters, assumed for coarse readings
_MAX_STEPS = 30
_MAX_DELAY_S = 600.0  # readings farther from the median are damaged
_TUKEY_CONSTANT = 4.685  # constant of the biweight, 95 % efficient for normal errors (Huber 1981)
_SIGNIFICANT_SIGMAS = 3.0  # sigmas of a drift that is reported
_FREE_DRIFT_SIGMA = 1e6  # sigma of a drift without prior


@dataclass(frozen=True)
class ClockLine:
    """Line ``other = time + offset_s + drift * (time - reference_s)``.

    Attributes
    ----------
    offset_s, drift
        Parameters of the line; the offset is that at the reference, drift is dimensionless (1e-6 is
        1 ppm).
    reference_s
        Instant on the first clock.
    offset_sigma_s, drift_sigma
        Standard deviations, uncorrelated by the choice of the reference.
    scatter_s
        Standard deviation of one pair about the line; for coarse clocks without the readings' step.
    """

    offset_s: float
    drift: float
    reference_s: float
    offset_sigma_s: float = float("inf")
    drift_sigma: float = CAMERA_DRIFT_SIGMA
    scatter_s: float = 0.0

    @property
    def drifts(self) -> bool:
        """Return whether the drift exceeds three of its sigmas."""
        return abs(self.drift) > _SIGNIFICANT_SIGMAS * self.drift_sigma

    def at(self, time_s: float) -> float:
        """Return the reading of the other clock at an instant of the first."""
        return time_s + self.offset_s + self.drift * (time_s - self.reference_s)

    def to_time(self, other_s: Floats) -> Floats:
        """Return (N,) instants of the first clock at readings of the other."""
        since = (other_s - self.offset_s - self.reference_s) / (1.0 + self.drift)
        return np.asarray(self.reference_s + since)

    def residual_s(self, time_s: Floats, other_s: Floats) -> Floats:
        """Return (N,) differences of readings of the other clock from the line."""
        # The large terms cancel first: beside 1e9 s a microsecond of the drift would be lost.
        since = self.drift * (time_s - self.reference_s)
        return np.asarray((other_s - time_s - self.offset_s) - since)

    def sigma_at(self, time_s: Floats) -> Floats:
        """Return (N,) standard deviations of the line at these instants [s]."""
        return np.asarray(
            np.hypot(self.offset_sigma_s, self.drift_sigma * (time_s - self.reference_s))
        )


def fit_line(
    time_s: Floats, other_s: Floats, drift_sigma: float, scatter_s: float | None = None
) -> ClockLine:
    """Fit a line; its drift has a prior of zero.

    By least squares if the scatter is known. Otherwise by iteratively reweighted least squares
    (Tukey's biweight), from the median slope of pairs half the data apart (after Theil and Sen), so
    that up to a quarter of wrong pairs do not affect it.

    Parameters
    ----------
    time_s, other_s
        (N,) readings of the two clocks at the same instants, N >= 1.
    drift_sigma
        Sigma of the prior of the drift.
    scatter_s
        Standard deviation of one pair.
    """
    reference = float(time_s.sum()) / len(time_s)
    t = time_s - reference
    apart = other_s - time_s
    base = float(apart[0])
    y = apart - base  # subtract a base: the clocks themselves are 1e9 s large
    if scatter_s is not None:
        level = float(y.sum()) / len(y)
        scatter, total, square = scatter_s, float(len(t)), float(t @ t)
        slope = float(t @ (y - level)) / (square + (scatter / drift_sigma) ** 2)
    else:
        slope = _start_slope(t, y, 10 * drift_sigma)
        level, scatter, weight = float(np.median(y - slope * t)), 0.0, np.ones(len(t))
        for _ in range(_MAX_STEPS):
            residual = y - level - slope * t
            # Digital readings: a scatter below a microsecond is not resolved.
            scatter = max(1.4826 * float(np.median(np.abs(residual))), 1e-6)
            weight = np.clip(1 - (residual / (_TUKEY_CONSTANT * scatter)) ** 2, 0, None) ** 2
            previous, moment = (level, slope), weight @ t
            # Weighted normal equations of level and slope, with the drift's prior.
            normal = [
                [weight.sum(), moment],
                [moment, weight @ t**2 + (scatter / drift_sigma) ** 2],
            ]
            level, slope = np.linalg.solve(normal, [weight @ y, weight @ (t * y)]).tolist()
            if abs(level - previous[0]) < 1e-9 and abs(slope - previous[1]) < 1e-12:
                break
        total, square = float(weight.sum()), float(weight @ t**2)
    return ClockLine(
        offset_s=base + level,
        drift=slope,
        reference_s=reference,
        offset_sigma_s=float(scatter / np.sqrt(max(total, 1.0))),
        drift_sigma=float(scatter / np.sqrt(square + (scatter / drift_sigma) ** 2)),
        scatter_s=scatter,
    )


def _start_slope(t: Floats, y: Floats, most: float) -> float:
    half = len(t) // 2
    if half < 2:
        return 0.0
    apart = t[half:] - t[: len(t) - half]
    slopes = (y[half:] - y[: len(y) - half])[apart > 0] / apart[apart > 0]
    return float(np.clip(np.median(slopes), -most, most)) if len(slopes) else 0.0


def fit_lower_envelope(time_s: Floats, other_s: Floats, bin_s: float = 5.0) -> ClockLine:
    """Fit the line below readings that are late by an unknown, varying, never negative delay.

    The least delayed reading of every `bin_s` seconds represents the clock; the line is fitted to
    those.

    Parameters
    ----------
    time_s, other_s
        (N,) readings of the two clocks at the same instants; `other_s` may be late.
    bin_s
        Length of time from which one reading is taken.
    """
    late = other_s - time_s
    # The lower median is one of the readings: the mean of two distant ones would be near neither.
    near = np.abs(late - np.quantile(late, 0.5, method="lower")) < _MAX_DELAY_S
    time_s, other_s, late = time_s[near], other_s[near], late[near]
    order = np.lexsort((late, np.floor((time_s - time_s[0]) / bin_s)))
    bins = np.floor((time_s[order] - time_s[0]) / bin_s)
    least = order[np.diff(bins, prepend=-np.inf) > 0]
    return fit_line(time_s[least], other_s[least], BOOT_DRIFT_SIGMA)


def fit_camera_clock(event_s: Floats, reading_s: Floats, resolution_s: float) -> ClockLine:
    """Fit the line to pairs of events and a camera's readings, with its standard deviations.

    A fine clock's pairs scatter normally: least squares. A coarse clock's error is uniform over its
    step: every pair bounds the line, the middle between the extremes is the best offset, and the
    remaining range is its uncertainty. Readings that all fall on the same part of a step (exposures
    at whole seconds) leave the whole step undetermined, however many they are.

    Parameters
    ----------
    event_s, reading_s
        (N,) times of the events on their own clock, and the camera's readings; N >= 1.
    resolution_s
        Step of the readings.
    """
    coarse, least = resolution_s > COARSE_STEP_S, max(resolution_s / np.sqrt(12.0), MIN_JITTER_S)
    free = fit_line(event_s, reading_s, _FREE_DRIFT_SIGMA, least)
    if len(event_s) < 2:
        sigma = float(np.hypot(resolution_s, COARSE_JITTER_S))
        return ClockLine(free.offset_s, 0.0, free.reference_s, sigma)
    residual = free.residual_s(event_s, reading_s)
    scatter = max(float(np.std(residual)), least)
    open_s = max(resolution_s - float(np.ptp(residual)), 0.0) if coarse else 0.0
    # The undetermined range is common to all readings: added as if each scattered by it.
    lever = float(np.sqrt(np.sum((event_s - free.reference_s) ** 2)))
    common = open_s * lever / max(float(np.ptp(event_s)), 1e-3)
    line = fit_line(event_s, reading_s, CAMERA_DRIFT_SIGMA, float(np.hypot(scatter, common)))
    residual = line.residual_s(event_s, reading_s)
    if not coarse:
        return replace(line, scatter_s=max(float(np.std(residual)), MIN_JITTER_S))
    middle, sigma = _fit_offset(residual, resolution_s)
    return replace(
        line,
        offset_s=line.offset_s + middle,
        offset_sigma_s=sigma,
        scatter_s=COARSE_JITTER_S,
    )


def _fit_offset(residual_s: Floats, resolution_s: float) -> tuple[float, float]:
    """Compute offset and sigma from readings with a uniform error.

    The midrange of n uniform errors of full width w has sigma w / sqrt(2 (n + 1) (n + 2)) (Johnson,
    Kotz and Balakrishnan 1995, Continuous univariate distributions 2, chapter 26). Readings that do
    not fill the step leave the offset undetermined over the rest of it; readings that exceed it by
    more than the scatter of shutters do not belong together, and the excess adds to the sigma.
    """
    # A pair with a wrong event is outside: use the largest set of readings that fits in one step.
    ordered = np.sort(residual_s)
    held = np.searchsorted(ordered, ordered + resolution_s + 2 * COARSE_JITTER_S, side="right")
    first = int(np.argmax(held - np.arange(len(ordered))))
    n = int(held[first]) - first
    low, high = float(ordered[first]), float(ordered[held[first] - 1])
    filled = resolution_s / np.sqrt(2.0 * (n + 1) * (n + 2))
    rest = abs(resolution_s - (high - low)) / np.sqrt(12.0)
    return (low + high) / 2, float(np.sqrt(filled**2 + rest**2 + COARSE_JITTER_S**2 / 4))


_MAX_DRIFT = 2e-3
_MAX_SCATTER_S = 0.5
_MAX_STATION_SCATTER_S = 2.0
_MIN_JUMP_S = 0.4
# A fix reaches the autopilot 60 to 220 ms after its epoch, by receiver (ArduPilot pull requests
# #5405 and #8763), and the log has its arrival: an unknown delay common to the flight.
RECEIVER_LAG_SIGMA_S = 0.1
# Even the least delayed message of a radio link is late.
LINK_DELAY_SIGMA_S = 0.1


def fit_boot_clock(boot: Boot) -> tuple[BootClock, tuple[Message, ...]]:
    """Fit the line from one boot's clock to UTC, from all pairs of the log.

    Preferably GPS time (DataFlash); else the autopilot's SYSTEM_TIME if it keeps its own rate and
    is within a day of the ground station's clock; else the latter's lower envelope.

    Raises
    ------
    UavgramError
        The log does not relate its boot clock to any other.
    """
    by_source = {samples.source: samples for samples in boot.clocks}
    gps, system, receive = (by_source.get(name) for name in ("gps", "system_time", "receive"))
    reason = ""
    if gps is not None:
        line = _line(gps)
        if _is_plausible(line, gps):
            return _clock(line, RECEIVER_LAG_SIGMA_S, "gps"), _describe_jumps(line, gps)
        reason = f"its GPS time {_explain_gps(line, gps)}"
    station = None if receive is None else fit_lower_envelope(receive.time_boot_s, receive.utc_s)
    station_is_dated = (
        station is not None
        and receive is not None
        and station.scatter_s < _MAX_STATION_SCATTER_S
        and _is_dated(station, receive.time_boot_s)
    )
    if system is not None:
        line = _line(system)
        objection = _explain_system_time(line, system, station if station_is_dated else None)
        if not objection:
            remarks = (*_describe_jumps(line, system), *_describe_difference(line, station))
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


def convert_boot_to_utc(clock: BootClock, time_boot_s: Floats) -> Floats:
    """Convert boot times to UTC seconds since the Unix epoch."""
    return np.asarray(clock.offset_s + clock.rate * np.asarray(time_boot_s, dtype=np.float64))


def convert_utc_to_boot(clock: BootClock, time_utc_s: Floats | float) -> Floats:
    """Convert UTC seconds to boot times."""
    return np.asarray((np.asarray(time_utc_s, dtype=np.float64) - clock.offset_s) / clock.rate)


def _line(samples: ClockSamples) -> ClockLine:
    return fit_line(samples.time_boot_s, samples.utc_s, BOOT_DRIFT_SIGMA)


def _clock(line: ClockLine, systematic_s: float, source: str) -> BootClock:
    return BootClock(
        offset_s=line.at(0.0),
        rate=1.0 + line.drift,
        # Errors may be correlated from reading to reading: their mean is not more precise than one.
        sigma_s=float(np.hypot(max(line.offset_sigma_s, line.scatter_s), systematic_s)),
        source=source,
        drift_sigma=line.drift_sigma,
        scatter_s=line.scatter_s,
    )


def _describe_jumps(line: ClockLine, samples: ClockSamples) -> tuple[Message, ...]:
    """Return a warning if readings are a good part of a second off the line: late leap seconds."""
    off_s = line.residual_s(samples.time_boot_s, samples.utc_s)
    jumped = np.abs(off_s) > _MIN_JUMP_S
    if not jumped.any():
        return ()
    text = (
        f"{int(jumped.sum())} of {len(off_s)} {samples.source} clock readings jump off the others, "
        f"by {float(np.median(off_s[jumped])):+.2f} s in the median: they were left out."
    )
    return (Message("warning", "clock-jumps", text),)


def _is_dated(line: ClockLine, time_boot_s: Floats) -> bool:
    """Return whether the line gives times at which autopilots existed."""
    return MIN_PLAUSIBLE_UTC_S < line.at(float(np.median(time_boot_s))) < MAX_PLAUSIBLE_UTC_S


def _is_plausible(line: ClockLine, samples: ClockSamples) -> bool:
    steady = abs(line.drift) < _MAX_DRIFT and line.scatter_s < _MAX_SCATTER_S
    return steady and _is_dated(line, samples.time_boot_s)


def _explain_gps(line: ClockLine, gps: ClockSamples) -> str:
    """Explain why GPS time cannot be related to the boot clock by a line."""
    if not _is_dated(line, gps.time_boot_s):
        return "is nonsense: it is of no year in which there were autopilots"
    half = len(gps.utc_s) // 2
    apart_s = gps.time_boot_s[half:] - gps.time_boot_s[: len(gps.utc_s) - half]
    utc_s = gps.utc_s[half:] - gps.utc_s[: len(gps.utc_s) - half]
    rates = apart_s[utc_s > 0] / utc_s[utc_s > 0]
    rate = float(np.median(rates)) if len(rates) else 1.0
    if abs(rate - 1) > _MAX_DRIFT:
        how = "slow" if rate < 1 else "fast"
        off = abs(rate - 1) * 100
        return f"is there, but the boot clock runs {off:.1f} % {how} against it"
    return f"scatters by {line.scatter_s:.1f} s about the boot clock"


def _explain_system_time(line: ClockLine, system: ClockSamples, station: ClockLine | None) -> str:
    """Explain why SYSTEM_TIME is not plausible; empty if it is."""
    middle = float(np.median(system.time_boot_s))
    stated = line.at(middle)
    if not _is_dated(line, system.time_boot_s):
        return f"is nonsense ({stated / (365.2425 * DAY_S) + 1970:.0f} as the year)"
    if not _is_plausible(line, system):
        return "does not keep pace with its boot clock"
    if station is not None:
        apart = stated - station.at(middle)
        if abs(apart) > DAY_S:
            return f"is {apart / DAY_S:.1f} days off the ground station's clock"
    return ""


def _describe_difference(line: ClockLine, station: ClockLine | None) -> tuple[Message, ...]:
    """Return a remark if the ground station's clock differs."""
    apart = 0.0 if station is None else station.at(0.0) - line.at(0.0)
    if abs(apart) < 1.0:
        return ()
    text = f"The ground station's clock is {apart:+.1f} s off the autopilot's UTC, which was used."
    return (Message("info", "clock-station-off", text),)
