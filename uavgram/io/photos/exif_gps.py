"""The place that a photo's EXIF states (CIPA DC-008, 4.6.6 GPS attribute information)."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from uavgram.geometry.earth.geodesy import Origin
from uavgram.io.photos.exif import exif_numbers, exif_text, read_exif_tags

_MOST_LOOKED_AT = 20  # photos, for the place of all
_ALTITUDE_SIGN = {0: 1.0, 1: -1.0, 2: 1.0, 3: -1.0}


@dataclass(frozen=True)
class ExifPlace:
    """Latitude, longitude [deg] and altitude [m]; NaN where EXIF states none.

    `above_sea` is True where EXIF says so (Exif 3.0, references 2 and 3); the older references 0
    and 1 mean sea level or the ellipsoid, as the maker pleases.
    """

    latitude_deg: float = float("nan")
    longitude_deg: float = float("nan")
    altitude_m: float = float("nan")
    above_sea: bool = False


def read_exif_place(path: str | Path) -> ExifPlace:
    """Read a photo's GPS tags; (0, 0), which stands for "no fix", counts as none.

    Raises
    ------
    InputError
        The file cannot be read.
    """
    tags = read_exif_tags(path)
    latitude = _degrees(tags, "Latitude", "S")
    longitude = _degrees(tags, "Longitude", "W")
    if latitude == 0.0 and longitude == 0.0:
        latitude = longitude = float("nan")
    reference = exif_numbers(tags.get("GPS GPSAltitudeRef"))
    code = int(reference[0]) if reference else 0
    altitude = exif_numbers(tags.get("GPS GPSAltitude"))
    return ExifPlace(
        latitude_deg=latitude,
        longitude_deg=longitude,
        altitude_m=altitude[0] * _ALTITUDE_SIGN.get(code, 1.0) if altitude else float("nan"),
        above_sea=code in (2, 3),
    )


def _degrees(tags: dict[str, Any], name: str, negative: str) -> float:
    """Signed degrees of degrees, minutes, seconds; NaN where a part or the reference is absent."""
    parts = exif_numbers(tags.get(f"GPS GPS{name}"))
    reference = exif_text(tags, f"GPS GPS{name}Ref").upper()
    if len(parts) != 3 or not reference:
        return float("nan")
    size = float(np.dot(parts, [1.0, 1 / 60, 1 / 3600]))
    return -size if reference.startswith(negative) else size


def site_of(paths: Iterable[str | Path]) -> Origin | None:
    """Say where photos were taken, by the first whose EXIF states it; None where none does."""
    for path in islice((path for path in paths if Path(path).is_file()), _MOST_LOOKED_AT):
        place = read_exif_place(path)
        if math.isfinite(place.latitude_deg + place.longitude_deg):
            return place.latitude_deg, place.longitude_deg, 0.0
    return None
