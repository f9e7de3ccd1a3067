"""Names and numbers in plain sentences, units, and names of columns."""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from dataclasses import dataclass, fields
from functools import cache
from typing import Annotated, Any, Literal, cast, get_args, get_origin, get_type_hints

LengthUnit = Literal["m", "ft", "ft-in"]
SpeedUnit = Literal["km/h", "mph", "m/s"]

FOOT_M = 0.3048
"""The international foot, exactly. The US survey foot is two millionths longer, which shows in
coordinates of a state and never in a scene; it was given up in 2022, and is not offered."""


@dataclass(frozen=True, kw_only=True)
class Units:
    """Units of all that is shown: page, terminal, report, drawing and recording.

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
"""What project.yaml may say in one word."""


def units_from_options(options: tuple[tuple[str, object], ...]) -> Units:
    """Units as the options of a result name them; metric where none are named.

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
"""Of centre and turn: the axes of the world, then those of the camera."""


@dataclass(frozen=True)
class Column:
    """Names of a field of a table, beside its annotation: ``Annotated[Floats, "n", Column(...)]``.

    A field without it has its own name as key; its entries are named by east, north and up.

    Attributes
    ----------
    key
        In results.json; empty: the name of the field.
    keys
        In results.json, one for each entry of a row, which then are numbers of their own.
    axes
        Names of the entries of a row, in the columns of data frames.
    stem, unit
        Beginning and end of these columns' names; None: those of the field's name.
    """

    key: str = ""
    keys: tuple[str, ...] = ()
    axes: tuple[str, ...] = EAST_NORTH_UP
    stem: str | None = None
    unit: str | None = None


def columns_of(owner: type[Any]) -> dict[str, Column]:
    """Return the column of each field of a data class."""
    return _columns_of(cast("Hashable", owner))


def row_shapes(owner: type[Any]) -> dict[str, tuple[int, ...]]:
    """Return the fixed sizes in the annotation of each array: the shape of one of its rows."""
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
    """``IMG_0046`` of ``IMG_0046.jpg``."""
    return frame.rpartition(".")[0] or frame


def listed(names: Iterable[str], most: int | None = MOST_NAMED, *, link: str = "and") -> str:
    """``A, B and C``, or the first few and how many more; each once.

    Parameters
    ----------
    names
        In their order; without any, the text is empty.
    most
        That are named; None: all.
    link
        What stands before the last one.
    """
    every = list(dict.fromkeys(names))
    if most is not None and len(every) > most:
        every, link = [*every[:most], f"{len(every) - most} more"], "and"
    return f" {link} ".join(filter(None, (", ".join(every[:-1]), *every[-1:])))


def listed_photos(frames: Iterable[str]) -> str:
    """The same of photos."""
    return listed(photo_name(frame) for frame in frames)


def counted(number: int, what: str) -> str:
    """``1 photo``, ``2 photos``.

    Parameters
    ----------
    number
        How many.
    what
        One of them, in a word to which an s can be added.
    """
    return f"{number} {what}{'' if number == 1 else 's'}"


def figures(value: float, digits: int = 2, sign: str = "") -> str:
    """Write a number with so many significant digits, and no power of ten for a large one.

    ``0.012``, ``1.2``, ``960``, ``4500``: of 963 and 4510 as well.

    Parameters
    ----------
    value
        Any number.
    digits
        That are significant.
    sign
        ``+`` where a positive number has a sign too.
    """
    text = format(value, f"{sign}.{digits}g")
    return format(float(text), f"{sign}.0f") if "e+" in text else text
