"""Tables of photo poses: OpenDroneMap's geo.txt, DJI's image log (MRK), and CSV.

geo.txt: ``name x y [z] [yaw pitch roll] [horizontal and vertical accuracy] [anything]``, angles as
nadir angles in degrees, all zero where unknown (docs.opendronemap.org, "Image Geolocation Files").

MRK: columns after DJI's manuals (Matrice 4, page 92; Zenmuse P1, page 24): number of the photo, GPS
time of week and week, compensation from antenna to sensor (north, east, down, mm), latitude and
longitude "after compensation", ellipsoidal height, their standard deviations (north, east, up, m),
positioning status. The compensation is included in the coordinates: adding it would apply it twice.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pyproj import CRS, Transformer
from pyproj.exceptions import CRSError

from uavgram.errors import InputError
from uavgram.geometry.geodesy import AXES_EXCHANGED, Origin, are_axes_exchanged, mark_within_area
from uavgram.geometry.gps_time import utc_from_gps
from uavgram.geometry.motion.camera_motion import gimbal_from_nadir
from uavgram.input_files import read_bytes, read_text
from uavgram.io.photos.pose_tags import RTK_FLOOR_HORIZONTAL_M, RTK_FLOOR_VERTICAL_M
from uavgram.io.tables.csv_tables import Columns, Table, parse_number, read_table
from uavgram.model.arrays import Floats, Ints
from uavgram.model.flight_log import HeightDatum
from uavgram.model.frames import PhotoPoses, Photos
from uavgram.model.message import Message
from uavgram.model.naming import format_digits

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
    _check_not_degrees(path, crs, xyz, line)
    flat = crs.to_2d() if not crs.is_compound else crs.sub_crs_list[0]
    to_wgs84 = Transformer.from_crs(flat, "EPSG:4326", always_xy=True)
    longitude, latitude = (np.asarray(v) for v in to_wgs84.transform(xyz[:, 0], xyz[:, 1]))
    turned_longitude, turned_latitude = to_wgs84.transform(xyz[:, 1], xyz[:, 0])
    if site is None:
        exchanged = mark_within_area(flat, turned_latitude, turned_longitude)
        exchanged &= ~mark_within_area(flat, latitude, longitude) & flat.is_projected
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
            f"({format_digits(xyz[k, 0], 6)}, {format_digits(xyz[k, 1], 6)}) is no place in "
            f"{crs.name}: {_X_FIRST}",
            line[k],
        )
    return latitude, longitude


def _check_not_degrees(path: Path, crs: CRS, xyz: Floats, line: Sequence[int]) -> None:
    """Refuse degrees where the file names a coordinate system in metres."""
    small = (np.abs(xyz[:, :2]) <= (360.0, 90.0)).all(axis=1) & (xyz[:, :2] % 1 != 0).any(axis=1)
    if crs.is_projected and small.all():
        text = (
            f"({format_digits(xyz[0, 0], 6)}, {format_digits(xyz[0, 1], 6)}) are degrees, but the "
            f"file names the coordinate system {crs.name}, in metres: write EPSG:4326 there, or "
            "the coordinates in metres"
        )
        raise InputError(path, text, line[0])


_COUNTS = (4, 7, 9)  # cells including the name: up to the height, the angles, the accuracies


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
        Datum of its heights where its coordinate system has none.
    site
        Place of the photos from their own tags; None where they have none.

    Raises
    ------
    InputError
        Names file and line of every mistake: an unknown coordinate system, text for a number, a
        line without height, a photo that occurs twice, a place outside the earth, and one that is
        at the site only with x and y exchanged.
    """
    path = Path(path)
    lines = read_content_lines(path, "a line for each photo")
    crs = parse_crs(path, *lines[0])
    rows = _rows(path, lines[1:])
    datum, guess = height_datum(crs, heights)
    xyz = np.array([row.xyz for row in rows])
    latitude, longitude = convert_to_geodetic(path, crs, xyz, [row.line for row in rows], site)
    nadir = np.radians([row.angles for row in rows])
    messages: tuple[Message, ...] = ()
    if not nadir.any():  # the format's value for "not available"
        nadir = np.full_like(nadir, np.nan)
        text = f"{path.name}: all angles are zero, which means unknown"
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
            faults.append((line, f"{name!r} is already in line {seen[name]}: keep one"))
        else:
            good += [0.0] * (8 - len(good))
            rows.append(
                _Row(line, name, (good[0], good[1], good[2]), (*good[3:6],), (*good[6:8],))  # type: ignore[arg-type]
            )
        seen.setdefault(name, line)
    if faults:
        raise InputError.of_all(path, faults)
    return rows


_NUMBER = r"\s*([-+]?[0-9]+(?:\.[0-9]*)?)\s*"
_LINE = re.compile(
    rf"\s*([0-9]+)\s+{_NUMBER}\[\s*([0-9]+)\s*\]{_NUMBER},\s*N{_NUMBER},\s*E{_NUMBER},\s*V"
    rf"{_NUMBER},\s*Lat{_NUMBER},\s*Lon{_NUMBER},\s*Ellh{_NUMBER},{_NUMBER},{_NUMBER}"
    r"\s+([0-9]+)\s*,\s*Q\s*"
)
# 100_0001_0002.JPG (Phantom 4 RTK), DJI_20230102030405_0002_V.JPG (later ones)
_PHOTO_NUMBER = re.compile(r".*_([0-9]{3,5})(?:_[A-Za-z]+)?")
_NO_POSITION, _FIXED = 0, 50
_LARGEST_TIME_GAP_S = 3.0


@dataclass(frozen=True, eq=False)
class _Rows:
    """Columns of the log; `line` (N,) counts from 1."""

    line: Ints
    number: Ints
    utc_s: Floats
    place: Floats  # (N, 3) latitude, longitude [deg], ellipsoidal height [m]
    sigma_m: Floats  # (N, 3) north, east, up
    quality: Ints


def read_mrk(path: str | Path, photos: Photos) -> tuple[PhotoPoses, tuple[Message, ...]]:
    """Read an image log and join it with the photos by the number in their names.

    Raises
    ------
    InputError
        A line is malformed, a number occurs twice, a photo's name has no number, two photos have
        the same one, or the capture times contradict the join.
    """
    path = Path(path)
    rows = _read_rows(path)
    at = {int(number): k for k, number in enumerate(rows.number)}
    numbers = _photo_numbers(path, photos)
    joined = [(i, at[n]) for i, n in enumerate(numbers) if n in at]
    placed = [(i, k) for i, k in joined if rows.quality[k] != _NO_POSITION]
    if not placed:
        raise InputError(
            path,
            f"has a position for none of the {len(numbers)} photos: it has the numbers "
            f"{rows.number.min()} to {rows.number.max()}, the photos {min(numbers)} to "
            f"{max(numbers)}; is it the log of another folder?",
        )
    photo, row = np.array(placed).T
    _check_times(path, photos, rows, photo, row)
    horizontal = np.sqrt((rows.sigma_m[row, :2] ** 2).mean(axis=1))
    poses = PhotoPoses(
        frame_id=tuple(photos.frame_id[i] for i in photo),
        latitude_deg=rows.place[row, 0],
        longitude_deg=rows.place[row, 1],
        height_m=rows.place[row, 2],
        datum="ellipsoid",
        time_utc_s=rows.utc_s[row],
        sigma_horizontal_m=np.maximum(horizontal, RTK_FLOOR_HORIZONTAL_M),
        sigma_vertical_m=np.maximum(rows.sigma_m[row, 2], RTK_FLOOR_VERTICAL_M),
        source="DJI MRK",
    )
    return poses, _quality_messages(path, rows.quality[row], len(joined) - len(placed))


def _read_rows(path: Path) -> _Rows:
    lines = read_bytes(path).decode("ascii", errors="replace").splitlines()
    matches = [(k, _LINE.fullmatch(text)) for k, text in enumerate(lines, 1) if text.strip()]
    faults: list[tuple[int | None, str]] = [
        (k, "is no line of a DJI image log (number, time, [week], offsets, Lat, Lon, Ellh, Q)")
        for k, match in matches
        if match is None
    ]
    if faults:
        raise InputError.of_all(path, faults)
    if not matches:
        raise InputError(path, "the file is empty")
    table = np.array([[float(x) for x in m.groups()] for _, m in matches if m is not None])
    number = table[:, 0].astype(np.int64)
    line = np.array([k for k, _ in matches])
    lost = np.flatnonzero((np.abs(table[:, 6]) > 90) | (np.abs(table[:, 7]) > 180))
    if lost.size:
        raise InputError(path, "its position is no place on earth", int(line[lost[0]]))
    twice = np.flatnonzero(np.diff(np.sort(number)) == 0)
    if twice.size:
        value = np.sort(number)[twice[0]]
        raise InputError(
            path,
            f"photo {value} occurs twice: keep one of the two lines",
            int(line[np.flatnonzero(number == value)[1]]),
        )
    return _Rows(
        line=line,
        number=number,
        utc_s=utc_from_gps(table[:, 2], table[:, 1] * 1e3),
        place=table[:, 6:9],
        sigma_m=table[:, 9:12],
        quality=table[:, 12].astype(np.int64),
    )


def _photo_numbers(path: Path, photos: Photos) -> list[int]:
    numbers: dict[int, str] = {}
    for name in photos.frame_id:
        match = _PHOTO_NUMBER.fullmatch(name.rpartition(".")[0])
        if match is None:
            raise InputError(
                path,
                f"names photos by number, and {name!r} has none at its end (as 100_0001_0002.JPG "
                "has): give the poses in a CSV file instead",
            )
        other = numbers.setdefault(int(match[1]), name)
        if other != name:
            raise InputError(
                path,
                f"names photos by number, and {name!r} and {other!r} have the same one: an image "
                "log covers one folder; run them apart, or give the poses in a CSV file",
            )
    return list(numbers)


def _check_times(path: Path, photos: Photos, rows: _Rows, photo: Ints, row: Ints) -> None:
    """Check that the offset of the camera's clock is the same for all photos."""
    gap = photos.file_time_s[photo] - rows.utc_s[row]
    known = np.isfinite(gap)
    if known.sum() < 2:
        return
    off = np.where(known, np.abs(gap - np.median(gap[known])), 0.0)
    worst = int(np.argmax(off))
    if off[worst] > _LARGEST_TIME_GAP_S:
        raise InputError(
            path,
            f"{photos.frame_id[photo[worst]]!r} was taken {off[worst]:.1f} s off the time that its "
            "number has in the log, compared with the other photos: are the photos renamed, or is "
            "it the log of another folder?",
            int(rows.line[row[worst]]),
        )


def _quality_messages(path: Path, quality: Ints, without: int) -> tuple[Message, ...]:
    messages = []
    if without:
        text = f"{path.name}: {without} photos have no position (status 0) and were left out"
        messages.append(Message("warning", "mrk-no-position", text))
    loose = int(np.sum(quality != _FIXED))
    if loose:
        text = (
            f"{path.name}: {loose} of {len(quality)} positions are no fixed RTK solution; their "
            "own sigmas were taken"
        )
        messages.append(Message("warning", "mrk-not-fixed", text))
    return tuple(messages)


_ANGLES = ("yaw_deg", "pitch_deg", "roll_deg")
_SIGMAS = ("sigma_horizontal_m", "sigma_vertical_m", "sigma_attitude_deg")
_PLACE = ("latitude_deg", "longitude_deg", "height_m")


def read_pose_csv(
    path: str | Path,
    heights: HeightDatum,
    site: Origin | None = None,
    *,
    may_lack_places: bool = False,
) -> PhotoPoses:
    """Read image, latitude_deg, longitude_deg, height_m and, optional, angles and sigmas.

    Angles are those of the optical axis, as of a gimbal: yaw from north, pitch -90 straight down,
    roll 0 with the horizon level; all three, or none.

    Parameters
    ----------
    path
        The table.
    heights
        Datum of its heights.
    site
        Place of the photos from their own tags; None where they have none.
    may_lack_places
        Whether another source has places, so that a row may have none: all three numbers, or none.

    Raises
    ------
    InputError
        Names file and line of every mistake.
    """
    table = read_table(
        path,
        Columns(
            text=("image",),
            numbers=() if may_lack_places else _PLACE,
            optional_numbers=(*(_PLACE if may_lack_places else ()), *_ANGLES, *_SIGMAS),
        ),
    )
    _check(table, site)
    numbers = table.numbers
    return PhotoPoses(
        frame_id=table.text["image"],
        latitude_deg=numbers["latitude_deg"],
        longitude_deg=numbers["longitude_deg"],
        height_m=numbers["height_m"],
        sigma_horizontal_m=numbers["sigma_horizontal_m"],
        sigma_vertical_m=numbers["sigma_vertical_m"],
        datum=heights,
        ypr_rad=np.radians(np.stack([numbers[name] for name in _ANGLES], axis=1)),
        sigma_attitude_rad=np.radians(numbers["sigma_attitude_deg"]),
        source=table.path.name,
    )


def _check(table: Table, site: Origin | None) -> None:
    table.require_unique("image", "photo")
    for together in (_ANGLES, _PLACE):
        given = np.stack([np.isfinite(table.numbers[name]) for name in together], axis=1)
        for row in np.flatnonzero(given.any(axis=1) & ~given.all(axis=1)):
            names = f"{', '.join(together[:-1])} and {together[-1]}"
            table.add_fault(int(row), f"{names}: give all three, or none")
    if site is not None:
        place = table.numbers["latitude_deg"], table.numbers["longitude_deg"]
        for exchanged in np.flatnonzero(are_axes_exchanged(place, place[::-1], site)).tolist():
            table.add_fault(exchanged, AXES_EXCHANGED)
    if not len(table.line):
        table.faults.append((None, "holds no photo: give a row for each, or leave `poses` out"))
    table.raise_faults()
