"""Definitions of a ULog: what a topic's rows are made of, and the key-value pairs of the system.

https://docs.px4.io/main/en/dev_log/ulog_file_format.html, "Definitions Section".
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

_TYPES = {
    "int8_t": "<i1", "uint8_t": "<u1", "int16_t": "<i2", "uint16_t": "<u2", "int32_t": "<i4",
    "uint32_t": "<u4", "int64_t": "<i8", "uint64_t": "<u8", "float": "<f4", "double": "<f8",
    "bool": "<i1", "char": "<i1",
}  # fmt: skip
_FIELD = re.compile(r"(\w+)(?:\[(\d{1,5})\])? (\w+)", re.ASCII)
_NAME = re.compile(r"[\w/-]+", re.ASCII)
_LARGEST = 65535 - 2  # bytes of a row: a message's size has 16 bits, the topic's number takes two

Field = tuple[str, int | None, str]
"""Type, number of elements (None: no array), name."""


@dataclass(frozen=True)
class RowType:
    """The rows of a topic.

    Attributes
    ----------
    dtype
        Nested topics and arrays taken apart: ``esc[0].rpm``, ``q[3]``.
    longest
        Bytes of a row with the filling at its end, which a logger may leave out.
    time_at
        Where in it the time of its publishing lies.
    """

    dtype: np.dtype[Any]
    longest: int
    time_at: int


def format_of(body: bytes) -> tuple[str, tuple[Field, ...]] | None:
    """Name and fields that a format message states; None where it makes no sense."""
    name, colon, stated = body.decode("latin-1").partition(":")
    if not colon or not _NAME.fullmatch(name):
        return None
    fields: list[Field] = []
    for text in filter(None, stated.split(";")):
        found = _FIELD.fullmatch(text)
        if found is None:
            return None
        kind, size, field = found.groups()
        if size is not None and not int(size):
            return None  # of nothings there could be endlessly many
        fields.append((kind, None if size is None else int(size), field))
    return name, tuple(fields)


def row_type(name: str, formats: Mapping[str, tuple[Field, ...]]) -> RowType | None:
    """How the rows of a topic lie in their messages; None where its formats make no sense.

    Nor are rows without a time of their own of any use: PX4 writes none.
    """
    columns: list[tuple[str, str]] = []
    size = time_at = 0
    for field, code in _flat(name, formats, "", (name,)):
        if field == "timestamp":
            time_at = size
        size += int(code[2:])
        if size > _LARGEST:
            return None
        columns.append((field, code))
    while columns and columns[-1][0].startswith("_padding"):
        columns.pop()
    by_name = dict(columns)
    if by_name.get("timestamp") != "<u8" or len(by_name) != len(columns):
        return None
    return RowType(np.dtype(columns), size, time_at)


def _flat(
    name: str, formats: Mapping[str, tuple[Field, ...]], prefix: str, inside: tuple[str, ...]
) -> Iterator[tuple[str, str]]:
    """Names and numpy types of all plain fields, in order; one too large where none is stated."""
    for kind, count, field in formats[name]:
        names = [field] if count is None else [f"{field}[{k}]" for k in range(count)]
        if kind in _TYPES:
            yield from ((prefix + each, _TYPES[kind]) for each in names)
        elif kind not in formats or kind in inside or not formats[kind]:
            yield prefix, f"<V{_LARGEST + 1}"
            return
        else:
            for each in names:
                yield from _flat(kind, formats, f"{prefix}{each}.", (*inside, kind))


def key_and_value(body: bytes) -> tuple[str, Any] | None:
    """What an information or parameter message states; None where it makes no sense.

    A text, a number, or the bytes of anything else.
    """
    end = 1 + body[0] if body else 0
    kind, space, key = body[1:end].decode("latin-1").partition(" ")
    raw = body[end:]
    if not space or not key or end > len(body):
        return None
    if kind.startswith("char["):
        return key, raw.decode("utf-8", "ignore")
    if kind not in _TYPES:
        return key, raw
    dtype = np.dtype(_TYPES[kind])
    return (key, np.frombuffer(raw, dtype)[0].item()) if len(raw) == dtype.itemsize else None
