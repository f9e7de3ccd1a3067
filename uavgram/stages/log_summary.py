"""Summary of a flight log, boot by boot: clock, track, events and anomalies."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from uavgram.errors import UavgramError
from uavgram.estimation.clocks.clock_line import convert_boot_to_utc, fit_boot_clock
from uavgram.geometry.geodesy import enu_from_geodetic
from uavgram.geometry.gps_time import utc_text
from uavgram.model.arrays import Floats
from uavgram.model.flight_log import (
    Boot,
    BootClock,
    BootSummary,
    CameraEvents,
    FlightLog,
    HomeSamples,
    LogSummary,
    PositionSamples,
)
from uavgram.model.message import Message
from uavgram.model.survey import Geodetic

_LONG_PAUSE_S = 1.0
_HOME_MOVED_M = 0.5
_HEIGHT_JUMP_M = 50.0


def summarise_log(log: FlightLog) -> LogSummary:
    """Summarise the clock, the track and the events of every boot; missing parts are no error."""
    return LogSummary(log=log, boots=tuple(_boot_summary(boot) for boot in log.boots))


def _boot_summary(boot: Boot) -> BootSummary:
    clock, messages = _clock(boot)
    time, residual = _residuals(boot, clock)
    track = np.zeros((0, 2))
    if boot.positions is not None:
        track = _from_first_m(boot.positions)[:, :2]
    return BootSummary(
        boot=boot,
        clock=clock,
        span_utc=_span(boot.positions, clock),
        track_m=track,
        path_m=float(np.linalg.norm(np.diff(track, axis=0), axis=1).sum()),
        clock_time_s=time,
        clock_residual_s=residual,
        event_track_m=_on_track(boot.events, boot.positions, track),
        home_moves_m=_home_moves_m(boot.home),
        messages=(*messages, *_unusual(boot)),
    )


def _clock(boot: Boot) -> tuple[BootClock | None, tuple[Message, ...]]:
    try:
        return fit_boot_clock(boot)
    except UavgramError as error:
        why = str(error)
        text = f"{why[0].upper()}{why[1:]}."
        return None, (Message("warning", "clock-missing", text),)


def _span(positions: PositionSamples | None, clock: BootClock | None) -> tuple[str, str]:
    if positions is None or clock is None:
        return "", ""
    first, last = convert_boot_to_utc(clock, positions.time_boot_s[[0, -1]])
    return utc_text(float(first)), utc_text(float(last))


def _residuals(boot: Boot, clock: BootClock | None) -> tuple[Floats, Floats]:
    for samples in boot.clocks:
        if clock is not None and samples.source == clock.source:
            # the offset first: beside 1e9 s a microsecond of the others would be lost
            line = clock.rate * samples.time_boot_s
            return samples.time_boot_s, (samples.utc_s - clock.offset_s) - line
    return np.zeros(0), np.zeros(0)


def _from_first_m(places: PositionSamples | HomeSamples) -> Floats:
    """Return east, north, up (N, 3) relative to the first position."""
    geodetic = places.latitude_deg, places.longitude_deg, places.height_m
    first = Geodetic(*(float(column[0]) for column in geodetic))
    return enu_from_geodetic(*geodetic, first)


def _on_track(
    events: CameraEvents | None, positions: PositionSamples | None, track_m: Floats
) -> Floats:
    if events is None or positions is None:
        return np.full((0 if events is None else len(events.time_boot_s), 2), np.nan)
    known, asked = positions.time_boot_s, events.time_boot_s
    axes = [np.interp(asked, known, track_m[:, k], np.nan, np.nan) for k in (0, 1)]
    return np.stack(axes, axis=1)


def _home_moves_m(home: HomeSamples | None) -> float:
    if home is None:
        return 0.0
    return float(np.linalg.norm(_from_first_m(home), axis=1).max())


def _unusual(boot: Boot) -> Iterator[Message]:
    positions, events = boot.positions, boot.events
    if boot.attitudes is None:
        yield _warning(
            "attitude-missing",
            "The log has no attitude of the vehicle: photos take their positions from it, but "
            "their directions only from tie points (`uavgram picks ties`) or picks.",
        )
    if positions is None:
        yield _warning(
            "position-missing",
            "It is never stated where the vehicle is: this log cannot place photos.",
        )
        return
    pauses = np.diff(positions.time_boot_s)
    if (pauses > _LONG_PAUSE_S).any():
        text = (
            f"The log has gaps in its positions: {positions.source} pauses "
            f"{int((pauses > _LONG_PAUSE_S).sum())} times for more than {_LONG_PAUSE_S:.0f} s, "
            f"{pauses.max():.1f} s at the longest. Photos taken then have no place."
        )
        yield _warning("position-gap", text)
    jump = float(np.abs(np.diff(positions.height_m)).max(initial=0.0))
    if jump > _HEIGHT_JUMP_M:
        text = (
            f"The height jumps by {jump:.0f} m from one position to the next: do not trust the "
            "photos about it."
        )
        yield _warning("height-jump", text)
    if events is not None:
        first, last = positions.time_boot_s[[0, -1]]
        outside = int(((events.time_boot_s < first) | (events.time_boot_s > last)).sum())
        if outside:
            text = (
                f"{outside} camera events are before the first or after the last position: their "
                "photos have no place."
            )
            yield _warning("event-outside", text)
    moved = _home_moves_m(boot.home)
    if moved > _HOME_MOVED_M:
        yield Message("info", "home-moves", f"Home moves by up to {moved:.1f} m.")


def _warning(code: str, text: str) -> Message:
    return Message("warning", code, text)
