"""Messages of a flight log as columns, rows of a format's table, and MAVLink's definitions.

For each quantity a table names the fields and messages that state it: see `boots.py`.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, cached_property
from importlib import import_module
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from uavgram.model.arrays import Bools, Floats

T = TypeVar("T")
Found = tuple[T | None, tuple[str, ...]]
"""Samples from a log, None where it has none; and remarks on irregularities."""


def convert_to_numbers(column: NDArray[Any]) -> Floats:
    """Return a column (N,) as float64; NaN if damaged formats made a text or an array of it."""
    if column.ndim != 1 or column.dtype.kind not in "biuf":
        return np.full(len(column), np.nan)
    with np.errstate(invalid="ignore"):  # signalling NaN
        return np.asarray(column, dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Topic:
    """The messages of one kind, N of them.

    Attributes
    ----------
    name
        Name given by the autopilot.
    time_s
        (N,) seconds since boot; NaN where a message states none.
    fields
        By name: (N,) as stored; an array's elements are ``q[0]``, ``q[1]``...
    """

    name: str
    time_s: Floats
    fields: dict[str, NDArray[Any]]

    def column(self, *names: str) -> Floats:
        """Return the first of these fields that exists (N,), as float64; NaN where none does."""
        for name in names:
            if name in self.fields:
                return convert_to_numbers(self.fields[name])
        return np.full(len(self.time_s), np.nan)

    def texts(self, name: str) -> list[str]:
        """Return the texts of a field; none if damaged formats made numbers of it."""
        stored = self.fields.get(name)
        if stored is None or stored.dtype.kind not in "SO":
            return []
        return [bytes(text).split(b"\0")[0].decode("latin-1") for text in stored]

    def only(self, keep: NDArray[Any]) -> Topic:
        """Return selected messages, by a mask (N,) or by their numbers."""
        fields = {name: values[keep] for name, values in self.fields.items()}
        return Topic(self.name, self.time_s[keep], fields)


Message = str | Callable[[Any], Topic | None]
"""Name of a kind of message; or a function that makes one from a format's own messages."""


class Messages(ABC):
    """All messages of one boot. A format derives its own class from it."""

    @cached_property
    def _known(self) -> dict[Message, Topic | None]:
        return {}

    @abstractmethod
    def read(self, name: str) -> Topic | None:
        """Return the messages of one kind; None where the log has none."""

    def topic(self, *wanted: Message) -> Topic | None:
        """Return the first of these kinds of messages that the log has; each is read once."""
        for message in wanted:
            if message not in self._known:
                self._known[message] = (
                    self.read(message) if isinstance(message, str) else message(self)
                )
            if (found := self._known[message]) is not None:
                return found
        return None


@dataclass(frozen=True, eq=False)
class StatedValues:
    """Values of one quantity in N messages.

    Attributes
    ----------
    source
        Name of the message.
    time_s
        (N,) since boot.
    columns
        (N,) each, in SI units (positions in degrees; angles too, where `boots.Table` has them so).
    valid
        (N,) messages with values; None for all.
    """

    source: str
    time_s: Floats
    columns: tuple[Floats, ...]
    valid: Bools | None = None


@dataclass(frozen=True, eq=False)
class Row:
    """A row of a format's table: the fields that state a quantity, and their unit.

    Attributes
    ----------
    message
        The kind of message, or several of the same form: the first that the log has is read.
    fields
        In the order that the quantity has in `boots.Table`; alternative names as a tuple.
    per
        Number of stored units in one of ours: 1e7 where 1e-7 degrees are stored. One for all
        fields, or one for each.
    factor
        Factor of all fields, where the unit is known in this form.
    valid
        Function that marks the messages (N,) with values; None for all.
    source
        Name of the samples; empty for the message's.
    remark
        Remark on these samples, where they are used.
    """

    message: Message | tuple[Message, ...]
    fields: tuple[str | tuple[str, ...], ...]
    per: float | tuple[float, ...] = 1.0
    factor: float = 1.0
    valid: Callable[[Topic], Bools] | None = field(default=None, kw_only=True)
    source: str = field(default="", kw_only=True)
    remark: str = field(default="", kw_only=True)

    def read_values(self, messages: Messages) -> StatedValues | None:
        """Return the values in the log's messages; None where it has none of them."""
        wanted = self.message if isinstance(self.message, tuple) else (self.message,)
        topic = messages.topic(*wanted)
        if topic is None:
            return None
        per = self.per if isinstance(self.per, tuple) else (self.per,) * len(self.fields)
        columns = [
            topic.column(*((names,) if isinstance(names, str) else names)) * self.factor / unit
            for names, unit in zip(self.fields, per, strict=True)
        ]
        valid = None if self.valid is None else self.valid(topic)
        return StatedValues(self.source or topic.name, topic.time_s, tuple(columns), valid)


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
    for part, (length, code) in zip(message.ordered_fieldnames, codes, strict=True):
        if code == "s":
            fields.append((part, f"S{length}"))
        else:
            fields.append((part, f"({length},){_KINDS[code]}" if length else _KINDS[code]))
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
