"""Instants of photos: by a stated offset of the camera's clock, by order, or by alignment."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.errors import UavgramError
from uavgram.estimation.clocks.alignment import Alignment, align
from uavgram.estimation.clocks.clock_line import COARSE_STEP_S
from uavgram.model.flight_log import Boot
from uavgram.model.frames import Photos
from uavgram.model.message import Message
from uavgram.model.options import TimeOptions
from uavgram.stages.synchronise.boots import ClockedBoot, apart, is_inside, log_spans, photos_span
from uavgram.stages.synchronise.event_times import (
    EVENT_JITTER_S,
    HOW,
    Timing,
    event_timing,
    file_sigma_s,
)


def match_by_order(
    photos: Photos, usable: list[ClockedBoot], options: TimeOptions
) -> tuple[ClockedBoot, Timing]:
    """Pair photo i with event i, by the order of the names, only where both are equally many.

    Parameters
    ----------
    photos
        The photos, with their file times.
    usable
        Boots of the log that have a clock, and events where these are needed.
    options
        The project's `time`.
    """
    count = len(photos.frame_id)
    confirmed = [_confirmed(c.boot) for c in usable]
    fitting = [c for c, number in zip(usable, confirmed, strict=True) if number == count]
    if len(fitting) != 1:
        held = " and ".join(str(number) for number in confirmed)
        raise UavgramError(
            f"there are {count} photos and {held} confirmed camera events in the log: without "
            "file times they can be paired only where both are equally many, in one boot; "
            "give all photos of the flight, or set time.source to exif or filename"
        )
    chosen = fitting[0]
    time = chosen.event_utc_s()
    text = f"The {count} photos were paired with the log's {count} camera events in order."
    return chosen, Timing(
        time,
        np.full(count, EVENT_JITTER_S),
        0.0,
        min(options.offset_sigma_s, chosen.lag_sigma_s()),
        (Message("info", "time-by-order", text),),
    )


def _confirmed(boot: Boot) -> int:
    return 0 if boot.events is None else int((boot.events.confirmed > 0).sum())


def match_by_offset(
    photos: Photos, usable: list[ClockedBoot], options: TimeOptions, offset_s: float
) -> tuple[ClockedBoot, Timing]:
    """Apply a stated offset; coarse file times take the time of their event.

    Parameters
    ----------
    photos
        The photos, with their file times.
    usable
        Boots of the log that have a clock, and events where these are needed.
    options
        The project's `time`.
    offset_s
        Camera clock minus UTC.
    """
    time = photos.file_time_s - offset_s
    inside = [is_inside(time, c) for c in usable]
    most = int(np.argmax([int(mask.sum()) for mask in inside]))
    chosen = usable[most]
    if not inside[most].any():
        raise UavgramError(apart(time, usable)[1])
    resolution = float(np.nanmax(photos.file_time_resolution_s))
    # Common to all frames: the stated offset's sigma, the boot clock's line to UTC (a stated
    # offset is against UTC, the flight is on the boot clock), and whether the camera truncates
    # readings (half a step on average) or rounds them (zero): root mean square of the two.
    stated = float(np.hypot(options.offset_sigma_s, chosen.clock.sigma_s))
    sigma = float(np.hypot(stated, resolution / np.sqrt(8.0)))
    drift_sigma = options.drift_sigma_ppm * 1e-6
    plain = Timing(time, file_sigma_s(photos), offset_s, sigma, drift_sigma=drift_sigma)
    if resolution <= COARSE_STEP_S or chosen.boot.events is None:
        return chosen, plain
    reach = 3 * stated + resolution / 2
    return chosen, _snapped(photos, chosen, options, plain, reach)


def _snapped(
    photos: Photos,
    chosen: ClockedBoot,
    options: TimeOptions,
    plain: Timing,
    reach_s: float,
) -> Timing:
    """Replace coarse file times by those of their events, where these are certain."""
    timed = np.isfinite(photos.file_time_s)
    resolution = float(np.nanmax(photos.file_time_resolution_s))
    bounds = (plain.offset_s - reach_s, plain.offset_s + reach_s)
    alignment = align(photos.file_time_s[timed], resolution, chosen.event_utc_s(), bounds)
    if not alignment.unique:
        text = (
            f"The photos' times are rough: they are in steps of {resolution:g} s, and fit the "
            "log's camera events in several ways. They were used without correction. Take all "
            "photos of the flight, or state time.offset_s better."
        )
        return replace(plain, messages=(Message("warning", "time-coarse", text),))
    taken = int(alignment.certain.sum())
    text = (
        f"The photos' times are in steps of {resolution:g} s: {taken} photos took the time "
        f"of their camera event (camera clock minus UTC {alignment.clock.offset_s:+.3f} s)."
    )
    message = Message("info", "time-aligned", text)
    return event_timing(photos, chosen, alignment, options, (message,))


def match_by_alignment(
    photos: Photos, usable: list[ClockedBoot], options: TimeOptions
) -> tuple[ClockedBoot, Timing]:
    """Estimate the offset of the camera's clock from the log's camera events.

    Parameters
    ----------
    photos
        Photos of the project, with their file times.
    usable
        Boots of the log with positions and a clock.
    options
        Requested options.

    Raises
    ------
    UavgramError
        The log has no camera events, or they fit the photos under no single offset: the message
        lists the possible offsets.
    """
    timed = np.isfinite(photos.file_time_s)
    resolution = float(np.nanmax(photos.file_time_resolution_s))
    results = [(c, align(photos.file_time_s[timed], resolution, c.event_utc_s())) for c in usable]
    results.sort(key=lambda r: -(r[1].candidates[0].matched if r[1].candidates else 0))
    chosen, best = results[0]
    if not best.candidates:
        raise UavgramError(
            "time.offset_s is auto but the log has no camera events to find it from (by the "
            f"camera's clock the photos were taken {photos_span(photos.file_time_s)}, the log runs "
            f"from {log_spans(usable)}: is it whole, and of this flight?): set time.offset_s "
            "(camera clock minus UTC, in seconds) and time.offset_sigma_s, or `ties: auto`, which "
            "finds it from points that the photos share"
        )
    unique = [result for _, result in results if result.unique]
    if len(unique) > 1:
        raise UavgramError(_two_boots(unique))
    if not best.unique:
        raise UavgramError(_ambiguity(best, int(timed.sum()), len(chosen.event_utc_s())))
    message = Message("info", "time-aligned", _found(best, len(photos.frame_id)))
    return chosen, event_timing(photos, chosen, best, options, (message,))


def _found(alignment: Alignment, photos: int) -> str:
    clock = alignment.clock
    drift = ""
    if clock.drifts:
        drift = f", drifting by {clock.drift * 1e6:+.1f} +- {clock.drift_sigma * 1e6:.1f} ppm,"
    paired = alignment.event_index >= 0
    scatter = float(np.sqrt(np.mean(alignment.residual_s[paired] ** 2)))
    return (
        f"Camera clock minus UTC is {clock.offset_s:+.4f} +- {clock.offset_sigma_s:.4f} s{drift} "
        f"by {int(paired.sum())} of {photos} photos on a camera event each, {scatter:.3f} s rms "
        f"apart (next best: {_rival(alignment)})."
    )


def _rival(alignment: Alignment) -> str:
    if len(alignment.candidates) < 2:
        return "none"
    other = alignment.candidates[1]
    return f"{other.clock.offset_s:+.3f} s with {other.matched}"


def _ambiguity(alignment: Alignment, photos: int, events: int) -> str:
    listed = ", ".join(
        f"{c.clock.offset_s:+.3f} s ({c.matched} of {photos} photos)"
        for c in alignment.candidates[:5]
    )
    if alignment.candidates[0].matched < 0.6 * photos:
        return (
            f"time.offset_s is auto, but under no offset of the camera's clock do most of the "
            f"{photos} photos fall on one of the log's {events} camera events (best: {listed}): "
            f"is this the log of another flight? {HOW}"
        )
    return (
        f"time.offset_s is auto, but {photos} photos fit the log's {events} camera events under "
        f"no single offset of the camera's clock that is clearly best: {listed}. {HOW}"
    )


def _two_boots(unique: list[Alignment]) -> str:
    listed = " and ".join(
        f"{a.clock.offset_s:+.3f} s ({a.candidates[0].matched} photos)" for a in unique
    )
    return (
        f"time.offset_s is auto, but the photos fit the camera events of {len(unique)} flights of "
        f"the log: {listed}. {HOW}"
    )
