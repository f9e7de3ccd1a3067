"""Which instant of the flight belongs to which photo.

The log's boot clock is tied to UTC (estimation/boot_clock.py); the photos' clock is tied to it by
a stated offset, or by aligning photos with the log's camera events. Photos are never paired with
events by their order alone, unless both are equally many and the project asks for it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.errors import UavgramError
from uavgram.estimation.boot_clock import as_text, fit_boot_clock, to_utc
from uavgram.estimation.time_alignment import Alignment, align
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.frames import Frames, Photos
from uavgram.model.message import Message
from uavgram.model.options import TimeOptions
from uavgram.model.telemetry import Boot, BootClock, FlightLog

COARSE_S = 0.1  # file times of a coarser step are replaced by the event they belong to
LONGEST_GAP_S = 1.0  # to the nearest logged position
_LEAST_JITTER_S = 0.002
_EVENT_JITTER_S = 0.01  # of a shutter after its event, where file times are too coarse to tell
# From the event to the exposure, common to all frames: small behind a feedback pin, unknown
# behind a command (86 to 147 ms were measured in ArduPilot's simulator).
_FEEDBACK_LAG_SIGMA_S = 0.02
_COMMAND_LAG_SIGMA_S = 0.1


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
        What was chosen, and what is odd.
    """

    frames: Frames
    boot: Boot
    clock: BootClock
    messages: tuple[Message, ...]


@dataclass(frozen=True, eq=False)
class _Clocked:
    """A boot that can be used: with positions and a clock."""

    boot: Boot
    clock: BootClock
    messages: tuple[Message, ...]

    def event_utc_s(self) -> Floats:
        """(E,) camera events; those with feedback where the log has any."""
        events = self.boot.events
        if events is None:
            return np.zeros(0)
        confirmed = events.confirmed > 0
        return to_utc(self.clock, events.time_boot_s[confirmed if confirmed.any() else slice(None)])

    def span_utc_s(self) -> tuple[float, float]:
        """Between which instants position and attitude are both known."""
        tables = [t for t in (self.boot.positions, self.boot.attitudes) if t is not None]
        ends = np.array([to_utc(self.clock, t.time_boot_s[[0, -1]]) for t in tables])
        return float(ends[:, 0].max()), float(ends[:, 1].min())

    def lag_sigma_s(self) -> float:
        """Of an exposure after its event, common to the flight."""
        source = "" if self.boot.events is None else self.boot.events.source
        return _FEEDBACK_LAG_SIGMA_S if source == "TRIG+CAM" else _COMMAND_LAG_SIGMA_S


@dataclass(frozen=True, eq=False)
class _Timing:
    """Instants of F photos and where they come from, before the log's span is looked at."""

    time_utc_s: Floats
    sigma_time_s: Floats
    offset_s: float
    offset_sigma_s: float
    messages: tuple[Message, ...] = ()


def fit_clock(boot: Boot) -> tuple[BootClock, tuple[Message, ...]]:
    """Find the line from one boot's clock to UTC; see `estimation.boot_clock.fit_boot_clock`."""
    return fit_boot_clock(boot)


def synchronise(photos: Photos, log: FlightLog, options: TimeOptions) -> Synchronised:
    """Give every photo its instant in the flight.

    Parameters
    ----------
    photos
        With their file times, in the order of their names.
    log
        The flight; of several boots the one that contains the photos is taken.
    options
        Source of the times; offset of the camera's clock, or ``auto``.

    Raises
    ------
    UavgramError
        No boot has UTC, no photo lies in the flight, the alignment with the camera events is not
        unique, or there is nothing that could tell the offset. The message says how to settle it.
    """
    usable = _usable(log)
    if options.source == "events" or photos.time_source == "none":
        chosen, timing = _by_order(photos, usable, options)
    elif options.offset_s == "auto":
        chosen, timing = _by_alignment(photos, usable, options)
    else:
        chosen, timing = _by_offset(photos, usable, options, float(options.offset_s))
    frames = _frames(photos, chosen, timing)
    return Synchronised(
        frames=frames,
        boot=chosen.boot,
        clock=chosen.clock,
        messages=(*chosen.messages, *timing.messages, *_unmatched_messages(frames)),
    )


def _usable(log: FlightLog) -> list[_Clocked]:
    """Boots with positions and UTC."""
    found: list[_Clocked] = []
    refusal = ""
    for boot in log.boots:
        if boot.positions is None:
            continue
        try:
            clock, messages = fit_clock(boot)
        except UavgramError as error:
            refusal = str(error)
            continue
        found.append(_Clocked(boot, clock, messages))
    if not found:
        raise UavgramError(f"{log.path}: {refusal or 'no boot of the log has positions'}")
    return found


def _by_order(
    photos: Photos, usable: list[_Clocked], options: TimeOptions
) -> tuple[_Clocked, _Timing]:
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
    return chosen, _Timing(
        time,
        np.full(count, _EVENT_JITTER_S),
        0.0,
        min(options.offset_sigma_s, chosen.lag_sigma_s()),
        (Message("info", "time-by-order", text),),
    )


def _confirmed(boot: Boot) -> int:
    return 0 if boot.events is None else int((boot.events.confirmed > 0).sum())


def _by_alignment(
    photos: Photos, usable: list[_Clocked], options: TimeOptions
) -> tuple[_Clocked, _Timing]:
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
    return chosen, _Timing(
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
    photos: Photos, chosen: _Clocked, alignment: Alignment, options: TimeOptions, timed: Bools
) -> _Timing:
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
    return _Timing(
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


def _by_offset(
    photos: Photos, usable: list[_Clocked], options: TimeOptions, offset_s: float
) -> tuple[_Clocked, _Timing]:
    """A stated offset; coarse file times take the time of the event that they belong to."""
    time = photos.file_time_s - offset_s
    inside = [_inside(time, c) for c in usable]
    most = int(np.argmax([int(mask.sum()) for mask in inside]))
    chosen = usable[most]
    if not inside[most].any():
        raise UavgramError(_another_day(time, usable))
    sigma = float(np.hypot(options.offset_sigma_s, chosen.clock.sigma_s))
    plain = _Timing(time, _file_sigma_s(photos), offset_s, sigma)
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
        return chosen, _Timing(time, plain.sigma_time_s, offset_s, sigma, (remark,))
    text = (
        f"file times are in steps of {resolution:g} s: {_pairs(alignment)} photos took the time "
        f"of their camera event (camera clock minus UTC {alignment.offset_s:+.3f} s)"
    )
    snapped = _event_timing(photos, chosen, alignment, options, timed)
    return chosen, _Timing(
        snapped.time_utc_s,
        snapped.sigma_time_s,
        snapped.offset_s,
        snapped.offset_sigma_s,
        (Message("info", "time-aligned", text),),
    )


def _inside(time_utc_s: Floats, clocked: _Clocked) -> Bools:
    first, last = clocked.span_utc_s()
    return np.asarray((time_utc_s >= first) & (time_utc_s <= last))  # NaN compares False


def _another_day(time_utc_s: Floats, usable: list[_Clocked]) -> str:
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


def _frames(photos: Photos, chosen: _Clocked, timing: _Timing) -> Frames:
    """Frames with the reason why one has no place in the log."""
    positions = chosen.boot.positions
    logged = np.zeros(0) if positions is None else to_utc(chosen.clock, positions.time_boot_s)
    time = timing.time_utc_s
    known = np.isfinite(time)
    inside = _inside(time, chosen)
    gap = np.full(len(time), np.inf)
    gap[known] = _to_nearest(time[known], logged)
    matched = inside & (gap <= LONGEST_GAP_S)
    first, last = chosen.span_utc_s()
    reasons = []
    for k in range(len(time)):
        if matched[k]:
            reasons.append("")
        elif not known[k]:
            reasons.append("no capture time in the file")
        elif not inside[k]:
            reasons.append(_outside(float(time[k]), first, last))
        else:
            reasons.append(f"the log has a gap here: its nearest position is {gap[k]:.1f} s away")
    return Frames(
        frame_id=photos.frame_id,
        time_utc_s=time,
        sigma_time_s=np.where(known, timing.sigma_time_s, np.nan),
        matched=matched,
        reason=tuple(reasons),
        clock_offset_s=timing.offset_s,
        clock_offset_sigma_s=timing.offset_sigma_s,
    )


def _outside(time: float, first: float, last: float) -> str:
    if time < first:
        return f"taken {first - time:.1f} s before the log begins ({as_text(time)})"
    return f"taken {time - last:.1f} s after the log ends ({as_text(time)})"


def _to_nearest(time: Floats, samples: Floats) -> Floats:
    """(F,) distance to the nearest sample."""
    if not len(samples):
        return np.full(len(time), np.inf)
    right = np.clip(np.searchsorted(samples, time), 0, len(samples) - 1)
    left = np.maximum(right - 1, 0)
    return np.minimum(np.abs(samples[right] - time), np.abs(time - samples[left]))


def _unmatched_messages(frames: Frames) -> tuple[Message, ...]:
    return tuple(
        Message("warning", "frame-unmatched", f"{frame}: {reason}")
        for frame, reason in zip(frames.frame_id, frames.reason, strict=True)
        if reason
    )
