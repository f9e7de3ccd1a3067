"""Assign each photo its instant: by offset, order or alignment of events, or by tie points.

The log's boot clock is tied to UTC (estimation/clocks/clock_line.py); the photos' clock is tied to
it by a stated offset, or by aligning photos with the log's camera events. Photos are never paired
with events by their order alone, unless both are equally many and the project requests it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from uavgram.errors import UavgramError
from uavgram.estimation.clocks.alignment import Alignment, align
from uavgram.estimation.clocks.clock_line import COARSE_STEP_S, convert_utc_to_boot
from uavgram.estimation.clocks.tied_clock import TiedClock, estimate_tied_clock
from uavgram.estimation.first_poses.tied.bundle import TiedPoses, compute_rays, level_scene
from uavgram.estimation.first_poses.tied.tied_poses import estimate_tied_poses
from uavgram.geometry.geodesy import enu_from_geodetic
from uavgram.geometry.gps_time import DAY_S
from uavgram.geometry.motion.interpolation import interpolate_rotation
from uavgram.geometry.motion.rotation import ENU_FROM_NED
from uavgram.model.arrays import Floats, Ints
from uavgram.model.camera import Calibration
from uavgram.model.flight_log import Boot, BootClock, FlightLog
from uavgram.model.frames import Frames, Pairing, Photos
from uavgram.model.message import Message
from uavgram.model.options import TimeOptions
from uavgram.model.survey import TiePicks
from uavgram.stages.synchronise.event_times import (
    EVENT_JITTER_S,
    HOW,
    ClockedBoot,
    Timing,
    event_timing,
    file_sigma_s,
    has_events,
    is_inside,
    log_spans,
    measure_gap,
    photos_span,
    place_frames,
    report_unmatched,
    usable_boots,
)
from uavgram.stages.tie_chains import find_ties


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
    confirmed = [_count_confirmed(c.boot) for c in usable]
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


def _count_confirmed(boot: Boot) -> int:
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
        raise UavgramError(measure_gap(time, usable)[1])
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
    return chosen, _snap_to_events(photos, chosen, options, plain, reach)


def _snap_to_events(
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
    if not best.unique and not _fits_alone(best, int(timed.sum())):
        raise UavgramError(_ambiguity(best, int(timed.sum()), len(chosen.event_utc_s())))
    message = Message("info", "time-aligned", _describe_alignment(best, len(photos.frame_id)))
    return chosen, event_timing(photos, chosen, best, options, (message,))


def _fits_alone(alignment: Alignment, photos: int) -> bool:
    """Return whether one offset fits all of few photos, and every other one a single photo.

    Any offset can be chosen to fit one photo, so that is no evidence.
    """
    best, *others = (one.matched for one in alignment.candidates)
    return best == photos >= LEAST_PHOTOS and max(others, default=0) <= 1


def _describe_alignment(alignment: Alignment, photos: int) -> str:
    clock = alignment.clock
    drift = ""
    if clock.drifts:
        drift = f", drifting by {clock.drift * 1e6:+.1f} ± {clock.drift_sigma * 1e6:.1f} ppm,"
    paired = alignment.event_index >= 0
    scatter = float(np.sqrt(np.mean(alignment.residual_s[paired] ** 2)))
    return (
        f"Camera clock minus UTC is {clock.offset_s:+.4f} ± {clock.offset_sigma_s:.4f} s{drift} "
        f"by {int(paired.sum())} of {photos} photos on a camera event each, typically "
        f"{scatter:.3f} s apart (next best: {_rival(alignment)})."
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


LEAST_PHOTOS = 3
"""Least number of photos that fit the log's camera events at one offset only."""

MIN_PHOTOS = 6
"""Least number of photos with a time that ties must join: four already have more observations than
unknowns, but with hardly any redundancy."""

MAX_MISFIT = 4.0
"""Largest misfit of photos to a log at the best offset, in sigmas: above, the log is of another
flight."""


def synchronise_by_ties(
    photos: Photos, usable: list[ClockedBoot], options: TimeOptions, tied: TiedPoses | None
) -> tuple[ClockedBoot, Timing]:
    """Estimate the offset of the camera's clock from the relative poses of photos by ties.

    Parameters
    ----------
    photos
        Photos of the project, with their file times.
    usable
        Boots of the log with positions and a clock.
    options
        Requested options.
    tied
        Poses of the photos, in their order, from ties alone; None where these join none.

    Raises
    ------
    UavgramError
        Too few photos are joined, none or several offsets fit: the message lists them.
    """
    level = None if tied is None else level_scene(tied)
    placed = np.zeros(len(photos.frame_id), np.bool_) if level is None else level.placed
    rows = np.flatnonzero(np.isfinite(photos.file_time_s) & placed)
    if level is None or len(rows) < MIN_PHOTOS:
        raise UavgramError(
            f"time.offset_s is auto, the log has no camera events, and tie points join only "
            f"{len(rows)} photos with a time ({MIN_PHOTOS} are needed): {HOW}"
        )
    # Fit the offset of the camera's clock to each boot.
    found = [(clocked, _clock(photos, clocked, level, rows)) for clocked in usable]
    fitting = [(c, clock) for c, clock in found if clock and clock.misfit <= MAX_MISFIT]
    if not fitting:
        raise UavgramError(
            "time.offset_s is auto, the log has no camera events, and its track fits the tie "
            "points of the photos under no offset of the "
            f"camera's clock: is this the log of another flight? {HOW}"
        )
    fitting.sort(key=lambda one: one[1].misfit)
    chosen, clock = fitting[0]
    rivals = [*clock.rival_s, *(other.offset_s for _, other in fitting[1:])]
    if rivals:
        listed = ", ".join(f"{offset:+.1f} s" for offset in [clock.offset_s, *rivals][:4])
        raise UavgramError(
            "time.offset_s is auto, the log has no camera events, and its track fits the tie "
            f"points of the photos under several offsets of the camera's clock: {listed}. {HOW}"
        )
    # Truncation or rounding of file times: root mean square step / sqrt(8).
    sigma = float(np.hypot(clock.sigma_s, np.nanmax(photos.file_time_resolution_s) / np.sqrt(8.0)))
    text = (
        f"The camera's clock is {clock.offset_s:+.2f} ± {sigma:.2f} s ahead of UTC: so the log's "
        f"track fits the tie points of {len(rows)} photos. The log has no camera events for a "
        "better value."
    )
    return chosen, Timing(
        photos.file_time_s - clock.offset_s,
        file_sigma_s(photos),
        clock.offset_s,
        sigma,
        (Message("info", "time-by-ties", text),),
        drift_sigma=options.drift_sigma_ppm * 1e-6,
    )


def poses_of(ties: TiePicks, frame_id: tuple[str, ...], camera: Calibration) -> TiedPoses | None:
    """Compute poses of photos, in their order, from tie points alone; None where these join none.

    Parameters
    ----------
    ties
        Tie points by name.
    frame_id
        Names of the photos.
    camera
        Camera of all photos.
    """
    seen = find_ties(ties, {name: k for k, name in enumerate(frame_id)})
    at, sizes = (seen.frame, seen.point), (len(frame_id), seen.points)
    return estimate_tied_poses(compute_rays(camera, at, seen.pixel_px, seen.sigma_px, sizes)[0])


def _clock(photos: Photos, clocked: ClockedBoot, tied: TiedPoses, rows: Ints) -> TiedClock | None:
    """Estimate the clock from the ties of some photos and one boot; None without a track."""
    boot, clock = clocked.boot, clocked.clock
    positions, attitudes = boot.positions, boot.attitudes
    if positions is None or attitudes is None:
        return None
    low = float(positions.height_m.min())
    origin = (float(positions.latitude_deg[0]), float(positions.longitude_deg[0]), low)
    world = enu_from_geodetic(
        positions.latitude_deg, positions.longitude_deg, positions.height_m, origin
    )

    def flown(time_utc_s: Floats) -> tuple[Floats, Floats]:
        time = convert_utc_to_boot(clock, time_utc_s)
        at = np.stack([np.interp(time, positions.time_boot_s, axis) for axis in world.T], axis=1)
        body, _ = interpolate_rotation(attitudes.time_boot_s, attitudes.ned_from_body_xyzw, time)
        return at, ENU_FROM_NED @ body

    poses = tied.center[rows], tied.rotation[rows]
    return estimate_tied_clock(poses, photos.file_time_s[rows], flown, clocked.span_utc_s())


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
    apart_s, both = measure_gap(photos.file_time_s - known_s, usable)
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
        message = Message("warning", "log-of-another-day", f"By the camera's clock {both}.")
        messages = (message, *messages)
    frames = place_frames(photos, chosen, timing)
    return Synchronised(
        frames=frames,
        boot=chosen.boot,
        clock=chosen.clock,
        messages=(*messages, *report_unmatched(frames)),
        pairing=timing.pairing,
    )
