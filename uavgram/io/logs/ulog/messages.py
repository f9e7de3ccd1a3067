"""Messages of a ULog: their positions, tests whether bytes can be one, and parsed definitions.

A message is its size (two bytes, without the header), its kind (a letter), and its content;
messages follow each other. A topic's rows are messages of data; their composition, and key-value
pairs of the system, are definitions. https://docs.px4.io/main/en/dev_log/ulog_file_format.html.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavgram.model.arrays import Bools, Ints

HEADER = 3
MAX_MESSAGE_BYTES = HEADER + 65535
DATA, SYNC, ADDED, FORMAT, DROPOUT = b"DSAFO"
FLAGS, INFO, PARAMETER = b"BIP"
_INFO_MULTIPLE, _PARAMETER_DEFAULT, _REMOVED, _LOGGED, _LOGGED_TAGGED = b"MQRLC"
_SYNC_CONTENT = b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"
_LEVELS = frozenset(b"01234567\0\1\2\3\4\5\6\7")
_KNOWN = np.zeros(256, dtype=bool)
_KNOWN[list(b"DSAFOBIPMQRLC")] = True

Fits = Callable[[int, int], bool]
"""Function that returns whether a row of a topic's number can have so many bytes."""


def follow_sizes(data: bytes, begin: int, stop: int) -> Ints:
    """Return the starts of messages that follow each other by their sizes, and the last's end.

    Each starts before `stop`, which leaves room for a header.

    Parameters
    ----------
    data
        Bytes of the file.
    begin, stop
        Range of bytes.
    """
    # each size gives the start of the next message: the only loop over messages
    starts: list[int] = []
    add = starts.append
    at = begin
    while at < stop:
        add(at)
        at += data[at] + (data[at + 1] << 8) + HEADER
    add(at)
    return np.array(starts, dtype=np.int64)


def is_implausible(data: NDArray[np.uint8], edges: Ints) -> Bools:
    """Return (N,) of N + 1 edges of a chain: an unknown kind, no content, or no end in the data."""
    starts, ends = edges[:-1], edges[1:]
    unknown = ~_KNOWN[data[starts + 2]]
    return np.asarray(unknown | (ends - starts == HEADER) | (ends > len(data)))


def is_sound(data: bytes, at: int, fits: Fits) -> bool:
    """Return whether the bytes at a position form a valid message in every respect.

    Parameters
    ----------
    data
        Bytes of the file.
    at
        The position.
    fits
        Whether rows of the topics have these sizes.
    """
    if at + HEADER > len(data):
        return False
    size = data[at] | data[at + 1] << 8
    body = at + HEADER
    check = _CHECKS.get(data[at + 2])
    if check is None or not size or body + size > len(data):
        return False
    if data[at + 2] == DATA:
        return size > 2 and fits(data[body] | data[body + 1] << 8, size - 2)
    return check(data[body : body + size])


def find_next_sound(data: bytes, begin: int, stop: int, fits: Fits) -> int:
    """Return the first position with a sound message before another; else `stop`.

    Parameters
    ----------
    data
        Bytes of the file.
    begin, stop
        Range of bytes.
    fits
        Whether rows of the topics have these sizes.
    """
    kinds = np.frombuffer(data, dtype=np.uint8)[begin + 2 : stop + 2]
    for at in (np.flatnonzero(_KNOWN[kinds]) + begin).tolist():
        if is_sound(data, at, fits):
            end = at + HEADER + (data[at] | data[at + 1] << 8)
            if end + HEADER > len(data) or is_sound(data, end, fits):
                return int(at)
    return stop


def _is_level(code: int) -> bool:
    return code in _LEVELS


_CHECKS: dict[int, Callable[[bytes], bool]] = {
    DATA: lambda _: True,
    SYNC: lambda body: body == _SYNC_CONTENT,
    ADDED: lambda body: len(body) > 3 and body[3:].isascii(),
    FORMAT: lambda body: format_of(body) is not None,
    DROPOUT: lambda body: len(body) == 2,
    INFO: lambda body: key_and_value(body) is not None,
    PARAMETER: lambda body: key_and_value(body) is not None,
    _INFO_MULTIPLE: lambda body: body[0] < 2 and key_and_value(body[1:]) is not None,
    _PARAMETER_DEFAULT: lambda body: key_and_value(body[1:]) is not None,
    _REMOVED: lambda body: len(body) == 2,
    _LOGGED: lambda body: len(body) > 9 and _is_level(body[0]),
    _LOGGED_TAGGED: lambda body: len(body) > 11 and _is_level(body[0]),
}


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
    """Rows of a topic.

    Attributes
    ----------
    dtype
        Nested topics and arrays are flattened: ``esc[0].rpm``, ``q[3]``.
    longest
        Bytes of a row with the padding at its end, which a logger may omit.
    time_at
        Offset of the time of publication.
    """

    dtype: np.dtype[Any]
    longest: int
    time_at: int


def format_of(body: bytes) -> tuple[str, tuple[Field, ...]] | None:
    """Return name and fields of a format message; None if it is invalid."""
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
            return None  # an unlimited number of them would fit
        fields.append((kind, None if size is None else int(size), field))
    return name, tuple(fields)


def row_type(name: str, formats: Mapping[str, tuple[Field, ...]]) -> RowType | None:
    """Return the layout of the rows of a topic in their messages; None for invalid formats.

    Rows without a time of their own are rejected too: PX4 writes none.
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
    """Iterate over names and numpy types of all plain fields, in order; oversized if undefined."""
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
    """Parse an information or parameter message; None if it is invalid.

    The value is a text, a number, or the bytes of any other type.
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
