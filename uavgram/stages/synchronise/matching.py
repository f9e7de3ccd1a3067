"""Assign to each photo its instant in the flight.

The log's boot clock is tied to UTC (estimation/clocks/clock_line.py); the photos' clock is tied to
it by a stated offset, or by aligning photos with the log's camera events. Photos are never paired
with events by their order alone, unless both are equally many and the project requests it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from uavgram.errors import UavgramError
from uavgram.estimation.first_poses.tied.bundle import TiedPoses
from uavgram.geometry.gps_time import DAY_S
from uavgram.model.flight_log import Boot, BootClock, FlightLog
from uavgram.model.frames import Frames, Pairing, Photos
from uavgram.model.message import Message
from uavgram.model.options import TimeOptions
from uavgram.stages.synchronise.boots import apart, has_events, usable_boots
from uavgram.stages.synchronise.event_times import placed_frames, unmatched_messages
from uavgram.stages.synchronise.tied_times import synchronise_by_ties
from uavgram.stages.synchronise.timing import match_by_alignment, match_by_offset, match_by_order

Ties = Callable[[], TiedPoses | None]


@dataclass(frozen=True, kw_only=True, eq=False)
class Synchronised:
    """Frames on the clock of one boot of the log.

    Attributes
    ----------
    frames
        One for each photo, in the photos' order.
    boot, clock
        The boot that contains them, and its line to UTC.
    messages
        Messages on the choice, and on anomalies.
    pairing
        Photos and camera events, pair by pair, where they were aligned by their times; otherwise
        None.
    """

    frames: Frames
    boot: Boot
    clock: BootClock
    messages: tuple[Message, ...]
    pairing: Pairing | None = None


def synchronise(
    photos: Photos, log: FlightLog, options: TimeOptions, ties: Ties | None = None
) -> Synchronised:
    """Assign to every photo its instant in the flight.

    Parameters
    ----------
    photos
        Photos with their file times, in the order of their names.
    log
        The flight; of several boots the one that contains the photos is taken.
    options
        Source of the times; offset of the camera's clock, or ``auto``.
    ties
        Function that returns the poses of the photos from their tie points alone; called where no
        camera event determines the offset.

    Raises
    ------
    UavgramError
        No boot has UTC, no photo is within the flight, the alignment with the camera events is not
        unique, or no observation determines the offset. The message names the remedy.
    """
    usable = usable_boots(log)
    known_s = 0.0 if options.offset_s == "auto" else float(options.offset_s)
    apart_s, both = apart(photos.file_time_s - known_s, usable)
    try:
        if options.source == "events" or photos.time_source == "none":
            chosen, timing = match_by_order(photos, usable, options)
        elif options.offset_s == "auto" and ties is not None and not has_events(log):
            chosen, timing = synchronise_by_ties(photos, usable, options, ties())
        elif options.offset_s == "auto":
            chosen, timing = match_by_alignment(photos, usable, options)
        else:
            chosen, timing = match_by_offset(photos, usable, options, known_s)
    except UavgramError as fault:
        raise UavgramError(both if abs(apart_s) > DAY_S else str(fault)) from fault
    messages = (*chosen.messages, *timing.messages)
    if abs(apart_s) > DAY_S:
        told = Message("warning", "log-of-another-day", f"By the camera's clock {both}.")
        messages = (told, *messages)
    frames = placed_frames(photos, chosen, timing)
    return Synchronised(
        frames=frames,
        boot=chosen.boot,
        clock=chosen.clock,
        messages=(*messages, *unmatched_messages(frames)),
        pairing=timing.pairing,
    )
