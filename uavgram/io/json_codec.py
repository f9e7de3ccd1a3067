"""Strict JSON: parsing of unknown files, and conversion of frozen data classes by their types.

The declaration of a class defines both directions. Reading is strict: texts and truth values are
not numbers, and only null is NaN.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, is_dataclass
from functools import cache
from pathlib import Path
from types import UnionType
from typing import Any, Generic, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np

from uavgram.errors import InputError
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.naming import Column, columns_of, row_shapes

_MOST_DIGITS = 300  # of a whole number: more do not fit a float


def parse_json(
    path: Path, text: str | bytes, *, constant: Callable[[str], object] | None = None
) -> object:
    """Parse a file's text.

    Parameters
    ----------
    path
        Names the file in messages.
    text
        Its content; bytes are UTF-8.
    constant
        Called with NaN, Infinity and -Infinity, which are not JSON; None reads them as numbers.

    Raises
    ------
    InputError
        It is nested too deeply, or holds a number of thousands of digits.
    json.JSONDecodeError
        It is not JSON; the caller knows the file and explains that.
    """

    def whole(digits: str) -> int:
        if len(digits) > _MOST_DIGITS:
            raise InputError(
                path, f"holds a number of {len(digits)} digits: it is damaged; make it again"
            )
        return int(digits)

    try:
        return json.loads(text, parse_constant=constant, parse_int=whole)
    except RecursionError as fault:
        raise InputError(
            path, "has too many brackets inside each other: it is damaged; make it again"
        ) from fault


Json = Any
Record = dict[str, Json]
Owner = TypeVar("Owner")


_PLAIN = frozenset({str, int, bool, type(None)})


def encode(value: object) -> Json:
    """Convert numbers, texts, arrays, tuples and data classes to plain data; NaN becomes None."""
    if type(value) in _PLAIN:
        return value
    if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":  # numbers, truth values
        if (unknown := np.isnan(value)).any():
            value = value.astype(np.object_)
            value[unknown] = None
        return value.tolist()
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, float):
        return None if math.isnan(value) else value
    if isinstance(value, list | tuple):
        return [encode(item) for item in value]
    if isinstance(value, Mapping):
        return {key: encode(item) for key, item in value.items()}
    return _encode_fields(value) if is_dataclass(value) else value


def _encode_fields(value: object) -> Record:
    """Encode the fields of a data class by their columns."""
    record: Record = {}
    for name, column in columns_of(type(value)).items():
        item = encode(getattr(value, name))
        if column.is_optional and item in ("", None, []):
            continue
        record[name] = item[0] if column.is_single and len(item) == 1 else item
    return record


def replace_not_finite(value: Json) -> Json:
    """Replace the numbers of plain data that JSON cannot hold, NaN and infinite ones, by None."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, list):
        return [replace_not_finite(item) for item in value]
    if isinstance(value, dict):
        return {key: replace_not_finite(item) for key, item in value.items()}
    return value


def decode(hint: Any, value: Json) -> Any:  # noqa: ANN401
    """Invert `encode` for a type; None becomes NaN where a number is expected.

    Pairs may be stored as an object.

    Raises
    ------
    TypeError, ValueError
        The value is of another type, or none of a Literal's words.
    """
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return None if value is None else decode(inner[0], value)
    if origin is tuple:
        items = list(value.items() if isinstance(value, dict) else value)
        kinds = [inner[0]] * len(items) if inner[-1] is Ellipsis else inner
        return tuple(decode(kind, item) for kind, item in zip(kinds, items, strict=True))
    if origin is Mapping:
        return {key: decode(inner[1], item) for key, item in value.items()}
    if hint == Floats:
        return numbers(value, *np.shape(value))
    if is_dataclass(hint):
        return from_record(cast("type[Any]", hint), value)
    return _scalar(hint, value)


def _scalar(hint: Any, value: Json) -> Any:  # noqa: ANN401
    if hint is float:
        return float(numbers(value))
    if hint is object and isinstance(value, list):
        return tuple(_scalar(object, item) for item in value)
    words = get_args(hint)
    if words and value not in words:
        raise ValueError(f"expected one of {', '.join(map(str, words))}, got {value!r}")
    if not words and (not isinstance(value, hint) or (hint is int and isinstance(value, bool))):
        raise TypeError(f"expected {_TYPE_NAMES[hint]}, got {value!r}")
    return value


_TYPE_NAMES = {str: "text", int: "a whole number", bool: "true or false"}


def from_record(owner: type[Owner], record: Record, **given: object) -> Owner:
    """Invert `encode` for a data class; `given` are fields stored elsewhere.

    A missing key of an optional field is its default.
    """
    hints, read = _hints(cast("Hashable", owner)), {}
    for name, column in columns_of(owner).items():
        if name in given or (column.is_optional and name not in record):
            continue
        hint, value = hints[name], record[name]
        if column.is_single and not isinstance(value, list):
            value = [value]
        if hint == Floats and value == []:  # of the columns that the class states
            read[name] = np.zeros((0, *row_shapes(owner)[name]))
        else:
            read[name] = decode(hint, value)
    return owner(**read, **given)


@cache
def _hints(owner: Hashable) -> dict[str, Any]:
    return get_type_hints(cast("type", owner))


def numbers(value: Json, *shape: int) -> Floats:
    """Convert nested lists to an array; None becomes NaN. Raises ValueError for another shape."""
    # numpy would convert strings silently
    _refuse_text(value)
    array = np.array(value, dtype=np.float64).reshape(shape if 0 in shape else np.shape(value))
    if array.shape != shape:
        raise ValueError(f"expected numbers of shape {shape}, got {array.shape}")
    return array


def _refuse_text(value: Json) -> None:
    if isinstance(value, list):
        for item in value:
            _refuse_text(item)
    elif isinstance(value, str | bool | dict):
        raise TypeError(f"expected a number, got {value!r}")


@dataclass(frozen=True)
class Table(Generic[Owner]):
    """A class of columns as a list of records.

    Attributes
    ----------
    owner
        The class; its fields are columns of N values: arrays (N, ...) or tuples.
    elsewhere
        Fields that are not in these records.
    """

    owner: type[Owner]
    elsewhere: tuple[str, ...] = ()

    def dump(self, table: Owner) -> list[Record]:
        """Return the records, one for each row."""
        columns: dict[str, list[Json]] = {}
        for name in self.names():
            column, values = self.column(name), encode(getattr(table, name))
            if column.keys:
                columns |= {key: [row[k] for row in values] for k, key in enumerate(column.keys)}
            else:
                columns[column.key or name] = values
        return _rows(columns)

    def load(self, records: Sequence[Record], **given: object) -> Owner:
        """Invert `dump`; `given` are the fields `elsewhere`."""
        hints, n = _hints(cast("Hashable", self.owner)), len(records)
        read: dict[str, object] = {}
        for name in self.names():
            column, hint = self.column(name), hints[name]
            key = column.key or name
            if column.keys:
                entries = [[row[part] for part in column.keys] for row in records]
                read[name] = numbers(entries, n, len(column.keys))
            elif hint == Floats:
                shape = row_shapes(self.owner)[name]
                read[name] = numbers([row[key] for row in records], n, *shape)
            elif hint in (Bools, Ints):
                kind = bool if hint == Bools else int
                read[name] = np.array([decode(kind, row[key]) for row in records], dtype=kind)
            else:
                read[name] = decode(hint, [row[key] for row in records])
        return self.owner(**read, **given)

    def column(self, name: str) -> Column:
        """Return the names of a field in the records."""
        return columns_of(self.owner)[name]

    def names(self) -> list[str]:
        """Return the fields of the class that are in these records."""
        return [name for name in _hints(cast("Hashable", self.owner)) if name not in self.elsewhere]


def records(**columns: object) -> list[Record]:
    """Convert columns of N values by name to records."""
    return _rows({key: encode(column) for key, column in columns.items()})


def _rows(columns: Mapping[str, Sequence[Json]]) -> list[Record]:
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def join_records(*tables: Sequence[Record]) -> list[Record]:
    """Merge the records of several lists, row by row."""
    return [
        {k: v for part in parts for k, v in part.items()} for parts in zip(*tables, strict=True)
    ]
