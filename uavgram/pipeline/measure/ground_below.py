"""Height of the ground below photos with only their own positions."""

from __future__ import annotations

import math

import numpy as np

from uavgram.config.project_text import AssumedOrigin
from uavgram.errors import InputError
from uavgram.io.photos.metadata import read_exif_place
from uavgram.io.photos.poses.sources import read_photo_poses
from uavgram.model.flight.frames import Photos
from uavgram.model.flight.log import HeightDatum
from uavgram.stages.seed.photo_exposures import DEFAULT_HEIGHT_M

ABOVE_GROUND_SIGMA_M = 40.0
"""Sigma of `ABOVE_GROUND_M`."""


def ground_below(source: str, photos: Photos) -> AssumedOrigin | None:
    """Assume the ground at a usual distance below the photos; None where no pose can be read.

    Parameters
    ----------
    source
        As `poses` in a project.
    photos
        The project's photos.
    """
    heights: HeightDatum = "msl"
    try:
        poses, _ = read_photo_poses(source, photos, heights)
    except InputError:
        return None
    stated = poses.height_m[np.isfinite(poses.height_m)]
    return AssumedOrigin(
        latitude_deg=float(poses.latitude_deg[0]),
        longitude_deg=float(poses.longitude_deg[0]),
        height_m=float(np.median(stated)) - DEFAULT_HEIGHT_M if stated.size else 0.0,
        height_sigma_m=ABOVE_GROUND_SIGMA_M,
        datum=poses.datum,
    )


def has_place(photos: Photos) -> bool:
    """Return whether any of the photos states a place in EXIF, even without a height."""
    try:
        places = [read_exif_place(path) for path in photos.path]
    except InputError:
        return False
    return any(math.isfinite(place.latitude_deg) for place in places)
