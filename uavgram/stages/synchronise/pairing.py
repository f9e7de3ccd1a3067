"""Which photo is which camera event: every pair with its residual, and what stays alone and why."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.clocks.alignment import Alignment
from uavgram.model.arrays import Floats
from uavgram.model.flight.frames import Photos
from uavgram.model.flight.pairing import Pairing, PairStatus
from uavgram.model.message import Message
from uavgram.stages.synchronise.boots import ClockedBoot

_NAMED = 5  # frames that a message names


def pairing_of(photos: Photos, chosen: ClockedBoot, alignment: Alignment) -> Pairing:
    """Spread the alignment of the photos with a file time over all photos and events.

    Parameters
    ----------
    photos
        The photos, with their file times.
    chosen
        The boot that contains the photos.
    alignment
        Of the photos that have a file time, in their order.
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
        return f"{event_utc_s[0] - instant:.1f} s before the first camera event"
    if instant > event_utc_s[-1]:
        return f"{instant - event_utc_s[-1]:.1f} s after the last camera event"
    return f"the nearest camera event is {np.abs(event_utc_s - instant).min():.2f} s away"


def _unused_reasons(event_utc_s: Floats, photo_utc_s: Floats) -> tuple[str, ...]:
    first, last = float(photo_utc_s.min()), float(photo_utc_s.max())
    return tuple(
        "before the first photo" if t < first else "after the last photo" if t > last
        else "between photos"
        for t in event_utc_s
    )  # fmt: skip


def pairing_messages(pairing: Pairing) -> tuple[Message, ...]:
    """What stays alone on either side, and which pairs are in doubt."""
    messages = []
    alone = [k for k, s in enumerate(pairing.status) if s == "none"]
    doubtful = [k for k, s in enumerate(pairing.status) if s in ("crowded", "hidden")]
    if alone:
        text = (
            f"{len(alone)} photos have no camera event of their own, their file times were used "
            f"where they have any: {_named(pairing, alone)}"
        )
        messages.append(Message("warning", "photo-without-event", text))
    if doubtful:
        text = (
            f"{len(doubtful)} photos may belong to another camera event than the one they fell "
            f"on, their file times were used: {_named(pairing, doubtful)}"
        )
        messages.append(Message("warning", "photo-event-uncertain", text))
    if len(pairing.unused_event):
        where = [
            f"{pairing.unused_reason.count(place)} {place}"
            for place in dict.fromkeys(pairing.unused_reason)
        ]
        text = f"{len(pairing.unused_event)} camera events have no photo: {', '.join(where)}"
        messages.append(Message("info", "event-without-photo", text))
    return tuple(messages)


def _named(pairing: Pairing, rows: list[int]) -> str:
    shown = "; ".join(f"{pairing.frame_id[k]} ({pairing.reason[k]})" for k in rows[:_NAMED])
    return shown + (f"; and {len(rows) - _NAMED} more" if len(rows) > _NAMED else "")
