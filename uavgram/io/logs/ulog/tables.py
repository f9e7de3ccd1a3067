"""PX4's ULog as columns on the boot clock, gathered from its messages piece by piece.

File format: https://docs.px4.io/main/en/dev_log/ulog_file_format.html. A message is its size (two
bytes, without the header), its kind (a letter), and its content; messages follow each other. A
topic's rows are messages of data; their composition, and key-value pairs of the system, are
definitions. There is no checksum: users of these columns must check the values.
"""

from __future__ import annotations

import itertools
import re
import struct
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from uavgram.errors import InputError
from uavgram.input_files import opened
from uavgram.io.logs.messages import Messages, Topic
from uavgram.io.logs.samples import LONGEST_BOOT_S
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
    for part, code in _flat(name, formats, "", (name,)):
        if part == "timestamp":
            time_at = size
        size += int(code[2:])
        if size > _LARGEST:
            return None
        columns.append((part, code))
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
    for kind, count, part in formats[name]:
        names = [part] if count is None else [f"{part}[{k}]" for k in range(count)]
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
            ADDED: self._register_topic,
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

    def _register_topic(self, body: bytes) -> bool:
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


ULOG_MAGIC = b"ULog\x01\x12\x35"
_FILE_HEADER = 16
_APPENDED = 1  # the only incompatible flag that exists
# Bytes read at a time: they fit into a processor's cache; fewer in a damaged file, where messages
# are searched again behind each damage.
_LEAST_BYTES, _MOST_BYTES = 1 << 12, 1 << 18


@dataclass(frozen=True, eq=False)
class Count:
    """Rows of a topic, of all its instances.

    Attributes
    ----------
    rows
        Number of rows.
    first_s, last_s
        Earliest and latest time since boot; NaN where none is stamped.
    """

    rows: int
    first_s: float
    last_s: float


@dataclass(frozen=True, eq=False)
class UlogTables(Messages):
    """Contents of a ULog.

    Attributes
    ----------
    topics
        By name, of the wanted ones: instances, the lowest number first.
    counts
        By name, of all topics that have rows.
    info
        Data of the system in the header.
    parameters
        As they were when logging began.
    wanted
        Names of the topics that were read; None: all.
    started_s
        Offset subtracted from every time: 0, unless the boot clock shows the time of day.
    notes
        Irregularities of the file.
    """

    topics: dict[str, tuple[Topic, ...]]
    counts: dict[str, Count]
    info: dict[str, Any]
    parameters: dict[str, Any]
    wanted: frozenset[str] | None
    started_s: float
    notes: tuple[str, ...]

    def instances(self, name: str) -> tuple[Topic, ...]:
        """Return all instances with rows of a topic, which must be among the wanted ones."""
        if self.wanted is not None and name not in self.wanted:
            raise KeyError(name)
        return self.topics.get(name, ())

    def read(self, name: str) -> Topic | None:
        """Return the first instance with rows of a topic."""
        return next(iter(self.instances(name)), None)


def read_tables(path: str | Path, wanted: Collection[str] | None = None) -> UlogTables:
    """Read topics of a ULog.

    Parameters
    ----------
    path
        The file.
    wanted
        Names of the topics to keep; None: all. The others are only counted.

    Raises
    ------
    InputError
        The file cannot be read, is not a ULog, or is of an unknown kind.
    """
    with opened(path, "name a flight log") as file:
        size = file.seek(0, 2)
        file.seek(0)
        head = file.read(_FILE_HEADER + HEADER + 40)
        if not size:
            raise InputError(path, "is empty: copy the log from the autopilot once more")
        if not head.startswith(ULOG_MAGIC):
            raise InputError(path, "is no ULog: it does not begin as PX4 begins one")
        flags, offsets = _flags(head)
        if flags[0] & ~_APPENDED or any(flags[1:]):
            raise InputError(
                path,
                "is a ULog of a kind that is not known here (its incompatible flags are "
                f"{flags.hex(' ')}), or damaged beyond use; copy it once more",
            )
        rows = Rows(wanted)
        inside = sorted({at for at in offsets if _FILE_HEADER < at < size})
        rows.damaged = len(inside) < len(offsets)
        for begin, end in itertools.pairwise((_FILE_HEADER, *inside, size)):
            _read_part(file, begin, end, rows, may_be_cut=end < size)
    return _tables(rows, wanted, appended=bool(flags[0]))


def _flags(head: bytes) -> tuple[bytes, list[int]]:
    """Return the incompatible flags, and the positions of appended data; none in old files."""
    flags, offsets = bytes(8), (0, 0, 0)
    content = head[_FILE_HEADER + HEADER :]
    if len(content) == 40 and head[_FILE_HEADER + 2] == FLAGS:
        flags, offsets = content[8:16], struct.unpack("<3Q", content[16:])
    return flags, [at for at in offsets if flags[0] & _APPENDED and at]


def _read_part(file: BinaryIO, begin: int, end: int, rows: Rows, *, may_be_cut: bool) -> None:
    """Gather the messages between two positions, of which the first is the start of one."""
    size = _LEAST_BYTES
    while begin < end:
        file.seek(begin)
        data = file.read(min(size + MAX_MESSAGE_BYTES, end - begin))
        if not data:
            return  # it became shorter meanwhile
        read, whole = rows.read(data, min(size, len(data)), may_be_cut=may_be_cut)
        begin += read
        size = min(2 * size, _MOST_BYTES) if whole else _LEAST_BYTES


def _tables(rows: Rows, wanted: Collection[str] | None, *, appended: bool) -> UlogTables:
    found = [s for s in rows.subscriptions if s.count]
    found.sort(key=lambda s: (s.name, s.instance, -s.count))
    kept = [(s, np.frombuffer(s.data, dtype=s.rows.dtype)) for s in found if s.kept]
    started_s = _find_time_offset_s(found, [table["timestamp"] for _, table in kept])
    topics: dict[str, tuple[Topic, ...]] = {}
    for s, table in kept:
        fields = {name: table[name] for name in table.dtype.names or ()}
        time_s = fields["timestamp"].astype(np.float64) * 1e-6 - started_s
        topics[s.name] = (*topics.get(s.name, ()), Topic(s.name, time_s, fields))
    by_name = itertools.groupby(found, key=lambda s: s.name)
    return UlogTables(
        topics=topics,
        counts={name: _count(list(same), started_s) for name, same in by_name},
        info=rows.info,
        parameters=rows.parameters,
        wanted=None if wanted is None else frozenset(wanted),
        started_s=started_s,
        notes=_notes(rows, started_s, appended=appended),
    )


def _count(same: list[Subscription], started_s: float) -> Count:
    first = [s.first_us for s in same if s.first_us is not None]
    last = [s.last_us for s in same if s.last_us is not None]
    return Count(
        sum(s.count for s in same),
        min(first) * 1e-6 - started_s if first else float("nan"),
        max(last) * 1e-6 - started_s if last else float("nan"),
    )


def _find_time_offset_s(found: list[Subscription], times_us: list[NDArray[np.uint64]]) -> float:
    """Return the offset of the times: PX4's simulator uses the time of day as its boot clock."""
    firsts = np.array([s.first_us for s in found if s.first_us is not None], dtype=np.float64)
    times_s = max(times_us, key=len, default=firsts).astype(np.float64) * 1e-6
    if not len(times_s):
        return 0.0
    middle = float(np.quantile(times_s, 0.5, method="lower"))
    if middle < LONGEST_BOOT_S:
        return 0.0
    return float(np.floor(times_s[np.abs(times_s - middle) < LONGEST_BOOT_S].min()))


def _notes(rows: Rows, started_s: float, *, appended: bool) -> tuple[str, ...]:
    notes = []
    if rows.damaged:
        notes.append("the file is damaged or cut: what could be read was read")
    if appended:
        notes.append("data was appended after a crash of the autopilot")
    if rows.dropouts_ms:
        longest = max(rows.dropouts_ms) * 1e-3
        text = f"the logger lost data {len(rows.dropouts_ms)} times, {longest:.2f} s at the longest"
        notes.append(text)
    if started_s:
        text = "its boot clock shows the time of day (a simulator's): counted from the log's start"
        notes.append(text)
    return tuple(notes)
