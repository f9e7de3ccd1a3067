"""OpenDroneMap's gcp_list.txt -> picks, and the coordinates of the points picked.

After docs.opendronemap.org, "Ground Control Points": a coordinate system, then for each pick
``x y z column row image [label]``; z may be NaN where a height is not known (OpenSfM, ``io.py``:
``_read_gcp_list_lines``). Columns and rows count from the centre of the top-left pixel
(OpenSfM, ``features.py``: ``normalized_image_coordinates`` adds half a pixel).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from uavgram.errors import InputError
from uavgram.io.odm_coordinates import content_lines, crs_of_header, geodetic
from uavgram.io.tables import parse_number
from uavgram.model.imported import ImportedPicks
from uavgram.model.message import Message
from uavgram.model.observations import KnownPoints

_NAMES = ("x", "y", "z", "column", "row")
_NUMBERS, _Z = 5, 2


@dataclass(frozen=True)
class _Row:
    line: int
    xyz: tuple[float, float, float | None]
    pixel: tuple[float, float]
    image: str
    label: str


def read_gcp_list(path: str | Path, sigma_m: float | None = None) -> ImportedPicks:
    """Read picks and, where `sigma_m` is stated, the points' coordinates.

    Parameters
    ----------
    path
        The file.
    sigma_m
        Standard deviation of each coordinate, which the file does not hold.

    Raises
    ------
    InputError
        Names file and line of every mistake: an unknown coordinate system, text for a number, a
        row without photo, one label with two places, two picks of a label in one photo.
    """
    path = Path(path)
    head, *lines = content_lines(path, "a line for each pick")
    crs = crs_of_header(path, *head)
    rows = _rows(path, lines)
    messages: list[Message] = []
    if not all(row.label for row in rows):
        rows = _named(rows)
        text = f"{path.name}: picks without a label were named by their coordinates, gcp-1 and on"
        messages.append(Message("info", "gcp-without-labels", text))
    _check(path, rows)
    known = None
    if sigma_m is not None:
        first = list({row.label: row for row in reversed(rows)}.values())[::-1]
        _check_heights(path, first)
        xyz = np.array([row.xyz for row in first], dtype=np.float64)
        latitude, longitude = geodetic(path, crs, xyz, [row.line for row in first])
        known = KnownPoints(
            label=tuple(row.label for row in first),
            kind="geodetic",
            coordinates=np.column_stack([latitude, longitude, xyz[:, 2]]),
            sigma_m=np.full((len(first), 3), sigma_m),
        )
    return ImportedPicks(
        image=tuple(row.image for row in rows),
        label=tuple(row.label for row in rows),
        pixel_px=np.array([row.pixel for row in rows]),
        known=known,
        messages=tuple(messages),
    )


def _rows(path: Path, lines: Sequence[tuple[int, str]]) -> list[_Row]:
    rows, faults = [], []
    for line, text in lines:
        cells = text.split()
        numbers = [parse_number(cell) for cell in cells[:_NUMBERS]]
        no_height = len(cells) > _Z and cells[_Z].lower() == "nan"
        if no_height:
            numbers[_Z] = 0.0
        good = [value for value in numbers if value is not None]
        if len(cells) <= _NUMBERS:
            faults.append((line, "needs x, y, z, column, row and the photo's name"))
        elif len(good) < _NUMBERS:
            wrong = numbers.index(None)
            faults.append((line, f"{_NAMES[wrong]} must be a number (got {cells[wrong]!r})"))
        else:
            x, y, z, u, v = good
            label = cells[_NUMBERS + 1] if len(cells) > _NUMBERS + 1 else ""
            place = (x, y, None if no_height else z)
            rows.append(_Row(line, place, (u, v), cells[_NUMBERS], label))
    if faults:
        raise InputError.of_all(path, faults)
    return rows


def _named(rows: list[_Row]) -> list[_Row]:
    """The same place is the same point."""
    number: dict[tuple[float, float, float | None], int] = {}
    for row in rows:
        number.setdefault(row.xyz, len(number) + 1)
    return [_Row(r.line, r.xyz, r.pixel, r.image, r.label or f"gcp-{number[r.xyz]}") for r in rows]


def _check_heights(path: Path, rows: list[_Row]) -> None:
    text = "has no height (NaN), which a control point needs: add it, or leave the control out"
    faults = [(row.line, text) for row in rows if row.xyz[_Z] is None]
    if faults:
        raise InputError.of_all(path, faults)


def _check(path: Path, rows: list[_Row]) -> None:
    place: dict[str, _Row] = {}
    seen: dict[tuple[str, str], int] = {}
    faults = []
    for row in rows:
        first = place.setdefault(row.label, row)
        if first.xyz != row.xyz:
            text = f"label {row.label!r} has another place than in line {first.line}"
            faults.append((row.line, text))
        at = seen.setdefault((row.image, row.label), row.line)
        if at != row.line:
            text = f"label {row.label!r} is picked in {row.image!r} in line {at} already: keep one"
            faults.append((row.line, text))
    if faults:
        raise InputError.of_all(path, faults)
