"""Instants of photos from camera events, and the boots of a log that photos can be matched to.

Sources of the numbers:

* Instant: the time of the event where the pair is certain. Otherwise the photo's own time,
  converted to the log's clock by the fitted offset and drift, so that a wrong event has no effect.
* `sigma_time_s`, the error of a single frame. With an event: the scatter of photos about events, or
  `EVENT_JITTER_S` where file times are too coarse to estimate it. Without an event: the step of the
  file times as a uniform error, the scatter of the shutter, and the sigma of the fitted line.
* `offset_sigma_s`, the error common to all frames: that of the fitted offset and that of the lag
  between event and exposure (`ClockedBoot.lag_sigma_s`), which no alignment can determine; at most
  the project's `offset_sigma_s`. The error of the boot clock against UTC is not included, as events
  and positions share it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from uavgram.errors import UavgramError
from uavgram.estimation.clocks.alignment import Alignment
from uavgram.estimation.clocks.clock_line import COARSE_STEP_S, convert_boot_to_utc, fit_boot_clock
from uavgram.geometry.gps_time import DAY_S, span_text, utc_text
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.flight_log import Boot, BootClock, FlightLog
from uavgram.model.frames import Frames, Pairing, PairStatus, Photos
from uavgram.model.message import Message, MessagePlural
from uavgram.model.options import TimeOptions

# From the event to the exposure, common to all frames: small behind a feedback pin, unknown
# behind a command (86 to 147 ms were measured in ArduPilot's simulator).
_FEEDBACK_LAG_SIGMA_S = 0.02
_COMMAND_LAG_SIGMA_S = 0.1


@dataclass(frozen=True, eq=False)
class ClockedBoot:
    """Usable boot: with positions and a clock."""

    boot: Boot
    clock: BootClock
    messages: tuple[Message, ...]

    def event_rows(self) -> Ints:
        """Return rows (E,) of the camera events: those with feedback where the log has any."""
        events = self.boot.events
        if events is None:
            return np.zeros(0, dtype=np.int64)
        confirmed = events.confirmed > 0
        return np.flatnonzero(confirmed if confirmed.any() else ~confirmed)

    def event_utc_s(self) -> Floats:
        """Return the instants (E,) of these events."""
        events = self.boot.events
        if events is None:
            return np.zeros(0)
        return convert_boot_to_utc(self.clock, events.time_boot_s[self.event_rows()])

    def span_utc_s(self) -> tuple[float, float]:
        """Return the interval in which position and attitude are both known."""
        tables = [t for t in (self.boot.positions, self.boot.attitudes) if t is not None]
        ends = np.array([convert_boot_to_utc(self.clock, t.time_boot_s[[0, -1]]) for t in tables])
        return float(ends[:, 0].max()), float(ends[:, 1].min())

    def lag_sigma_s(self) -> float:
        """Return the sigma of the common lag of exposures after their events."""
        events = self.boot.events
        feedback = events is not None and events.instant == "feedback"
        return _FEEDBACK_LAG_SIGMA_S if feedback else _COMMAND_LAG_SIGMA_S


NO_POSITIONS = (
    "the log has no positions, so it cannot place photos: use another one, or leave `log` out to "
    "measure by known lengths alone"
)


def usable_boots(log: FlightLog) -> list[ClockedBoot]:
    """Return boots with positions and UTC."""
    found: list[ClockedBoot] = []
    refusal = ""
    for boot in log.boots:
        if boot.positions is None:
            continue
        try:
            clock, messages = fit_boot_clock(boot)
        except UavgramError as error:
            refusal = str(error)
            continue
        found.append(ClockedBoot(boot, clock, messages))
    if not found:
        raise UavgramError(refusal or NO_POSITIONS)
    return found


def has_events(log: FlightLog) -> bool:
    """Return whether the log has camera events."""
    return any(boot.events is not None and len(boot.events.time_boot_s) for boot in log.boots)


def is_inside(time_utc_s: Floats, clocked: ClockedBoot) -> Bools:
    """Mark instants (F,) at which position and attitude are both known."""
    first, last = clocked.span_utc_s()
    return np.asarray((time_utc_s >= first) & (time_utc_s <= last))  # NaN compares False


def photos_span(time_s: Floats) -> str:
    """Describe first and last of the photos' instants; NaN is left out."""
    return f"{utc_text(float(np.nanmin(time_s)))} to {utc_text(float(np.nanmax(time_s)))}"


def log_spans(usable: list[ClockedBoot]) -> str:
    """Describe the intervals in which each boot has position and attitude."""
    spans = (clocked.span_utc_s() for clocked in usable)
    return " and ".join(f"{utc_text(first)} to {utc_text(last)}" for first, last in spans)


def measure_gap(time_utc_s: Floats, usable: list[ClockedBoot]) -> tuple[float, str]:
    """Compute the time between photos and log [s], and describe both intervals.

    Parameters
    ----------
    time_utc_s
        (F,) known instants of the photos; NaN where a file has none.
    usable
        Boots of the log.
    """
    if not np.isfinite(time_utc_s).any():
        return 0.0, ""
    middle_s, spans = float(np.nanmedian(time_utc_s)), [each.span_utc_s() for each in usable]
    apart_s = min((middle_s - begin for begin, _ in spans), key=abs)
    about = f"{apart_s:+.0f} s ({apart_s / 3600:+.2f} h)"
    about = about if abs(apart_s) < DAY_S else f"{apart_s / DAY_S:+.0f} days"
    return apart_s, (
        f"no photo is from this flight: the photos were taken {photos_span(time_utc_s)} (file "
        f"times less time.offset_s), the log runs from {log_spans(usable)}. Is it the log of "
        f"another flight, or is the camera's clock wrong by about {about}? Then set time.offset_s"
    )


HOW = (
    "Set time.offset_s (camera clock minus UTC, in seconds; compare a photo's time with the "
    "flight), and time.offset_sigma_s to how well it is known"
)
EVENT_JITTER_S = 0.01  # of a shutter after its event; one step of ArduPilot's 50 Hz loop is 0.02 s
_LEAST_JITTER_S = 0.002  # no steadier shutter was observed
_MOST_JITTER_S = 0.1


@dataclass(frozen=True, eq=False)
class Timing:
    """Instants of F photos and their source, without regard to the log's span.

    `drift_sigma` is that of the camera's clock where the instants are its own (0 where they are
    those of camera events, which are on the flight's clock).
    """

    time_utc_s: Floats
    sigma_time_s: Floats
    offset_s: float
    offset_sigma_s: float
    messages: tuple[Message, ...] = ()
    pairing: Pairing | None = None
    drift_sigma: float = 0.0


def event_timing(
    photos: Photos,
    chosen: ClockedBoot,
    alignment: Alignment,
    options: TimeOptions,
    messages: tuple[Message, ...],
) -> Timing:
    """Take event times where the pair is certain, and the photos' own times elsewhere.

    Parameters
    ----------
    photos
        F photos, some perhaps without a file time.
    chosen
        The boot with whose events they were aligned.
    alignment
        Alignment of the photos that have a file time; unique.
    options
        Options; `offset_sigma_s` limits the common sigma.
    messages
        Messages to precede those about the pairs.
    """
    timed = np.flatnonzero(np.isfinite(photos.file_time_s))
    event_utc = chosen.event_utc_s()
    time, sigma = np.full(len(photos.frame_id), np.nan), np.full(len(photos.frame_id), np.nan)
    certain = alignment.certain
    # Photos' own times by the fitted line; sigma of step, line and shutter together.
    line_sigma = alignment.clock.sigma_at(alignment.photo_event_s)
    time[timed] = alignment.photo_event_s
    sigma[timed] = np.linalg.norm(
        [file_sigma_s(photos)[timed], line_sigma, np.full(len(timed), alignment.clock.scatter_s)],
        axis=0,
    )
    # Certain pairs take the time of their events.
    time[timed[certain]] = event_utc[alignment.event_index[certain]]
    sigma[timed[certain]] = _jitter_s(photos, alignment)
    common = float(np.hypot(alignment.clock.offset_sigma_s, chosen.lag_sigma_s()))
    pairing = pairing_of(photos, chosen, alignment)
    return Timing(
        time,
        sigma,
        alignment.clock.offset_s,
        min(options.offset_sigma_s, common),
        (*messages, *pairing_messages(pairing)),
        pairing,
    )


def _jitter_s(photos: Photos, alignment: Alignment) -> float:
    """Return the sigma of an exposure about its event."""
    if float(np.nanmax(photos.file_time_resolution_s)) > COARSE_STEP_S:
        return EVENT_JITTER_S
    return float(np.clip(alignment.clock.scatter_s, _LEAST_JITTER_S, _MOST_JITTER_S))


def file_sigma_s(photos: Photos) -> Floats:
    """Return the sigma (F,) of file times: step (uniform: step / sqrt(12)) and camera jitter."""
    return np.asarray(np.maximum(photos.file_time_resolution_s / np.sqrt(12), _LEAST_JITTER_S))


_NAMED = 5  # frames that a message names


def pairing_of(photos: Photos, chosen: ClockedBoot, alignment: Alignment) -> Pairing:
    """Extend the alignment of the photos with a file time to all photos and events.

    Parameters
    ----------
    photos
        Photos of the project, with their file times.
    chosen
        The boot of the photos.
    alignment
        Alignment of the photos that have a file time with the camera events of that boot.
    """
    count = len(photos.frame_id)
    timed = np.flatnonzero(np.isfinite(photos.file_time_s))
    rows, event_utc = chosen.event_rows(), chosen.event_utc_s()
    paired = alignment.event_index >= 0
    event, residual = np.full(count, -1, dtype=np.int64), np.full(count, np.nan)
    event[timed[paired]] = rows[alignment.event_index[paired]]
    residual[timed] = alignment.residual_s
    status: list[PairStatus] = ["none"] * count
    reason = ["no capture time in the file"] * count
    for k, code, instant in zip(timed, alignment.status, alignment.photo_event_s, strict=True):
        status[k] = code
        reason[k] = _photo_reason(code, float(instant), event_utc)
    unused = np.setdiff1d(np.arange(len(rows)), alignment.event_index[paired])
    return Pairing(
        frame_id=photos.frame_id,
        event_index=event,
        residual_s=residual,
        status=tuple(status),
        reason=tuple(reason),
        unused_event=rows[unused],
        unused_reason=_unused_reasons(event_utc[unused], alignment.photo_event_s),
        drift=alignment.clock.drift,
        drift_sigma=alignment.clock.drift_sigma,
    )


def _photo_reason(status: PairStatus, instant: float, event_utc_s: Floats) -> str:
    if status == "certain":
        return ""
    if status == "crowded":
        return "another event, or another photo of the same event, comes into question"
    if status == "hidden":
        return "its own event may be missing from the log beside the one it fell on"
    if instant < event_utc_s[0]:
        return f"{span_text(event_utc_s[0] - instant)} before the first camera event"
    if instant > event_utc_s[-1]:
        return f"{span_text(instant - event_utc_s[-1])} after the last camera event"
    return f"the nearest camera event is {np.abs(event_utc_s - instant).min():.2f} s away"


def _unused_reasons(event_utc_s: Floats, photo_utc_s: Floats) -> tuple[str, ...]:
    first, last = float(photo_utc_s.min()), float(photo_utc_s.max())
    return tuple(
        "before the first photo" if t < first else "after the last photo" if t > last
        else "between photos"
        for t in event_utc_s
    )  # fmt: skip


def pairing_messages(pairing: Pairing) -> Iterator[Message]:
    """Report unpaired photos and events, and uncertain pairs."""
    alone = [k for k, s in enumerate(pairing.status) if s == "none"]
    doubtful = [k for k, s in enumerate(pairing.status) if s in ("crowded", "hidden")]
    if alone:
        text = (
            f"{len(alone)} photos have no camera event of their own in the log: "
            f"{_join_reasons(pairing, alone)}. Their file times were used, where they have any: "
            f"look "
            "whether photos or log are of another flight."
        )
        yield Message("warning", "photo-without-event", text, frames=_frames(pairing, alone))
    if doubtful:
        text = (
            f"{len(doubtful)} photos may belong to another camera event than the one they fell "
            f"on: {_join_reasons(pairing, doubtful)}. Their file times were used. `uavgram check` "
            f"shows "
            "each photo with its event."
        )
        frames = _frames(pairing, doubtful)
        yield Message("warning", "photo-event-uncertain", text, frames=frames)
    if len(pairing.unused_event):
        where = [
            f"{pairing.unused_reason.count(place)} {place}"
            for place in dict.fromkeys(pairing.unused_reason)
        ]
        count = len(pairing.unused_event)
        events = "1 camera event has" if count == 1 else f"{count} camera events have"
        text = f"{events} no photo: {', '.join(where)}."
        yield Message("info", "event-without-photo", text)


def _frames(pairing: Pairing, rows: list[int]) -> tuple[str, ...]:
    return tuple(pairing.frame_id[k] for k in rows)


def _join_reasons(pairing: Pairing, rows: list[int]) -> str:
    shown = "; ".join(f"{pairing.frame_id[k]} ({pairing.reason[k]})" for k in rows[:_NAMED])
    return shown + (f"; and {len(rows) - _NAMED} more" if len(rows) > _NAMED else "")


LONGEST_GAP_S = 1.0  # to the nearest logged position
LOOK = "Check whether it is of this flight, and time.offset_s."


def place_frames(photos: Photos, chosen: ClockedBoot, timing: Timing) -> Frames:
    """Return frames, with the reason where one has no place in the log.

    Parameters
    ----------
    photos
        The photos, with their file times.
    chosen
        The boot that contains the photos.
    timing
        Instants of all photos.
    """
    positions = chosen.boot.positions
    logged = (
        np.zeros(0)
        if positions is None
        else convert_boot_to_utc(chosen.clock, positions.time_boot_s)
    )
    time = timing.time_utc_s
    known = np.isfinite(time)
    inside = is_inside(time, chosen)
    gap = np.full(len(time), np.inf)
    gap[known] = _compute_sample_distance(time[known], logged)
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
        clock_drift_sigma=timing.drift_sigma,
    )


def _outside(time: float, first: float, last: float) -> str:
    end, how = (first, "before the log begins") if time < first else (last, "after the log ends")
    return f"taken {span_text(abs(time - end))} {how} ({utc_text(time)}, the log {utc_text(end)})"


def _compute_sample_distance(time: Floats, samples: Floats) -> Floats:
    """Return the distance (F,) to the nearest sample."""
    if not len(samples):
        return np.full(len(time), np.inf)
    right = np.clip(np.searchsorted(samples, time), 0, len(samples) - 1)
    left = np.maximum(right - 1, 0)
    return np.minimum(np.abs(samples[right] - time), np.abs(time - samples[left]))


def report_unmatched(frames: Frames) -> tuple[Message, ...]:
    """Report each frame that has no place in the log."""
    return tuple(
        Message(
            "warning",
            "frame-unmatched",
            f"The photo {frame!r} has no place in the log: {reason}. {LOOK}",
            frames=(frame,),
            several=MessagePlural(
                "{count} photos have no place in the log", repr(frame), reason, LOOK
            ),
        )
        for frame, reason in zip(frames.frame_id, frames.reason, strict=True)
        if reason
    )
