"""LabelMe's JSON -> picks.

A ``point`` is a pick at its place, a ``circle`` one at its centre; other shapes are no picks.
LabelMe counts from the corner of the top-left pixel, and shows a photo turned as its EXIF asks
(``labelme/utils/image.py``, ``apply_exif_orientation``), so its numbers are turned back here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from uavgram.errors import InputError
from uavgram.input_files import read_text
from uavgram.io.json_text import parse_json
from uavgram.io.photos.exif import exif_numbers, read_exif_tags
from uavgram.io.photos.size import image_size
from uavgram.model.arrays import Floats
from uavgram.model.limits import unshowable
from uavgram.model.message import Message
from uavgram.model.survey.imported import ImportedPicks

_PICKS = ("point", "circle")
# Stored (x, y) of what is shown at (x, y), from corner to corner of a stored photo of w by h, as
# rows (by x, by y, of w, of h); EXIF 2.32, tag 274 "Orientation".
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
    """Read the picks of one photo.

    Raises
    ------
    InputError
        The file is no LabelMe file, holds no pick, picks a label twice, or its size is not that
        of the photo beside it.
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
        if fault := unshowable(name) or ("a semicolon" if ";" in name else ""):
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
        corner = _turned_back(path, photo, content, corner)
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
    """Where a shape lies, from the corner of the photo."""
    x, y = float(point[0]), float(point[1])
    width, height = content.get("imageWidth") or math.inf, content.get("imageHeight") or math.inf
    if not (0 <= x <= width and 0 <= y <= height):
        raise InputError(path, f"label {name!r} lies outside the photo, at ({x:g}, {y:g})")
    return x, y


def _content(path: Path) -> dict[str, Any]:
    text = read_text(path, "is it a LabelMe file? Export it again")
    try:
        return _checked(parse_json(path, text))
    except (ValueError, KeyError, TypeError, IndexError, OverflowError) as fault:
        raise InputError(
            path, f"is no LabelMe file ({type(fault).__name__}: {fault}): export it again"
        ) from fault


def _checked(content: object) -> dict[str, Any]:
    """The content as an object; raises what `_content` tells in words."""
    if not isinstance(content, dict):
        raise TypeError("no object")
    if not isinstance(content["imagePath"], str):
        raise TypeError("imagePath")
    for shape in content["shapes"]:
        x, y = shape["points"][0][:2]
        if not (np.isfinite(float(x)) and np.isfinite(float(y)) and str(shape["label"])):
            raise ValueError("points")
    return content


def _turned_back(path: Path, photo: Path, content: dict[str, Any], corner: Floats) -> Floats:
    """Places in the stored photo of what was picked in the photo as LabelMe showed it."""
    width, height = image_size(photo)
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
