"""Format messages of ArduPilot's DataFlash logs: what each message type holds.

The layout is ArduPilot's (libraries/AP_Logger/LogStructure.h): every message starts with
0xA3 0x95 and its type; type 0x80 (FMT) defines the others: length, name, one format character per
field, field names. A message may have no field at all (STRT until 2014: the vehicle was started).
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

# Format character: numpy type, and what the stored integer is divided by.
# Division, not multiplication by 0.01 or 1e-7: 12345 / 100 is the double nearest to 123.45.
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
# In which order every firmware since 3.3 writes the fields that are read here.
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
    """One message type as a file defines it.

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
        """Structured type of the bytes after the header; None where the format makes no sense."""
        dtype = _record_type(self.fields, self.characters)
        return dtype if dtype is not None and dtype.itemsize + 3 == self.length else None

    def decoded(self, data: NDArray[np.uint8], starts: NDArray[np.int64]) -> Columns:
        """Every field as a column, scaled as its format character says.

        Parameters
        ----------
        data
            Bytes of the file.
        starts
            (N,) where complete messages of this format begin.
        """
        dtype = self.dtype()
        if not dtype:  # no format, or one without fields
            return {}
        # a record could begin at every byte behind a header
        room = len(data) - self.length + 1
        records = np.ndarray((room,), dtype, data, offset=3, strides=(1,))[starts]
        return {
            field: _scaled(records[field], _NUMPY_TYPES[c][1])
            for field, c in zip(self.fields, self.characters, strict=True)
        }


def _scaled(raw: NDArray[Any], divisor: float | None) -> NDArray[Any]:
    return np.ascontiguousarray(raw) if divisor is None else raw / divisor


FMT = Format(FMT_TYPE, FMT_LENGTH, "FMT", "BBnNZ", ("Type", "Length", "Name", "Format", "Columns"))
"""The layout of all format messages. The logs of 2012 to 2014 state it with one name too few, so
what a log says of it is not needed."""


def fields_of(names: str) -> tuple[str, ...]:
    """Field names of a format message, which joins them by commas."""
    return tuple(names.split(",")) if names else ()


def odd_names(fmt: Format) -> tuple[str, ...]:
    """A remark where no firmware writes a message of this name with these fields in this order.

    The names are then damaged or exchanged: every value of the message stands under another, or
    the gimbal's messages under a name that nobody reads.
    """
    if fmt.name != "MNT" and {"Roll", "Pitch", "YawB", "YawE"} <= set(fmt.fields):
        return (f"{fmt.name} messages look like the gimbal's (MNT): not used, their name is odd",)
    for order in _ORDERS.get(fmt.name, ()):
        stated = [fmt.fields.index(field) for field in order if field in fmt.fields]
        if stated != sorted(stated):
            text = f"the format of {fmt.name} names {', '.join(order)} in an order of no firmware"
            return (f"{text}: its values may stand under wrong names",)
    return ()


def format_at(data: bytes, start: int) -> Format | None:
    """The format message that begins here; None where it is cut or makes no sense."""
    return _format_of(data[start + 3 : start + FMT_LENGTH])


@lru_cache(maxsize=1024)  # a log states some 200 formats, each read by the index and for its tables
def _format_of(body: bytes) -> Format | None:
    """The format that a message without its header states, as above."""
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
