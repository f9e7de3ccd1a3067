"""Instants of photos whose clock is unknown: by alignment with the log's camera events."""

from __future__ import annotations

import numpy as np

from uavgram.errors import UavgramError
from uavgram.estimation.clocks.alignment import Alignment, align
from uavgram.model.flight.frames import Photos
from uavgram.model.message import Message
from uavgram.model.options import TimeOptions
from uavgram.stages.synchronise.boots import ClockedBoot, log_spans, photos_span
from uavgram.stages.synchronise.event_times import Timing, event_timing

_HOW = (
    "Set time.offset_s (camera clock minus UTC, in seconds; compare a photo's time with the "
    "flight), and time.offset_sigma_s to how well it is known"
)


def by_alignment(
    photos: Photos, usable: list[ClockedBoot], options: TimeOptions
) -> tuple[ClockedBoot, Timing]:
    """Offset of the camera's clock from the log's camera events.

    Parameters
    ----------
    photos
        The photos, with their file times.
    usable
        Boots of the log that have a clock, and events where these are needed.
    options
        The project's `time`.

    Raises
    ------
    UavgramError
        The log has no camera events, or they fit the photos under no single offset: the message
        lists the offsets that come into question.
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
            "(camera clock minus UTC, in seconds) and time.offset_sigma_s"
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
        f"camera clock minus UTC is {clock.offset_s:+.4f} +- {clock.offset_sigma_s:.4f} s{drift} "
        f"by {int(paired.sum())} of {photos} photos on a camera event each, {scatter:.3f} s rms "
        f"apart (next best: {_rival(alignment)})"
    )


def _rival(alignment: Alignment) -> str:
    if len(alignment.candidates) < 2:
        return "none"
    other = alignment.candidates[1]
    return f"{other.offset_s:+.3f} s with {other.matched}"


def _ambiguity(alignment: Alignment, photos: int, events: int) -> str:
    listed = ", ".join(
        f"{c.offset_s:+.3f} s ({c.matched} of {photos} photos)" for c in alignment.candidates[:5]
    )
    if alignment.candidates[0].matched < 0.6 * photos:
        return (
            f"time.offset_s is auto, but under no offset of the camera's clock do most of the "
            f"{photos} photos fall on one of the log's {events} camera events (best: {listed}): "
            f"is this the log of another flight? {_HOW}"
        )
    return (
        f"time.offset_s is auto, but {photos} photos fit the log's {events} camera events under "
        f"no single offset of the camera's clock that is clearly best: {listed}. {_HOW}"
    )


def _two_boots(unique: list[Alignment]) -> str:
    listed = " and ".join(f"{a.offset_s:+.3f} s ({a.candidates[0].matched} photos)" for a in unique)
    return (
        f"time.offset_s is auto, but the photos fit the camera events of {len(unique)} flights of "
        f"the log: {listed}. {_HOW}"
    )
