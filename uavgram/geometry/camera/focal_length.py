"""Focal lengths in pixels by what EXIF says: of the sensor's resolution, of a 35 mm frame."""

from __future__ import annotations

import math

from uavgram.geometry.camera.facts import FRAME_35MM_DIAGONAL_MM
from uavgram.model.camera.tags import CameraTags

_SAME_SHAPE = 0.01  # of width / height: else a part was cut off, and nobody says how much
_SAME_STEP = 0.05  # of both resolutions: pixels are square
_SENSORS_MM = (1.0, 100.0)  # of the long side: others are a wrong unit

_LARGEST_SHAPE = 1.51  # wider than 3:2: a strip of some sensor


def focal_plane_px(tags: CameraTags) -> tuple[float, float]:
    """Focal length in pixels of this photo, and what its two axes leave unsure, as a share.

    The resolution counts pixels of the photo as it was taken (CIPA DC-008): a copy of another size
    has another focal length, by the ratio of the sizes. Where EXIF does not state the original's
    size, this photo is taken for the original.

    Returns
    -------
    NaN, NaN where EXIF states no such resolution, an impossible one, or one for another shape.
    """
    unknown = math.nan, math.nan
    across, down = tags.focal_plane_per_mm
    long, short = sorted((tags.width_px, tags.height_px), reverse=True)
    first, second = sorted(_original(tags), reverse=True)
    if not all(map(math.isfinite, (across, down, tags.focal_mm))) or tags.digital_zoom > 1:
        return unknown
    apart = abs(across / down - 1)
    is_whole = abs(long / short / (first / second) - 1) <= _SAME_SHAPE
    per_mm = math.sqrt(across * down)
    if apart > _SAME_STEP or not is_whole or not _SENSORS_MM[0] <= first / per_mm <= _SENSORS_MM[1]:
        return unknown
    return tags.focal_mm * per_mm * long / first, apart / 2


def _original(tags: CameraTags) -> tuple[float, float]:
    width, height = tags.original_px
    if math.isfinite(width) and math.isfinite(height):
        return width, height
    return float(tags.width_px), float(tags.height_px)


def equivalent_focal_px(tags: CameraTags, equivalent_mm: float) -> float:
    """Focal length in pixels, its 35 mm equivalent being over the diagonal of such a frame.

    CIPA DC-008, FocalLengthIn35mmFilm. A photo wider than 3:2 is taken for a strip of a 4:3 sensor
    of its width: so it is in both such cameras at hand.
    """
    width, height = sorted((tags.width_px, tags.height_px), reverse=True)
    diagonal_px = math.hypot(width, width * 3 / 4 if is_strip(tags) else height)
    return equivalent_mm / FRAME_35MM_DIAGONAL_MM * diagonal_px


def is_strip(tags: CameraTags) -> bool:
    """Whether the photo is too wide to be a whole frame of a sensor."""
    width, height = sorted((tags.width_px, tags.height_px), reverse=True)
    return width / height > _LARGEST_SHAPE
