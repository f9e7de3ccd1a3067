"""Instants of photos: by a stated offset, by alignment with the camera events, or by order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.errors import UavgramError
from uavgram.estimation.boot_clock import as_text
from uavgram.estimation.time_alignment import Alignment, align
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.frames import Photos
from uavgram.model.message import Message
from uavgram.model.options import TimeOptions
from uavgram.model.telemetry import Boot
from uavgram.stages.synchronise.boots import ClockedBoot, is_inside

COARSE_S = 0.1  # file times of a coarser step are replaced by the event they belong to
_LEAST_JITTER_S = 0.002
_EVENT_JITTER_S = 0.01  # of a shutter after its event, where file times are too coarse to tell


@dataclass(frozen=True, eq=False)
class Timing:
    """Instants of F photos and where they come from, before the log's span is looked at."""

    time_utc_s: Floats
    sigma_time_s: Floats
    offset_s: float
    offset_sigma_s: float
    messages: tuple[Message, ...] = ()


def by_order(
    photos: Photos, usable: list[ClockedBoot], options: TimeOptions
) -> tuple[ClockedBoot, Timing]:
    """Photo i is event i, by the order of the names: only where both are equally many."""
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
    text = f"the {count} photos were paired with the log's {count} camera events in order"
    return chosen, Timing(
        time,
        np.full(count, _EVENT_JITTER_S),
        0.0,
        min(options.offset_sigma_s, chosen.lag_sigma_s()),
        (Message("info", "time-by-order", text),),
    )


def _confirmed(boot: Boot) -> int:
    return 0 if boot.events is None else int((boot.events.confirmed > 0).sum())


def by_alignment(
    photos: Photos, usable: list[ClockedBoot], options: TimeOptions
) -> tuple[ClockedBoot, Timing]:
    """Offset of the camera's clock from the log's camera events."""
    timed = np.isfinite(photos.file_time_s)
    resolution = float(np.nanmax(photos.file_time_resolution_s))
    results = [(c, align(photos.file_time_s[timed], resolution, c.event_utc_s())) for c in usable]
    results.sort(key=lambda r: -(r[1].candidates[0].matched if r[1].candidates else 0))
    chosen, best = results[0]
    if not best.candidates:
        raise UavgramError(
            "time.offset_s is auto but the log has no camera events to find it from: "
            "set time.offset_s (camera clock minus UTC, in seconds) and time.offset_sigma_s"
        )
    rivals = sum(result.unique for _, result in results)
    if not best.unique or rivals > 1:
        raise UavgramError(_ambiguity(best, int(timed.sum()), len(chosen.event_utc_s())))
    text = (
        f"camera clock minus UTC is {best.offset_s:+.3f} s by {_pairs(best)} of "
        f"{len(photos.frame_id)} photos on a camera event each "
        f"(next best: {_rival(best)})"
    )
    messages = [Message("info", "time-aligned", text)]
    timing = _event_timing(photos, chosen, best, options, timed)
    alone = int((timed).sum()) - _pairs(best)
    if alone:
        text = f"{alone} photos have no camera event of their own: their file times were used"
        messages.append(Message("warning", "photo-without-event", text))
    return chosen, Timing(
        timing.time_utc_s,
        timing.sigma_time_s,
        timing.offset_s,
        timing.offset_sigma_s,
        tuple(messages),
    )


def _pairs(alignment: Alignment) -> int:
    return int((alignment.event_index >= 0).sum())


def _rival(alignment: Alignment) -> str:
    if len(alignment.candidates) < 2:
        return "none"
    other = alignment.candidates[1]
    return f"{other.offset_s:+.3f} s with {other.matched}"


def _ambiguity(alignment: Alignment, photos: int, events: int) -> str:
    listed = ", ".join(
        f"{c.offset_s:+.3f} s ({c.matched} of {photos} photos)" for c in alignment.candidates[:5]
    )
    return (
        f"time.offset_s is auto, but {photos} photos fit the log's {events} camera events under "
        f"no single offset of the camera's clock that is clearly best: {listed}. Set "
        "time.offset_s to the right one (compare a photo's time with the flight), and "
        "time.offset_sigma_s to how well it is known"
    )


def _event_timing(
    photos: Photos, chosen: ClockedBoot, alignment: Alignment, options: TimeOptions, timed: Bools
) -> Timing:
    """Event times where a photo has one, file times less the offset elsewhere."""
    event, residual = _spread(alignment, timed)
    paired = event >= 0
    time = photos.file_time_s - alignment.offset_s
    time = np.where(paired, chosen.event_utc_s()[np.where(paired, event, 0)], time)
    fine = float(np.nanmax(photos.file_time_resolution_s)) <= 0.02
    jitter = _EVENT_JITTER_S
    if fine and paired.sum() > 2:
        jitter = float(np.clip(np.std(residual[paired]), _LEAST_JITTER_S, COARSE_S))
    sigma = np.where(paired, jitter, _file_sigma_s(photos))
    return Timing(
        time,
        sigma,
        alignment.offset_s,
        min(
            options.offset_sigma_s, float(np.hypot(alignment.offset_sigma_s, chosen.lag_sigma_s()))
        ),
    )


def _spread(alignment: Alignment, timed: Bools) -> tuple[Ints, Floats]:
    """The alignment of the photos with a file time, over all photos."""
    event = np.full(len(timed), -1, dtype=np.int64)
    event[timed] = alignment.event_index
    residual = np.full(len(timed), np.nan)
    residual[timed] = alignment.residual_s
    return event, residual


def _file_sigma_s(photos: Photos) -> Floats:
    """(F,) of a file time: its step (uniform: step / sqrt(12)) and the camera's jitter."""
    return np.asarray(np.maximum(photos.file_time_resolution_s / np.sqrt(12), _LEAST_JITTER_S))


def by_offset(
    photos: Photos, usable: list[ClockedBoot], options: TimeOptions, offset_s: float
) -> tuple[ClockedBoot, Timing]:
    """A stated offset; coarse file times take the time of the event that they belong to."""
    time = photos.file_time_s - offset_s
    inside = [is_inside(time, c) for c in usable]
    most = int(np.argmax([int(mask.sum()) for mask in inside]))
    chosen = usable[most]
    if not inside[most].any():
        raise UavgramError(_another_day(time, usable))
    sigma = float(np.hypot(options.offset_sigma_s, chosen.clock.sigma_s))
    plain = Timing(time, _file_sigma_s(photos), offset_s, sigma)
    coarse = float(np.nanmax(photos.file_time_resolution_s)) > COARSE_S
    if not coarse or chosen.boot.events is None:
        return chosen, plain
    timed = np.isfinite(photos.file_time_s)
    resolution = float(np.nanmax(photos.file_time_resolution_s))
    reach = 3 * sigma + resolution / 2
    alignment = align(
        photos.file_time_s[timed],
        resolution,
        chosen.event_utc_s(),
        (offset_s - reach, offset_s + reach),
    )
    if not alignment.unique:
        text = (
            f"file times are in steps of {resolution:g} s and could not be aligned with the "
            "camera events without ambiguity: they were used as they are"
        )
        remark = Message("warning", "time-coarse", text)
        return chosen, Timing(time, plain.sigma_time_s, offset_s, sigma, (remark,))
    text = (
        f"file times are in steps of {resolution:g} s: {_pairs(alignment)} photos took the time "
        f"of their camera event (camera clock minus UTC {alignment.offset_s:+.3f} s)"
    )
    snapped = _event_timing(photos, chosen, alignment, options, timed)
    return chosen, Timing(
        snapped.time_utc_s,
        snapped.sigma_time_s,
        snapped.offset_s,
        snapped.offset_sigma_s,
        (Message("info", "time-aligned", text),),
    )


def _another_day(time_utc_s: Floats, usable: list[ClockedBoot]) -> str:
    """Both spans and what lies between them."""
    spans = [c.span_utc_s() for c in usable]
    middle = float(np.nanmedian(time_utc_s))
    nearest = min(spans, key=lambda s: abs(middle - (s[0] + s[1]) / 2))
    apart = float(np.nanmin(time_utc_s)) - nearest[0]
    log_text = " and ".join(f"{as_text(a)} to {as_text(b)}" for a, b in spans)
    return (
        f"no photo lies in the flight: the photos were taken {as_text(np.nanmin(time_utc_s))} to "
        f"{as_text(np.nanmax(time_utc_s))} (file times less time.offset_s), the log runs from "
        f"{log_text}; is this the log of another flight, or is time.offset_s wrong by about "
        f"{apart:+.0f} s ({apart / 3600:+.2f} h)?"
    )
