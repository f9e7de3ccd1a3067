"""Frames with their instants, and why one has no place in the log."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.clocks.boot_clock import to_utc
from uavgram.geometry.earth.gps_time import span_text, utc_text
from uavgram.model.arrays import Floats
from uavgram.model.flight.frames import Frames, Photos
from uavgram.model.message import Message, Several
from uavgram.stages.synchronise.boots import ClockedBoot, is_inside
from uavgram.stages.synchronise.event_times import Timing

LONGEST_GAP_S = 1.0  # to the nearest logged position
LOOK = "Look whether it is of this flight, and at time.offset_s."


def placed_frames(photos: Photos, chosen: ClockedBoot, timing: Timing) -> Frames:
    """Frames with the reason why one has no place in the log.

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
    logged = np.zeros(0) if positions is None else to_utc(chosen.clock, positions.time_boot_s)
    time = timing.time_utc_s
    known = np.isfinite(time)
    inside = is_inside(time, chosen)
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
        clock_drift_sigma=timing.drift_sigma,
    )


def _outside(time: float, first: float, last: float) -> str:
    end, how = (first, "before the log begins") if time < first else (last, "after the log ends")
    return f"taken {span_text(abs(time - end))} {how} ({utc_text(time)}, the log {utc_text(end)})"


def _to_nearest(time: Floats, samples: Floats) -> Floats:
    """(F,) distance to the nearest sample."""
    if not len(samples):
        return np.full(len(time), np.inf)
    right = np.clip(np.searchsorted(samples, time), 0, len(samples) - 1)
    left = np.maximum(right - 1, 0)
    return np.minimum(np.abs(samples[right] - time), np.abs(time - samples[left]))


def unmatched_messages(frames: Frames) -> tuple[Message, ...]:
    """One warning for each frame that has no place in the log."""
    return tuple(
        Message(
            "warning",
            "frame-unmatched",
            f"The photo {frame!r} has no place in the log: {reason}. {LOOK}",
            frames=(frame,),
            several=Several("{count} photos have no place in the log", repr(frame), reason, LOOK),
        )
        for frame, reason in zip(frames.frame_id, frames.reason, strict=True)
        if reason
    )
