"""What a flight log amounts to, boot by boot: its clock and its span in UTC."""

from __future__ import annotations

from dataclasses import dataclass

from uavgram.errors import UavgramError
from uavgram.estimation.boot_clock import as_text, fit_boot_clock, to_utc
from uavgram.model.message import Message
from uavgram.model.telemetry import Boot, BootClock, FlightLog


@dataclass(frozen=True, kw_only=True, eq=False)
class BootSummary:
    """One boot, judged.

    Attributes
    ----------
    boot
        Its tables.
    clock
        Its line to UTC; None where the log has none.
    span_utc
        First and last position, for people; empty without a clock.
    messages
        What was odd about the clock.
    """

    boot: Boot
    clock: BootClock | None
    span_utc: tuple[str, str]
    messages: tuple[Message, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class LogSummary:
    """A flight log and its judged boots."""

    log: FlightLog
    boots: tuple[BootSummary, ...]


def summarise_log(log: FlightLog) -> LogSummary:
    """Judge the clock of every boot; a boot without UTC is no error here."""
    return LogSummary(log=log, boots=tuple(_boot_summary(boot) for boot in log.boots))


def _boot_summary(boot: Boot) -> BootSummary:
    try:
        clock, messages = fit_boot_clock(boot)
    except UavgramError as error:
        remark = Message("warning", "clock-missing", str(error))
        return BootSummary(boot=boot, clock=None, span_utc=("", ""), messages=(remark,))
    if boot.positions is None:
        return BootSummary(boot=boot, clock=clock, span_utc=("", ""), messages=messages)
    first, last = to_utc(clock, boot.positions.time_boot_s[[0, -1]])
    span = (as_text(float(first)), as_text(float(last)))
    return BootSummary(boot=boot, clock=clock, span_utc=span, messages=messages)
