"""MAVLink message definitions, pymavlink's dialect "all", for numpy."""

from __future__ import annotations

import re
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

_KINDS = {"c": "S1", "b": "<i1", "B": "<u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4"}
_KINDS |= {"q": "<i8", "Q": "<u8", "f": "<f4", "d": "<f8"}


@cache
def _dialect() -> Any:  # noqa: ANN401 (a module without types)
    """Import the definitions on demand, as they take 7 MB and 0.1 s."""
    return import_module("pymavlink.dialects.v20.all")


def message_number(name: str) -> int:
    """Return the number of a message, -1 for an unknown name."""
    return _numbers_by_name().get(name, -1)


def message_name(number: int) -> str:
    """Return the name of a message."""
    known = _dialect().mavlink_map.get(number)
    return str(known.msgname) if known is not None else f"UNKNOWN_{number}"


@cache
def _numbers_by_name() -> dict[str, int]:
    return {str(known.msgname): int(number) for number, known in _dialect().mavlink_map.items()}


@cache
def message_dtype(name: str) -> np.dtype[Any]:
    """Return the structured type of a message's whole payload, in the order of the wire."""
    message = _dialect().mavlink_map[message_number(name)]
    codes = re.findall(r"(\d*)([a-zA-Z])", message.unpacker.format)
    fields = []
    for field, (length, code) in zip(message.ordered_fieldnames, codes, strict=True):
        if code == "s":
            fields.append((field, f"S{length}"))
        else:
            fields.append((field, f"({length},){_KINDS[code]}" if length else _KINDS[code]))
    return np.dtype(fields)


@cache
def _checksum_extras() -> NDArray[np.int16]:
    """Return, by message number, the byte that links checksum and definition; -1 if unknown."""
    table = np.full(max(_dialect().mavlink_map) + 2, -1, dtype=np.int16)
    for number, known in _dialect().mavlink_map.items():
        table[number] = known.crc_extra
    return table


def checksum_extra(number: NDArray[np.integer]) -> NDArray[np.int16]:
    """Return the (N,) bytes that link checksums to the definitions; -1 for an unknown message."""
    table = _checksum_extras()
    return np.asarray(table[np.minimum(number, len(table) - 1)])


def vehicle_kind(number: int) -> str:
    """Return a MAV_TYPE for people, such as ``fixed wing``; empty if unknown or generic."""
    kind = _dialect().enums["MAV_TYPE"].get(number) if number > 0 else None
    return str(kind.name).removeprefix("MAV_TYPE_").lower().replace("_", " ") if kind else ""
