"""Instants of photos from tie points, for a camera clock without camera events in the log."""

from __future__ import annotations

import numpy as np

from uavgram.errors import UavgramError
from uavgram.estimation.clocks.clock_line import to_boot
from uavgram.estimation.clocks.tied_clock import TiedClock, estimate_tied_clock
from uavgram.estimation.first_poses.tied.bundle import TiedPoses, compute_rays, level_scene
from uavgram.estimation.first_poses.tied.tied_poses import estimate_tied_poses
from uavgram.geometry.geodesy import enu_from_geodetic
from uavgram.geometry.motion.interpolation import interpolate_rotation
from uavgram.geometry.motion.rotation import ENU_FROM_NED
from uavgram.model.arrays import Floats, Ints
from uavgram.model.camera import Calibration
from uavgram.model.frames import Photos
from uavgram.model.message import Message
from uavgram.model.options import TimeOptions
from uavgram.model.survey import TiePicks
from uavgram.stages.synchronise.boots import ClockedBoot
from uavgram.stages.synchronise.event_times import HOW, Timing, file_sigma_s
from uavgram.stages.tie_chains import find_ties

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
        f"The camera's clock is {clock.offset_s:+.2f} +- {sigma:.2f} s ahead of UTC: so the log's "
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
        time = to_boot(clock, time_utc_s)
        at = np.stack([np.interp(time, positions.time_boot_s, axis) for axis in world.T], axis=1)
        body, _ = interpolate_rotation(attitudes.time_boot_s, attitudes.ned_from_body_xyzw, time)
        return at, ENU_FROM_NED @ body

    poses = tied.center[rows], tied.rotation[rows]
    return estimate_tied_clock(poses, photos.file_time_s[rows], flown, clocked.span_utc_s())
