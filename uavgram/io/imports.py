"""Import of picks from other programs: OpenDroneMap's gcp_list.txt, and LabelMe's JSON.

gcp_list.txt (docs.opendronemap.org, "Ground Control Points"): a coordinate system, then for each
pick ``x y z column row image [label]``, separated by blanks or tabs, here also by commas or
semicolons; z may be NaN where a height is unknown (OpenSfM, ``io.py``: ``_read_gcp_list_lines``).
Columns and rows count from the centre of the top-left pixel (OpenSfM, ``features.py``:
``normalized_image_coordinates`` adds half a pixel).

LabelMe: a ``point`` is a pick at its position, a ``circle`` one at its centre; other shapes are not
picks. It counts from the corner of the top-left pixel, and shows a photo rotated by its EXIF
orientation (``labelme/utils/image.py``, ``apply_exif_orientation``), so its coordinates are rotated
back here.
"""

from __future__ import annotations

import glob
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from uavgram.errors import InputError
from uavgram.input_files import read_text
from uavgram.io.files import PHOTO_SUFFIXES
from uavgram.io.json_codec import parse_json
from uavgram.io.photos.metadata import (
    exif_numbers,
    read_exif_tags,
    read_first_site,
    read_image_size,
)
from uavgram.io.photos.pose_tables import convert_to_geodetic, parse_crs, read_content_lines
from uavgram.io.tables.csv_tables import number_hint, parse_number
from uavgram.model.arrays import Floats
from uavgram.model.limits import find_unshowable, find_value_fault
from uavgram.model.message import Message
from uavgram.model.naming import join_names
from uavgram.model.observations import ImportedPicks, KnownPoints

_NAMES = ("x", "y", "z", "column", "row")
_NUMBERS, _Z = 5, 2
LARGEST_SIDE_PX = 65_535
"""Largest side of a JPEG [px] (ITU-T T.81, table B.2), for photos whose size is unknown."""
_PHOTO = re.compile(rf".*(?:{'|'.join(map(re.escape, PHOTO_SUFFIXES))})(?=\s|$)", re.IGNORECASE)
"""Pattern of a photo's name, which may contain blanks: up to the last word with a photo suffix."""
_NO_HEIGHT = "has no height (NaN), which a control point needs: add it, or leave the control out"
UNKNOWN_HEIGHT_SIGMA_M = 10_000.0
"""Sigma of an unknown height [m], so large that it has no weight."""


@dataclass(frozen=True, kw_only=True)
class GcpSigmas:
    """Standard deviations of the coordinates, which the format does not contain.

    Attributes
    ----------
    sigma_m
        Of each coordinate of a point without own sigmas; None: every point has some.
    sigma_up_m
        Of its height, where it differs. If stated, heights of 0 are used too.
    in_columns
        Whether the cells behind the label are the point's own sigmas: horizontal, and vertical
        where it differs.
    """

    sigma_m: float | None = None
    sigma_up_m: float | None = None
    in_columns: bool = False


@dataclass(frozen=True)
class _Row:
    line: int
    xyz: tuple[float, float, float | None]
    pixel: tuple[float, float]
    image: str
    label: str
    rest: tuple[str, ...] = ()
    loose: tuple[str, ...] = ()  # of these, the ones that only blanks separate from the label


def read_gcp_list(path: str | Path, sigmas: GcpSigmas | None = None) -> ImportedPicks:
    """Read picks and, where `sigmas` are stated, the points' coordinates.

    Parameters
    ----------
    path
        The file.
    sigmas
        Of the coordinates. A height of exactly 0, which programs write for unknown heights, gets
        one without weight.

    Raises
    ------
    InputError
        Names file and line of every mistake: an unknown coordinate system, text for a number, a row
        without photo, one label with two positions, two picks of a label in one photo.
    """
    path = Path(path)
    head, *lines = read_content_lines(path, "a line for each pick")
    crs = parse_crs(path, *head)
    rows = _rows(path, lines)
    messages: list[Message] = []
    if not all(row.label for row in rows):
        rows = _name_picks(rows)
        text = f"{path.name}: picks without a label were named by their coordinates, gcp-1 and on"
        messages.append(Message("info", "gcp-without-labels", text))
    _check(path, rows)
    rows, absent = _leave_absent_out(path, rows)
    messages += absent
    if sigmas is None or not sigmas.in_columns:
        messages += _unused_numbers(path, rows)
    known = None
    if sigmas is not None:
        # coordinates of each label from its first row
        first = list({row.label: row for row in reversed(rows)}.values())[::-1]
        xyz = np.array([row.xyz for row in first], dtype=np.float64)
        site = read_first_site(_beside(path, {row.image for row in rows}))
        latitude, longitude = convert_to_geodetic(path, crs, xyz, [row.line for row in first], site)
        known = KnownPoints(
            label=tuple(row.label for row in first),
            kind="geodetic",
            coordinates=np.column_stack([latitude, longitude, xyz[:, 2]]),
            sigma_m=_sigmas(path, first, sigmas),
        )
        messages += _zero_heights(path, first, sigmas)
    messages += _two_heights(path, rows)
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
        text = _separate_by_tabs(text)  # noqa: PLW2901
        cells, has_gap = _cells(text), "\t\t" in text.strip()
        numbers = [parse_number(cell) for cell in cells[:_NUMBERS]]
        no_height = len(cells) > _Z and cells[_Z].lower() == "nan"
        if no_height:
            numbers[_Z] = 0.0
        good = [value for value in numbers if value is not None]
        loose = _loose_words(text, cells)
        surplus = " ".join(word for word in loose if parse_number(word) is None)
        if len(cells) <= _NUMBERS:
            needed = "needs x, y, z, column, row and the photo's name, separated by blanks, tabs, "
            faults.append((line, f"{needed}commas or semicolons"))
        elif surplus:
            faults.append(
                (
                    line,
                    f"has {surplus!r} behind the label {cells[_NUMBERS + 1]!r}: if it belongs to "
                    "the name of the photo or of the point, separate all cells by tabs",
                )
            )
        elif len(good) < _NUMBERS:
            wrong = numbers.index(None)
            hint = ": a cell of the line is empty" if has_gap else number_hint(cells[wrong])
            faults.append((line, f"{_NAMES[wrong]} must be a number (got {cells[wrong]!r}){hint}"))
        elif has_gap and not _PHOTO.match(cells[_NUMBERS]):
            no_photo = f"has an empty cell, and {cells[_NUMBERS]!r} is no name of a photo"
            faults.append((line, f"{no_photo}: fill in the photo's name"))
        else:
            x, y, z, u, v = good
            label = cells[_NUMBERS + 1] if len(cells) > _NUMBERS + 1 else ""
            place = (x, y, None if no_height else z)
            rest = tuple(cells[_NUMBERS + 2 :])
            rows.append(_Row(line, place, (u, v), cells[_NUMBERS], label, rest, tuple(loose)))
    if faults:
        raise InputError.of_all(path, faults)
    return rows


def _separate_by_tabs(text: str) -> str:
    """Replace semicolons by tabs, and commas in a line whose numbers they separate."""
    for mark in ";,":
        cells = [cell.strip() for cell in text.split(mark)]
        numbers = [cell for cell in cells[:_NUMBERS] if cell.lower() == "nan" or _is_number(cell)]
        # semicolons are no part of numbers; commas may be decimal ones
        if len(cells) > _NUMBERS and (mark == ";" or len(numbers) == _NUMBERS):
            return "\t".join(cells)
    return text


def _is_number(cell: str) -> bool:
    return parse_number(cell) is not None


def _cells(text: str) -> list[str]:
    """Split a line into cells; where tabs separate them, blanks are part of a name."""
    words = text.split(None, _NUMBERS)
    if len(words) <= _NUMBERS:
        return words
    *numbers, rest = words
    is_tabbed = "\t" in rest or text.count("\t") >= _NUMBERS
    first, *more = rest.split("\t") if is_tabbed else [rest]
    photo = _PHOTO.match(first)
    image = photo[0] if photo else first if is_tabbed else first.split()[0]
    return [*numbers, image, *first[len(image) :].split(), *map(str.strip, more)]


def _loose_words(text: str, cells: list[str]) -> list[str]:
    """Find words behind the label that only blanks separate from it, perhaps part of a name."""
    own_cells = {cell.strip() for cell in text.split("\t")} if "\t" in text else set()
    return [word for word in cells[_NUMBERS + 2 :] if word not in own_cells]


def _unused_numbers(path: Path, rows: list[_Row]) -> list[Message]:
    """Warn of numbers behind labels that may be part of them."""
    cut = {row.label: " ".join(row.loose) for row in rows if row.loose}
    shown = join_names(f"{rest!r} behind {label!r}" for label, rest in cut.items())
    text = (
        f"{path.name}: numbers behind labels are not used: {shown}. If they belong to the labels, "
        "separate all cells by tabs; if they are sigmas, import with --sigma-columns."
    )
    return [Message("warning", "gcp-numbers-unused", text)] if cut else []


def _beside(path: Path, images: set[str]) -> Iterator[Path]:
    """Iterate over possible paths of photos: next to the file, or in a subfolder."""
    for image in sorted(images):
        yield path.parent / image
        yield from path.parent.glob(f"*/{glob.escape(image)}")


def _leave_absent_out(path: Path, rows: list[_Row]) -> tuple[list[_Row], list[Message]]:
    """Leave out the picks in photos that are not beside the file, if others are."""
    images = {row.image for row in rows}
    there = {image for image in images if any(p.is_file() for p in _beside(path, {image}))}
    if not there or there == images:
        return rows, []
    kept = [row for row in rows if row.image in there]
    gone = sorted(images - there)
    text = (
        f"{path.name}: {len(rows) - len(kept)} of {len(rows)} picks are left out, as "
        f"{len(gone)} of {len(images)} photos are not beside the file, such as {gone[0]}. "
        "To use them, copy the photos there, and import once more into another file."
    )
    return kept, [Message("warning", "gcp-photos-absent", text, files=(path.name,))]


def _outside(path: Path, rows: list[_Row]) -> list[tuple[int, str]]:
    """Find pixels outside of their photos, as far as these are beside the file."""
    faults = []
    sizes: dict[str, tuple[int, int] | None] = {}
    for row in rows:
        if row.image not in sizes:
            sizes[row.image] = _size_of(_beside(path, {row.image}))
        size, (u, v) = sizes[row.image], row.pixel
        width, height = size or (LARGEST_SIDE_PX, LARGEST_SIDE_PX)
        if not (-0.5 <= u <= width - 0.5 and -0.5 <= v <= height - 0.5):
            shown = f" ({width} x {height} px, original and unrotated)" if size else ""
            text = f"the pick of {row.label!r} at ({u:g}, {v:g}) is outside {row.image!r}{shown}"
            faults.append((row.line, f"{text}: correct its column and row"))
    return faults


def _size_of(paths: Iterable[Path]) -> tuple[int, int] | None:
    """Read the size of the first of these photos that exists; None where none can be read."""
    with suppress(InputError):
        return next((read_image_size(photo) for photo in paths if photo.is_file()), None)
    return None


def _name_picks(rows: list[_Row]) -> list[_Row]:
    """Name unlabelled picks by number: equal coordinates are the same point."""
    number: dict[tuple[float, float, float | None], int] = {}
    for row in rows:
        number.setdefault(row.xyz, len(number) + 1)
    return [replace(row, label=row.label or f"gcp-{number[row.xyz]}") for row in rows]


def _sigmas(path: Path, rows: list[_Row], sigmas: GcpSigmas) -> Floats:
    """Return (N, 3) east, north, up sigmas of points, each by its first row."""
    result = np.empty((len(rows), 3))
    faults: list[tuple[int, str]] = []
    for k, row in enumerate(rows):
        cells = row.rest[:2] if sigmas.in_columns else ()
        own = [parse_number(cell) for cell in cells]
        fault = next((text for text in map(_sigma_fault, own) if text), "")
        if row.xyz[_Z] is None:
            faults.append((row.line, _NO_HEIGHT))
        elif fault:
            faults.append((row.line, f"sigma behind the label {row.label!r} {fault}"))
        elif not own and sigmas.sigma_m is None:
            text = f"label {row.label!r} has no sigma behind it: add it, or state --control-sigma-m"
            faults.append((row.line, text))
        else:
            across = own[0] if own else sigmas.sigma_m
            up = own[-1] if len(own) > 1 else sigmas.sigma_up_m or across
            up = UNKNOWN_HEIGHT_SIGMA_M if _has_no_height(row, sigmas) else up
            result[k] = (across, across, up)
    if faults:
        raise InputError.of_all(path, faults)
    return result


def _sigma_fault(value: float | None) -> str:
    return "must be a number" if value is None else find_value_fault("sigma", value)


def _has_no_height(row: _Row, sigmas: GcpSigmas) -> bool:
    return row.xyz[_Z] == 0.0 and sigmas.sigma_up_m is None


def _zero_heights(path: Path, rows: list[_Row], sigmas: GcpSigmas) -> list[Message]:
    without = [row.label for row in rows if _has_no_height(row, sigmas)]
    if not without:
        return []
    which = "all points" if len(without) == len(rows) else f"points {', '.join(without)}"
    text = (
        f"{path.name}: {which} have the height 0, which programs write where they know none: the "
        f"heights count as ± {UNKNOWN_HEIGHT_SIGMA_M:g} m, so they have no effect. If they are "
        "true, state how exact they are with --control-sigma-up-m; else write the heights "
        "into the table."
    )
    return [Message("warning", "gcp-zero-heights", text)]


def _two_heights(path: Path, rows: list[_Row]) -> list[Message]:
    """Warn of points with different names, or without any, that differ in height alone."""
    at: dict[tuple[float, float], dict[str, _Row]] = {}
    for row in rows:
        x, y, z = row.xyz
        if z is not None:
            at.setdefault((x, y), {}).setdefault(row.label, row)
    places = [
        " and ".join(f"{row.label} at {row.xyz[_Z]:g} (line {row.line})" for row in here.values())
        for here in at.values()
        if len({row.xyz[_Z] for row in here.values()}) > 1
    ]
    text = (
        f"{path.name}: one place is listed at two heights: {'; '.join(places)}. If that is one "
        "point, correct its height and give it one label; as it is, its picks belong to two points."
    )
    return [Message("warning", "gcp-two-heights", text)] if places else []


def _check(path: Path, rows: list[_Row]) -> None:
    place: dict[str, _Row] = {}
    seen: dict[tuple[str, str], int] = {}
    faults = _outside(path, rows)
    for row in rows:
        for what, name in (("label", row.label), ("image", row.image)):
            if fault := find_unshowable(name):
                faults.append((row.line, f"{what} {name!r} holds {fault}: type it again"))
        if ";" in row.label:
            text = f"label {row.label!r} holds a semicolon, which separates a measurement's labels"
            faults.append((row.line, text))
        first = place.setdefault(row.label, row)
        if first.xyz != row.xyz:
            (x, y, z), (first_x, first_y, first_z) = row.xyz, first.xyz
            is_height = (x, y) == (first_x, first_y)
            what, own, other = (
                ("height", f"{z}", f"{first_z}")
                if is_height
                else ("place", f"{x}, {y}", f"{first_x}, {first_y}")
            )
            text = (
                f"label {row.label!r} has another {what} ({own}) than in line {first.line} "
                f"({other}): correct one, or give the second point its own label"
            )
            faults.append((row.line, text))
        at = seen.setdefault((row.image, row.label), row.line)
        if at != row.line:
            text = f"label {row.label!r} is picked in {row.image!r} in line {at} already: keep one"
            faults.append((row.line, text))
    if faults:
        raise InputError.of_all(path, faults)


_PICKS = ("point", "circle")
# Stored (x, y) of a displayed (x, y), from corner to corner of a stored photo of w by h, as rows
# (by x, by y, of w, of h); EXIF 2.32, tag 274 "Orientation".
_STORED = {
    1: ((1, 0, 0, 0), (0, 1, 0, 0)),
    2: ((-1, 0, 1, 0), (0, 1, 0, 0)),
    3: ((-1, 0, 1, 0), (0, -1, 0, 1)),
    4: ((1, 0, 0, 0), (0, -1, 0, 1)),
    5: ((0, 1, 0, 0), (1, 0, 0, 0)),
    6: ((0, 1, 0, 0), (-1, 0, 0, 1)),
    7: ((0, -1, 1, 0), (-1, 0, 0, 1)),
    8: ((0, -1, 1, 0), (1, 0, 0, 0)),
}


def read_labelme(path: str | Path) -> ImportedPicks:
    """Read the picks of one photo from LabelMe.

    Raises
    ------
    InputError
        The file is not of LabelMe, holds no pick, picks a label twice, or its size is not that of
        the photo next to it.
    """
    path = Path(path)
    content = _content(path)
    shown: list[tuple[float, float]] = []
    label: list[str] = []
    skipped: list[str] = []
    for shape in content["shapes"]:
        name = str(shape["label"])
        if shape.get("shape_type", "polygon") not in _PICKS:
            skipped.append(name)
            continue
        if name in label:
            raise InputError(path, f"label {name!r} is picked twice: rename one of the two")
        if fault := find_unshowable(name) or ("a semicolon" if ";" in name else ""):
            raise InputError(
                path, f"label {name!r} holds {fault}, which no label can have: rename it"
            )
        label.append(name)
        shown.append(_place(path, name, shape["points"][0], content))
    if not label:
        raise InputError(path, "holds no point and no circle: there is nothing to import")
    messages = []
    if skipped:
        text = f"{path.name}: shapes that are no points were left out: {', '.join(skipped)}"
        messages.append(Message("info", "shapes-left-out", text))
    corner = np.array(shown)
    image = content["imagePath"].replace("\\", "/")
    photo = path.parent / image
    if photo.is_file():
        corner = _restore_orientation(path, photo, content, corner)
    else:
        text = f"{path.name}: {image!r} is not beside it, so a turned photo would go unnoticed"
        messages.append(Message("warning", "photo-not-beside", text))
    return ImportedPicks(
        image=(Path(image).name,) * len(label),
        label=tuple(label),
        pixel_px=corner - 0.5,
        known=None,
        messages=tuple(messages),
    )


def _place(
    path: Path, name: str, point: Sequence[float], content: dict[str, Any]
) -> tuple[float, float]:
    """Return the position of a shape, from the corner of the photo."""
    x, y = float(point[0]), float(point[1])
    width, height = content.get("imageWidth") or math.inf, content.get("imageHeight") or math.inf
    if not (0 <= x <= width and 0 <= y <= height):
        raise InputError(path, f"label {name!r} is outside the photo, at ({x:g}, {y:g})")
    return x, y


def _content(path: Path) -> dict[str, Any]:
    text = read_text(path, "is it a LabelMe file? Export it again")
    try:
        return _check_content(parse_json(path, text))
    except (ValueError, KeyError, TypeError, IndexError, OverflowError) as fault:
        raise InputError(
            path, f"is no LabelMe file ({type(fault).__name__}: {fault}): export it again"
        ) from fault


def _check_content(content: object) -> dict[str, Any]:
    """Return the content as an object; raises the errors that `_content` explains."""
    if not isinstance(content, dict):
        raise TypeError("no object")
    if not isinstance(content["imagePath"], str):
        raise TypeError("imagePath")
    for shape in content["shapes"]:
        x, y = shape["points"][0][:2]
        if not (np.isfinite(float(x)) and np.isfinite(float(y)) and str(shape["label"])):
            raise ValueError("points")
    return content


def _restore_orientation(
    path: Path, photo: Path, content: dict[str, Any], corner: Floats
) -> Floats:
    """Convert positions in the photo as displayed by LabelMe to the stored photo."""
    width, height = read_image_size(photo)
    values = exif_numbers(read_exif_tags(photo).get("Image Orientation"))
    orientation = int(values[0]) if values and values[0] in _STORED else 1
    shown = (width, height) if orientation < 5 else (height, width)
    stated = (content.get("imageWidth") or shown[0], content.get("imageHeight") or shown[1])
    if tuple(stated) == shown:
        rows = np.array(_STORED[orientation], dtype=np.float64)
        return np.asarray(corner @ rows[:, :2].T + rows[:, 2:] @ [width, height])
    if tuple(stated) == (width, height):  # versions before 3.3 showed photos as stored
        return corner
    raise InputError(
        path,
        f"was made on a photo of {stated[0]} x {stated[1]} px, but {photo.name} has "
        f"{width} x {height} px: pick in the original photo",
    )
