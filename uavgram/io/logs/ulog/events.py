"""Exposures, home and UTC in a PX4 log."""

from __future__ import annotations

from typing import Literal

import numpy as np

from uavgram.geometry.earth.gps_time import MAX_PLAUSIBLE_UTC_S, MIN_PLAUSIBLE_UTC_S
from uavgram.io.logs.quality.image_numbers import events_of, image_numbers
from uavgram.io.logs.quality.rows import plausible_rows
from uavgram.io.logs.quality.samples import Found, clock_samples, home_samples
from uavgram.io.logs.ulog.samples import has_fix, receiver
from uavgram.io.logs.ulog.topics import Topic, UlogTables
from uavgram.model.arrays import Bools, Floats
from uavgram.model.flight.log import CameraEvents, ClockSamples, HomeSamples

_LATEST_FEEDBACK_S = 1.0  # after its command
_EARLIEST_FEEDBACK_S = -0.02


def camera_events(tables: UlogTables) -> Found[CameraEvents]:
    """camera_capture joined with the commands of camera_trigger; else camera_trigger alone.

    The trigger and the capture driver of PX4 count for themselves (src/drivers/camera_trigger,
    src/drivers/camera_capture), so a missed shot shifts the one count against the other: commands
    are joined with feedback by time.
    """
    capture, trigger = tables.topic("camera_capture"), tables.topic("camera_trigger")
    if capture is None and trigger is None:
        return None, ()
    fed_back = np.zeros(0, dtype=bool) if trigger is None else trigger.column("feedback") > 0
    main, confirmed = _main(capture, trigger, fed_back)
    number = image_numbers(main.column("seq"))
    rows = plausible_rows(main.time_s, np.ones(len(main.time_s), dtype=bool))
    time, number, confirmed = main.time_s[rows], number[rows], confirmed[rows]
    missed, source = None, main.name
    if trigger is not None and fed_back.any():
        commands = trigger.time_s[plausible_rows(trigger.time_s, ~fed_back)]
        unanswered = commands[~_is_answered(commands, time)]
        missed = unanswered, np.full(len(unanswered), -1)
        source = "camera_capture+camera_trigger" if capture is not None else source
    instant: Literal["feedback", "command"] = "feedback" if fed_back.any() else "command"
    return events_of(source, instant, (time, number, confirmed), missed)


def _main(capture: Topic | None, trigger: Topic | None, fed_back: Bools) -> tuple[Topic, Floats]:
    """The topic whose rows are the exposures, and whether each is confirmed."""
    if capture is not None:
        # result: 1 success, 0 failure, -1 the camera gives no feedback (msg/CameraCapture.msg)
        return capture, np.where(capture.column("result") == 0, 0.0, 1.0)
    assert trigger is not None  # noqa: S101 - one of the two is there
    if not fed_back.any():
        return trigger, np.zeros(len(trigger.time_s))  # commands only
    fields = {name: values[fed_back] for name, values in trigger.fields.items()}
    return Topic(trigger.name, trigger.time_s[fed_back], fields), np.ones(int(fed_back.sum()))


def _is_answered(command_s: Floats, feedback_s: Floats) -> Bools:
    """(C,) whether feedback comes after a command, before the next one and within a second."""
    until = np.minimum(
        np.append(command_s[1:] + _EARLIEST_FEEDBACK_S, np.inf), command_s + _LATEST_FEEDBACK_S
    )
    first = np.searchsorted(feedback_s, command_s + _EARLIEST_FEEDBACK_S)
    return np.asarray(first < np.searchsorted(feedback_s, until))


def home(tables: UlogTables) -> HomeSamples | None:
    """home_position, where its horizontal position is valid."""
    topic = tables.topic("home_position")
    if topic is None:
        return None
    valid = ~(topic.column("valid_hpos") == 0) & ~(topic.column("valid_alt") == 0)
    place = topic.column("lat"), topic.column("lon"), topic.column("alt")
    return home_samples(topic.name, topic.time_s, place, valid)


def gps_clock(tables: UlogTables) -> tuple[ClockSamples, ...]:
    """Pairs of boot time and the receiver's UTC, one for each 3-D fix."""
    topic = receiver(tables)
    if topic is None:
        return ()
    # the instant of the UTC stamp, where it is not that of publishing (msg/SensorGps.msg)
    relative = topic.column("timestamp_time_relative") * 1e-6
    time = topic.time_s + np.where(np.abs(relative) < 1.0, relative, 0.0)
    utc = topic.column("time_utc_usec") * 1e-6
    dated = (utc > MIN_PLAUSIBLE_UTC_S) & (utc < MAX_PLAUSIBLE_UTC_S)
    return clock_samples("gps", time, utc, dated & has_fix(topic))
