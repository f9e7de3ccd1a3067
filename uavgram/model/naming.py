"""Display names: units, counted and listed names, rounded numbers, columns, labels of plates."""

from __future__ import annotations

import math
import re
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass, fields
from decimal import Decimal
from functools import cache
from typing import Annotated, Any, Literal, cast, get_args, get_origin, get_type_hints

LengthUnit = Literal["m", "ft", "ft-in"]
SpeedUnit = Literal["km/h", "mph", "m/s"]

FOOT_M = 0.3048
"""International foot [m], exact.

The US survey foot is longer by two millionths, which matters in state-plane coordinates but never
within a scene; it was retired in 2022 and is not offered.
"""


@dataclass(frozen=True, kw_only=True)
class Units:
    """Units of all displayed values: page, terminal, report, drawing and recording.

    Attributes
    ----------
    length
        ``m``; ``ft``: feet with decimals; ``ft-in``: feet, inches and fractions of an inch.
    speed
        ``km/h``, ``mph`` or ``m/s``.
    """

    length: LengthUnit = "m"
    speed: SpeedUnit = "km/h"


METRIC = Units()
IMPERIAL = Units(length="ft-in", speed="mph")
SHORT_FORMS = {"metric": METRIC, "imperial": IMPERIAL}
"""One-word unit systems accepted in project.yaml."""


def units_from_options(options: tuple[tuple[str, object], ...]) -> Units:
    """Return the units given by the options of a result; metric where they are missing.

    Parameters
    ----------
    options
        Pairs of dotted key and value.
    """
    named = dict(options)
    length, speed = named.get("units.length"), named.get("units.speed")
    return Units(
        length=next((u for u in get_args(LengthUnit) if u == length), METRIC.length),
        speed=next((u for u in get_args(SpeedUnit) if u == speed), METRIC.speed),
    )


EAST_NORTH_UP = ("east", "north", "up")
POSE_AXES = ("east", "north", "up", "x", "y", "z")
"""Axes of a pose: world axes of the centre, then camera axes of the rotation."""


@dataclass(frozen=True)
class Column:
    """Names and form of a field in files, in its annotation: ``Annotated[..., Column(...)]``.

    A field without a `Column` uses its own name as key; its entries are east, north and up.

    Attributes
    ----------
    key
        Key in results.json; empty: the name of the field.
    keys
        Keys in results.json, one for each entry of a row; the entries are then stored as separate
        numbers.
    axes
        Names of the entries of a row, in the columns of data frames.
    stem, unit
        Beginning and end of these columns' names; None: those of the field's name.
    is_optional
        Whether a record of results.json leaves the field out where it is empty.
    is_single
        Whether a record has a number instead of a list of one.
    """

    key: str = ""
    keys: tuple[str, ...] = ()
    axes: tuple[str, ...] = EAST_NORTH_UP
    stem: str | None = None
    unit: str | None = None
    is_optional: bool = False
    is_single: bool = False


OPTIONAL = Column(is_optional=True)


def columns_of(owner: type[Any]) -> dict[str, Column]:
    """Return the column of each field of a data class."""
    return _columns_of(cast("Hashable", owner))


def row_shapes(owner: type[Any]) -> dict[str, tuple[int, ...]]:
    """Return the row shape of each array field: the fixed sizes in its annotation."""
    return _row_shapes(cast("Hashable", owner))


@cache
def _columns_of(owner: Hashable) -> dict[str, Column]:
    hints = get_type_hints(cast("type", owner), include_extras=True)
    found = {}
    for field in fields(cast("Any", owner)):
        marks = get_args(hints[field.name]) if get_origin(hints[field.name]) is Annotated else ()
        found[field.name] = next((mark for mark in marks if isinstance(mark, Column)), Column())
    return found


@cache
def _row_shapes(owner: Hashable) -> dict[str, tuple[int, ...]]:
    hints = get_type_hints(cast("type", owner), include_extras=True)
    return {
        name: tuple(mark for mark in get_args(hint)[1:] if isinstance(mark, int))
        for name, hint in hints.items()
        if get_origin(hint) is Annotated
    }


MOST_NAMED = 5


def photo_name(frame: str) -> str:
    """Return the photo's name without its extension: ``IMG_0046`` for ``IMG_0046.jpg``."""
    return frame.rpartition(".")[0] or frame


def join_names(names: Iterable[str], most: int | None = MOST_NAMED, *, link: str = "and") -> str:
    """Join names as ``A, B and C``, or the first few and the number of the rest; each name once.

    Parameters
    ----------
    names
        Names in their order; the text is empty without any.
    most
        Largest number of names to write; None: all.
    link
        Word before the last name.
    """
    every = list(dict.fromkeys(names))
    if most is not None and len(every) > most:
        every, link = [*every[:most], f"{len(every) - most} more"], "and"
    return f" {link} ".join(filter(None, (", ".join(every[:-1]), *every[-1:])))


def join_photo_names(frames: Iterable[str]) -> str:
    """Join the names of photos, without extensions, like `join_names`."""
    return join_names(photo_name(frame) for frame in frames)


def format_count(number: int, what: str) -> str:
    """Return a number and its noun: ``1 photo``, ``2 photos``.

    Parameters
    ----------
    number
        Number of things.
    what
        Noun in the singular; its plural must end in s.
    """
    return f"{number} {what}{'' if number == 1 else 's'}"


def format_photo_count(frames: Sequence[str]) -> str:
    """Return the number of photos and the first; the name alone of a single one.

    ``3 photos (the first is a.jpg)``, ``a.jpg``.
    """
    return frames[0] if len(frames) == 1 else f"{len(frames)} photos (the first is {frames[0]})"


def format_digits(value: float, digits: int = 2, sign: str = "") -> str:
    """Format a number with a given number of significant digits, never with a power of ten.

    ``0.012``, ``1.2``, ``960``, ``4500``; 963 and 4510 give the last two as well.

    Parameters
    ----------
    value
        Any number.
    digits
        Number of significant digits.
    sign
        ``+`` to write the sign of positive numbers too.
    """
    text = format(value, f"{sign}.{digits}g")
    return format(Decimal(text), f"{sign}f") if "e" in text else text


def format_misfit(w: float) -> str:
    """Format a standardised residual: ``4.3 times the expected error``."""
    return f"{abs(w):.1f} times the expected error"


SMALLEST_ODDS, ROUND_ODDS = 1e-6, 0.01
"""Probability that is not written any more; and below which one digit is enough."""


def format_odds(probability: float) -> str:
    """Format a small probability: ``1 in 3000``, ``less than 1 in a million``."""
    if probability < SMALLEST_ODDS:
        return "less than 1 in a million"
    return f"1 in {format_digits(1.0 / probability, 1 if probability < ROUND_ODDS else 2)}"


FAMILIES = {
    **{
        f"aruco-{bits}x{bits}-{count}": f"DICT_{bits}X{bits}_{count}"
        for bits in (4, 5, 6, 7)
        for count in (50, 100, 250, 1000)
    },
    "aruco-original": "DICT_ARUCO_ORIGINAL",
    "apriltag-16h5": "DICT_APRILTAG_16h5",
    "apriltag-25h9": "DICT_APRILTAG_25h9",
    "apriltag-36h10": "DICT_APRILTAG_36h10",
    "apriltag-36h11": "DICT_APRILTAG_36h11",
}
"""Name in a project file to name of OpenCV's dictionary."""

BOARD_PLATE = "charuco"
"""Name of a ChArUco board's kind, the text before its first colon."""

LARGEST_PLATE_M = 10.0

MIN_SIDE_PX = 16.0
"""Smallest side of a plate in a photo [px] at which it is found reliably."""

PLATE_CORNERS = 4
_CORNER = re.compile(r"T(\d+)-([1-4])")


def plate_label(plate: int) -> str:
    """Return the name of a plate, which is also the label of the intersection of its diagonals."""
    return f"T{plate}"


def corner_label(plate: int, corner: int) -> str:
    """Return the label of a corner, counted from 0."""
    return f"T{plate}-{corner + 1}"


def plate_of(label: str) -> int | None:
    """Return the plate of a corner's label; None for any other label."""
    match = _CORNER.fullmatch(label)
    return int(match[1]) if match else None


def round_down(most: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten that is not larger."""
    power = 10.0 ** math.floor(math.log10(most))
    return power * max(f for f in (1, 2, 5) if f * power <= most * (1 + 1e-9))


def round_up(least: float) -> float:
    """Return the smallest of 1, 2, 5 times a power of ten that is not smaller."""
    power = 10.0 ** math.floor(math.log10(least))
    return power * min(f for f in (1, 2, 5, 10) if f * power >= least * (1 - 1e-9))
