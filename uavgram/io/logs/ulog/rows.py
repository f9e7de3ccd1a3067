"""Contents of a ULog, gathered piece by piece: rows of topics, and data of the system."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavgram.io.logs.ulog.messages import (
    ADDED,
    DATA,
    DROPOUT,
    FORMAT,
    HEADER,
    INFO,
    PARAMETER,
    Field,
    RowType,
    find_next_sound,
    follow_sizes,
    format_of,
    is_implausible,
    is_sound,
    key_and_value,
    row_type,
)
from uavgram.model.arrays import Ints

_ROW = HEADER + 2  # of a message of data: behind the number of its topic
_FIRST_OF_DATA = b"ALC"  # kinds of messages that end the definitions
_UNSTAMPED = 2**64 - 1
_STATING = np.zeros(256, dtype=bool)
_STATING[[ADDED, DROPOUT, FORMAT, INFO, PARAMETER]] = True


@dataclass(eq=False)
class Subscription:
    """Rows of one instance of one topic, read so far.

    Attributes
    ----------
    name, instance
        Of the topic.
    rows
        Layout of a row.
    kept
        Whether rows are kept, not only counted.
    data
        The kept rows, one after the other.
    count, first_us, last_us
        Of all rows: number; earliest and latest time, of those that are not 0.
    """

    name: str
    instance: int
    rows: RowType
    kept: bool
    data: bytearray = field(default_factory=bytearray)
    count: int = 0
    first_us: int | None = None
    last_us: int | None = None

    def take(self, data: NDArray[np.uint8], starts: Ints) -> None:
        """Append the rows at these offsets."""
        self.data += _items(data, np.dtype((np.void, self.rows.dtype.itemsize)), starts).tobytes()

    def tally(self, count: int, first_us: int, last_us: int) -> None:
        """Count rows.

        Parameters
        ----------
        count
            Number of rows.
        first_us, last_us
            Their earliest and latest time; _UNSTAMPED where all are 0: never published.
        """
        self.count += count
        if first_us != _UNSTAMPED:
            self.first_us = first_us if self.first_us is None else min(self.first_us, first_us)
            self.last_us = last_us if self.last_us is None else max(self.last_us, last_us)


class Rows:
    """Contents gathered from one file.

    Parameters
    ----------
    wanted
        Names of the topics whose rows are kept; None: all.

    Attributes
    ----------
    subscriptions
        In the order in which the file begins them.
    info, parameters
        Data of the system; parameters as they were when logging began.
    dropouts_ms
        Duration of each loss of data.
    damaged
        Whether invalid bytes were found.
    """

    def __init__(self, wanted: Collection[str] | None) -> None:
        self.subscriptions: list[Subscription] = []
        self.info: dict[str, Any] = {}
        self.parameters: dict[str, Any] = {}
        self.dropouts_ms: list[int] = []
        self.damaged = False
        self._wanted = wanted
        self._formats: dict[str, tuple[Field, ...]] = {}
        self._defining = True
        self._by_number: dict[int, Subscription] = {}
        # by topic number: bytes of the shortest and longest row; none fits an unknown topic
        self._shortest = np.full(65536, 65536)
        self._longest = np.zeros(65536, dtype=np.int64)
        self._time_at = np.zeros(65536, dtype=np.int64)
        self._states: dict[int, Callable[[bytes], bool]] = {
            ADDED: self._added,
            DROPOUT: self._dropout,
            FORMAT: self._format,
            INFO: lambda body: _put(self.info, body),
            PARAMETER: self._parameter,
        }

    def read(self, data: bytes, stop: int, *, may_be_cut: bool) -> tuple[int, bool]:
        """Gather the messages that start before a position.

        Parameters
        ----------
        data
            Bytes, from the start of a message on.
        stop
            Position at which to stop: `data` contains every message that starts before it
            completely, or ends with the file.
        may_be_cut
            Whether a message that ends behind the data is no damage.

        Returns
        -------
        Start of the next message, and whether these were free of damage.
        """
        if len(data) < HEADER:  # the file ends inside of a header
            self.damaged |= not may_be_cut
            return len(data), True
        array = np.frombuffer(data, dtype=np.uint8)
        edges = follow_sizes(data, 0, min(stop, len(data) - HEADER + 1))
        wild = np.flatnonzero(is_implausible(array, edges))
        count = int(wild[0]) if len(wild) else len(edges) - 1
        self._gather(data, array, edges[: count + 1])
        if not len(wild):
            return int(edges[-1]), True
        self.damaged |= not may_be_cut or bool(edges[count + 1] <= len(data))
        # the chain is wrong after the last message that is valid in every respect
        while count and not is_sound(data, int(edges[count - 1]), self._fits):
            count -= 1
        return find_next_sound(data, int(edges[count]) + 1, stop, self._fits), False

    def _fits(self, number: int, size: int) -> bool:
        return bool(self._shortest[number] <= size <= self._longest[number])

    def _gather(self, data: bytes, array: NDArray[np.uint8], edges: Ints) -> None:
        """Gather a chain of messages in their order: definitions, and the rows between them."""
        starts, ends = edges[:-1], edges[1:]
        kind = array[starts + 2]
        rows = np.flatnonzero(kind == DATA)
        done = 0
        for k in np.flatnonzero(_STATING[kind]).tolist():
            if kind[k] == ADDED:  # from here on a number may denote another topic
                here = int(np.searchsorted(rows, k))
                self._take(array, starts[rows[done:here]], ends[rows[done:here]])
                done = here
            if not self._states[int(kind[k])](data[starts[k] + HEADER : ends[k]]):
                self.damaged = True
            self._defining = self._defining and kind[k] != ADDED
        self._take(array, starts[rows[done:]], ends[rows[done:]])
        self._defining = self._defining and not np.isin(kind, list(_FIRST_OF_DATA)).any()

    def _take(self, array: NDArray[np.uint8], starts: Ints, ends: Ints) -> None:
        if not len(starts):
            return
        size = ends - starts - _ROW
        long = np.flatnonzero(size >= 0)
        number = np.zeros(len(starts), dtype=np.uint16)
        number[long] = array[starts[long] + HEADER]
        number[long] |= array[starts[long] + HEADER + 1].astype(np.uint16) << 8
        fits = (size >= self._shortest[number]) & (size <= self._longest[number])
        if not fits.all():
            self.damaged = True
            starts, number = starts[fits], number[fits]
        if not len(starts):
            return
        order = np.argsort(number, kind="stable")  # 16 bits: a radix sort
        number, at = number[order], starts[order] + _ROW
        times = _items(array, np.dtype("<u8"), at + self._time_at[number])
        begin = np.flatnonzero(np.append(True, number[1:] != number[:-1]))
        stamped = np.where(times > 0, times, np.uint64(_UNSTAMPED))
        first = np.minimum.reduceat(stamped, begin).tolist()
        last = np.maximum.reduceat(times, begin).tolist()
        edges = [*begin.tolist(), len(at)]
        for k, topic in enumerate(number[begin].tolist()):
            subscription = self._by_number[topic]
            subscription.tally(edges[k + 1] - edges[k], first[k], last[k])
            if subscription.kept:
                subscription.take(array, at[edges[k] : edges[k + 1]])

    def _added(self, body: bytes) -> bool:
        """Register a topic under a number."""
        if len(body) < 4:
            return False
        name = body[3:].decode("latin-1")
        made = row_type(name, self._formats) if name in self._formats else None
        if made is None:
            return False
        number = body[1] | body[2] << 8
        known = self._by_number.get(number)
        if known is None or (known.name, known.instance, known.rows) != (name, body[0], made):
            known = Subscription(name, body[0], made, self._wanted is None or name in self._wanted)
            self.subscriptions.append(known)
            self._by_number[number] = known
            self._shortest[number], self._longest[number] = made.dtype.itemsize, made.longest
            self._time_at[number] = made.time_at
        return True

    def _format(self, body: bytes) -> bool:
        found = format_of(body)
        if found is not None:
            self._formats[found[0]] = found[1]
        return found is not None

    def _parameter(self, body: bytes) -> bool:
        return _put(self.parameters if self._defining else {}, body)

    def _dropout(self, body: bytes) -> bool:
        self.dropouts_ms.append(int.from_bytes(body[:2], "little"))
        return len(body) == 2


def _items(data: NDArray[np.uint8], dtype: np.dtype[Any], starts: Ints) -> NDArray[Any]:
    """Return the (N,) items at these bytes."""
    room = len(data) - dtype.itemsize + 1
    items: NDArray[Any] = np.ndarray((room,), dtype, data, strides=(1,))[starts]
    return items


def _put(known: dict[str, Any], body: bytes) -> bool:
    found = key_and_value(body)
    if found is not None:
        known[found[0]] = found[1]
    return found is not None
