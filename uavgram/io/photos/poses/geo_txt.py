"""OpenDroneMap's geo.txt: first the coordinate system, then a line for each photo.

``name x y [z] [yaw pitch roll] [horizontal and vertical accuracy] [anything]``, angles as nadir
angles in degrees, all zero where unknown (docs.opendronemap.org, "Image Geolocation Files").
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from uavgram.errors import InputError
from uavgram.geometry.earth.geodesy import Origin
from uavgram.geometry.motion.nadir_angles import gimbal_from_nadir
from uavgram.io.tables.csv_tables import parse_number
from uavgram.io.tables.odm_coordinates import content_lines, crs_of_header, geodetic, height_datum
from uavgram.model.flight.log import HeightDatum
from uavgram.model.flight.photo_poses import PhotoPoses
from uavgram.model.message import Message

_COUNTS = (4, 7, 9)  # cells with name: to the height, to the angles, to the accuracies


@dataclass(frozen=True)
class _Row:
    line: int
    name: str
    xyz: tuple[float, float, float]
    angles: tuple[float, float, float]
    sigmas: tuple[float, float]


def read_geo_txt(
    path: str | Path, heights: HeightDatum, site: Origin | None = None
) -> tuple[PhotoPoses, tuple[Message, ...]]:
    """Read a geo.txt.

    Parameters
    ----------
    path
        The file.
    heights
        Datum of its heights where its coordinate system names none.
    site
        Where the photos were taken by their own tags; None: they state no place.

    Raises
    ------
    InputError
        Names file and line of every mistake: an unknown coordinate system, text for a number, a
        line without height, a photo that stands twice, a place outside the earth, and one that is
        at the site only with x and y exchanged.
    """
    path = Path(path)
    lines = content_lines(path, "a line for each photo")
    crs = crs_of_header(path, *lines[0])
    rows = _rows(path, lines[1:])
    datum, guess = height_datum(crs, heights)
    xyz = np.array([row.xyz for row in rows])
    latitude, longitude = geodetic(path, crs, xyz, [row.line for row in rows], site)
    nadir = np.radians([row.angles for row in rows])
    messages: tuple[Message, ...] = ()
    if not nadir.any():  # what the format says for "not available"
        nadir = np.full_like(nadir, np.nan)
        text = f"{path.name}: all angles are zero, which stands for unknown"
        messages = (Message("info", "geo-without-angles", text),)
    sigmas = np.array([row.sigmas for row in rows])
    sigmas = np.where(sigmas > 0, sigmas, np.nan)
    poses = PhotoPoses(
        frame_id=tuple(row.name for row in rows),
        latitude_deg=latitude,
        longitude_deg=longitude,
        height_m=xyz[:, 2],
        datum=datum,
        datum_guess=guess,
        ypr_rad=gimbal_from_nadir(nadir),
        sigma_horizontal_m=sigmas[:, 0],
        sigma_vertical_m=sigmas[:, 1],
        source="geo.txt",
    )
    return poses, messages


def _rows(path: Path, lines: list[tuple[int, str]]) -> list[_Row]:
    rows: list[_Row] = []
    faults: list[tuple[int | None, str]] = []
    seen: dict[str, int] = {}
    for line, text in lines:
        name, *cells = text.split()
        count = max((n for n in _COUNTS if n <= len(cells) + 1), default=0)
        numbers = [parse_number(cell) for cell in cells[: count - 1]]
        good = [value for value in numbers if value is not None]
        if not count:
            faults.append((line, f"{name!r} has no height: a pose needs name, x, y and z"))
        elif len(good) < len(numbers):
            faults.append((line, f"must be a number (got {cells[numbers.index(None)]!r})"))
        elif name in seen:
            faults.append((line, f"{name!r} stands in line {seen[name]} already: keep one"))
        else:
            good += [0.0] * (8 - len(good))
            rows.append(
                _Row(line, name, (good[0], good[1], good[2]), (*good[3:6],), (*good[6:8],))  # type: ignore[arg-type]
            )
        seen.setdefault(name, line)
    if faults:
        raise InputError.of_all(path, faults)
    return rows
