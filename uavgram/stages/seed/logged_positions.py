"""Positions of photos from a log without vehicle attitudes."""

from __future__ import annotations

import numpy as np

from uavgram.errors import UavgramError
from uavgram.estimation.clocks.clock_line import to_utc
from uavgram.model.flight_log import Boot, BootClock
from uavgram.model.frames import Frames, PhotoPoses
from uavgram.stages.seed.photo_exposures import HORIZONTAL_SIGMA_M, VERTICAL_SIGMA_M

EARTH_M = 6.371e6
"""Radius of the earth [m], for speeds."""


def compute_positions(frames: Frames, boot: Boot, clock: BootClock) -> PhotoPoses:
    """Interpolate the log's positions at the matched frames, without attitudes.

    The error of each photo is independent within the uncertainty of its instant, as poses of photos
    have no clock: the common offset is treated as an error of each.

    Parameters
    ----------
    frames
        Frames at their instants.
    boot, clock
        The boot of the photos, and its line to UTC.

    Raises
    ------
    UavgramError
        The log has fewer than two positions.
    """
    positions = boot.positions
    if positions is None or len(positions.time_boot_s) < 2:
        raise UavgramError("the log has fewer than two positions: it cannot place photos")
    rows = np.flatnonzero(frames.matched)
    instant, logged = frames.time_utc_s[rows], to_utc(clock, positions.time_boot_s)

    columns = positions.latitude_deg, positions.longitude_deg, positions.height_m
    latitude, longitude, height = (np.interp(instant, logged, column) for column in columns)
    # Velocity by differences, for the error from the uncertain instant.
    north = EARTH_M * np.gradient(np.radians(positions.latitude_deg), logged)
    east = EARTH_M * np.gradient(np.radians(positions.longitude_deg), logged)
    east *= np.cos(np.radians(positions.latitude_deg))
    climb = np.interp(instant, logged, np.abs(np.gradient(positions.height_m, logged)))
    speed = np.interp(instant, logged, np.hypot(east, north))
    sigma_s = np.hypot(np.nan_to_num(frames.sigma_time_s[rows]), frames.clock_offset_sigma_s)
    return PhotoPoses(
        frame_id=tuple(frames.frame_id[k] for k in rows),
        latitude_deg=latitude,
        longitude_deg=longitude,
        height_m=height,
        height_home_m=np.interp(instant, logged, positions.height_home_m),
        datum=positions.datum,
        time_utc_s=instant,
        sigma_horizontal_m=np.hypot(HORIZONTAL_SIGMA_M, speed * sigma_s),
        sigma_vertical_m=np.hypot(VERTICAL_SIGMA_M, climb * sigma_s),
        source=f"The log ({positions.source})",
    )
