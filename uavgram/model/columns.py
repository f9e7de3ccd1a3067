"""Names of the columns of tables: in results.json, in its schema and in data frames."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, fields
from functools import cache
from typing import Annotated, Any, cast, get_args, get_origin, get_type_hints

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
