"""Format messages of ArduPilot's DataFlash logs: fields and types of each message type.

The layout is ArduPilot's (libraries/AP_Logger/LogStructure.h): every message starts with 0xA3 0x95
and its type; type 0x80 (FMT) defines the others: length, name, one format character per field,
field names. A message may have no field at all (STRT until 2014: the vehicle was started).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

Columns = dict[str, NDArray[Any]]

HEADER = b"\xa3\x95"
FMT_TYPE, FMT_LENGTH = 0x80, 89

# Format character: numpy type, and divisor of the stored integer. Division, not multiplication by
# 0.01 or 1e-7: 12345 / 100 is the double nearest to 123.45.
_NUMPY_TYPES: dict[str, tuple[str, float | None]] = {
    "a": ("(32,)<i2", None),
    "b": ("<i1", None),
    "B": ("<u1", None),
    "M": ("<i1", None),
    "h": ("<i2", None),
    "H": ("<u2", None),
    "i": ("<i4", None),
    "I": ("<u4", None),
    "q": ("<i8", None),
    "Q": ("<u8", None),
    "g": ("<f2", None),
    "f": ("<f4", None),
    "d": ("<f8", None),
    "n": ("S4", None),
    "N": ("S16", None),
    "Z": ("S64", None),
    "c": ("<i2", 100.0),
    "C": ("<u2", 100.0),
    "e": ("<i4", 100.0),
    "E": ("<u4", 100.0),
    "L": ("<i4", 1e7),
}
_PLACE, _ANGLES = ("TimeUS", "Lat", "Lng", "Alt"), ("TimeUS", "Roll", "Pitch", "Yaw")
# order of the fields read here, in every firmware since 3.3
_ORDERS: dict[str, tuple[tuple[str, ...], ...]] = {
    "POS": ((*_PLACE, "RelHomeAlt"),),
    "GPS": (_PLACE,),
    "ORGN": (("TimeUS", "Type", "Lat", "Lng", "Alt"),),
    "ATT": (_ANGLES, ("DesRoll", "Roll", "DesPitch", "Pitch", "DesYaw", "Yaw")),
    "MNT": (("TimeUS", "DRoll", "Roll", "DPitch", "Pitch", "DYawB", "YawB", "DYawE", "YawE"),),
}
TEXT_CHARACTERS = "nNZa"  # neither numbers nor scaled


@lru_cache(maxsize=1024)
def _record_type(fields: tuple[str, ...], characters: str) -> np.dtype[Any] | None:
    if len(fields) != len(characters) or len(set(fields)) != len(fields) or not all(fields):
        return None
    if any(c not in _NUMPY_TYPES for c in characters):
        return None
    return np.dtype([(f, _NUMPY_TYPES[c][0]) for f, c in zip(fields, characters, strict=True)])


@dataclass(frozen=True)
class Format:
    """One message type as defined in a file.

    Attributes
    ----------
    number, length
        Type byte; bytes of the whole message, its three header bytes included.
    name, characters, fields
        As in the FMT message.
    """

    number: int
    length: int
    name: str
    characters: str
    fields: tuple[str, ...]

    def dtype(self) -> np.dtype[Any] | None:
        """Return the structured type of the bytes after the header; None for an invalid format."""
        dtype = _record_type(self.fields, self.characters)
        return dtype if dtype is not None and dtype.itemsize + 3 == self.length else None

    def decoded(self, data: NDArray[np.uint8], starts: NDArray[np.int64]) -> Columns:
        """Return every field as a column, scaled according to its format character.

        Parameters
        ----------
        data
            Bytes of the file.
        starts
            (N,) offsets of complete messages of this format.
        """
        dtype = self.dtype()
        if not dtype:  # no format, or one without fields
            return {}
        # view of records starting at every byte, to gather those behind the headers
        room = len(data) - self.length + 1
        records = np.ndarray((room,), dtype, data, offset=3, strides=(1,))[starts]
        return {
            field: _scaled(records[field], _NUMPY_TYPES[c][1])
            for field, c in zip(self.fields, self.characters, strict=True)
        }


def _scaled(raw: NDArray[Any], divisor: float | None) -> NDArray[Any]:
    return np.ascontiguousarray(raw) if divisor is None else raw / divisor


FMT = Format(FMT_TYPE, FMT_LENGTH, "FMT", "BBnNZ", ("Type", "Length", "Name", "Format", "Columns"))
"""Layout of all format messages.

Logs of 2012 to 2014 state it with one name too few, so the definition in a log is not used.
"""


def fields_of(names: str) -> tuple[str, ...]:
    """Return the field names of a format message, which joins them by commas."""
    return tuple(names.split(",")) if names else ()


def check_field_names(fmt: Format) -> tuple[str, ...]:
    """Return a remark if no firmware writes a message of this name with its fields in this order.

    The names are then damaged or exchanged: every value of the message has another field's name, or
    the gimbal's messages have an unknown name.
    """
    if fmt.name != "MNT" and {"Roll", "Pitch", "YawB", "YawE"} <= set(fmt.fields):
        return (f"{fmt.name} messages look like the gimbal's (MNT): not used, their name is odd",)
    for order in _ORDERS.get(fmt.name, ()):
        stated = [fmt.fields.index(field) for field in order if field in fmt.fields]
        if stated != sorted(stated):
            text = f"the format of {fmt.name} names {', '.join(order)} in an order of no firmware"
            return (f"{text}: its values may have wrong names",)
    return ()


def format_at(data: bytes, start: int) -> Format | None:
    """Return the format message at this offset; None if it is incomplete or invalid."""
    return _format_of(data[start + 3 : start + FMT_LENGTH])


@lru_cache(maxsize=1024)  # a log states some 200 formats, each read twice
def _format_of(body: bytes) -> Format | None:
    """Parse a format message without its header; None as in `format_at`."""
    if len(body) < FMT_LENGTH - 3:
        return None
    name, characters, fields = (
        part.split(b"\0")[0].decode("latin-1") for part in (body[2:6], body[6:22], body[22:86])
    )
    if (body[0], body[1], name) == (FMT.number, FMT.length, FMT.name):
        return FMT
    fmt = Format(body[0], body[1], name, characters, fields_of(fields))
    named = re.fullmatch(r"[A-Za-z0-9_]{1,4}", name) is not None
    return fmt if named and fmt.dtype() is not None else None
