"""What a flight log amounts to, boot by boot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from uavgram.model.arrays import NAN_IS_NONE, Floats, FrozenArrays
from uavgram.model.flight.log import Boot, BootClock, FlightLog
from uavgram.model.message import Message


@dataclass(frozen=True, kw_only=True, eq=False)
class BootSummary(FrozenArrays):
    """One boot, judged.

    Attributes
    ----------
    boot
        Its tables.
    clock
        Its line to UTC; None where the log has none.
    span_utc
        First and last position, for people; empty without a clock.
    track_m
        (N, 2) positions, metres east and north of the first.
    path_m
        Length of the way over ground.
    clock_time_s, clock_residual_s
        (C,) boot times of the readings that the clock was made of, and by how much each is ahead
        of its line.
    event_track_m
        (E, 2) where the camera events lie on the track; NaN outside of it.
    home_moves_m
        The furthest that home moves from where it first was.
    messages
        What is odd about the clock, the track, the events.
    """

    boot: Boot
    clock: BootClock | None
    span_utc: tuple[str, str]
    track_m: Annotated[Floats, "n", 2]
    path_m: float
    clock_time_s: Annotated[Floats, "c"]
    clock_residual_s: Annotated[Floats, "c"]
    event_track_m: Annotated[Floats, "e", 2, NAN_IS_NONE]
    home_moves_m: float
    messages: tuple[Message, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class LogSummary:
    """A flight log and its judged boots."""

    log: FlightLog
    boots: tuple[BootSummary, ...]
