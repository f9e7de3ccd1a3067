"""Common reader of OpenDroneMap's text files: a coordinate system, then lines of coordinates."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from pyproj import CRS, Transformer
from pyproj.exceptions import CRSError

from uavgram.errors import InputError
from uavgram.geometry.earth.geodesy import AXES_EXCHANGED, Origin, are_axes_exchanged, within_area
from uavgram.input_files import read_text
from uavgram.model.arrays import Floats
from uavgram.model.flight.log import HeightDatum

_UTM = re.compile(r"WGS84\s+UTM\s+([0-9]{1,2})\s*([NS])", re.IGNORECASE)
_X_FIRST = "x (longitude, east) comes first"
_EPSG = re.compile(r"EPSG\s*:?\s*([0-9]+)", re.IGNORECASE)
# Names that occur in first lines and that PROJ does not know: Poland's systems of 1992 and 2000
# (its zones 5 to 8), Sweden's, Switzerland's old and new, Britain's grid.
_NAMED = {
    "PUWG1992": 2180,
    "PL1992": 2180,
    "PUWG2000Z5": 2176,
    "PUWG2000Z6": 2177,
    "PUWG2000Z7": 2178,
    "PUWG2000Z8": 2179,
    "WGS84": 4326,
    "SWEREF99TM": 3006,
    "CH1903": 21781,
    "CH1903+": 2056,
    "OSGB36": 27700,
}


def read_content_lines(path: Path, wanted: str) -> list[tuple[int, str]]:
    """Read number and text of the lines with content; comments begin with #.

    Raises
    ------
    InputError
        The file cannot be read, is not text, or has no line but the first.
    """
    text = read_text(path, "save it as UTF-8")
    lines = [(k, line.strip()) for k, line in enumerate(text.splitlines(), 1)]
    lines = [(k, line) for k, line in lines if line and not line.startswith("#")]
    if len(lines) < 2:
        raise InputError(path, f"needs a coordinate system (EPSG:4326), then {wanted}")
    return lines


def parse_crs(path: Path, line: int, header: str) -> CRS:
    """Parse the coordinate system in the first line of a file.

    Parameters
    ----------
    path, line
        The file, and the number of that line, for messages.
    header
        Its text: ``EPSG:4326``, ``WGS84 UTM 16N``, a PROJ text, or a name that PROJ knows.

    Raises
    ------
    InputError
        It is not a coordinate system.
    """
    utm = _UTM.fullmatch(header)
    if utm is not None:
        zone, south = int(utm[1]), utm[2].upper() == "S"
        header = f"EPSG:{(32700 if south else 32600) + zone}"
    elif epsg := _EPSG.fullmatch(header):
        header = f"EPSG:{epsg[1]}"
    else:
        code = _NAMED.get(re.sub(r"[\s/_-]", "", header).upper())
        header = header if code is None else f"EPSG:{code}"
    try:
        return CRS.from_user_input(header)
    except CRSError as fault:
        raise InputError(
            path,
            f"{header!r} is no coordinate system: the first line must be such as EPSG:4326, a "
            "PROJ text (+proj=utm +zone=16), or WGS84 UTM 16N; epsg.io knows the number of others",
            line,
        ) from fault


def height_datum(crs: CRS, heights: HeightDatum) -> tuple[HeightDatum, str]:
    """Return the height datum: the geoid of a compound system, the ellipsoid of a 3-D one.

    For other systems it is the given one, with a note on this assumption.
    """
    if crs.is_compound:
        return "msl", ""
    if len(crs.axis_info) == 3:
        return "ellipsoid", ""
    return heights, f"{crs.name} has no heights; world.heights was taken"


def convert_to_geodetic(
    path: Path, crs: CRS, xyz: Floats, line: Sequence[int], site: Origin | None = None
) -> tuple[Floats, Floats]:
    """Convert coordinates to latitude and longitude (N,) [deg].

    Parameters
    ----------
    path
        The file, for messages.
    crs
        Coordinate system of the coordinates.
    xyz
        (N, 2 or more) in its units, x (longitude, east) first.
    line
        (N,) line of each in the file.
    site
        Place of the photos; None: unknown.

    Raises
    ------
    InputError
        Names the line of an impossible place, and of one that is far from the photos but near them
        with x and y exchanged; without a site the same test uses the system's area of use.
    """
    flat = crs.to_2d() if not crs.is_compound else crs.sub_crs_list[0]
    to_wgs84 = Transformer.from_crs(flat, "EPSG:4326", always_xy=True)
    longitude, latitude = (np.asarray(v) for v in to_wgs84.transform(xyz[:, 0], xyz[:, 1]))
    turned_longitude, turned_latitude = to_wgs84.transform(xyz[:, 1], xyz[:, 0])
    if site is None:
        exchanged = within_area(flat, turned_latitude, turned_longitude)
        exchanged &= ~within_area(flat, latitude, longitude) & flat.is_projected
        what = f"is outside {crs.name}, and inside with x and y exchanged"
    else:
        exchanged = are_axes_exchanged(
            (latitude, longitude), (turned_latitude, turned_longitude), site
        )
        what = AXES_EXCHANGED
    if exchanged.any():
        text = f"{what}: {_X_FIRST}"
        raise InputError.of_all(path, [(line[k], text) for k in np.flatnonzero(exchanged).tolist()])
    # inf where a projection has no inverse there; compares False
    inside = (np.abs(latitude) <= 90) & (np.abs(longitude) <= 360)
    if not inside.all():
        k = int(np.flatnonzero(~inside)[0])
        raise InputError(
            path,
            f"({xyz[k, 0]:g}, {xyz[k, 1]:g}) is no place in {crs.name}: {_X_FIRST}",
            line[k],
        )
    return latitude, longitude
