"""PX4's ULog as columns on the boot clock.

File format: https://docs.px4.io/main/en/dev_log/ulog_file_format.html. It has no checksum: users of
these columns must check the values.
"""

from __future__ import annotations

import itertools
import struct
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from uavgram.errors import InputError
from uavgram.input_files import opened
from uavgram.io.logs.quality.rows import LONGEST_BOOT_S
from uavgram.io.logs.topics import Messages, Topic
from uavgram.io.logs.ulog.messages import FLAGS, HEADER, MAX_MESSAGE_BYTES
from uavgram.io.logs.ulog.rows import Rows, Subscription

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
    started_s = _started_s(found, [table["timestamp"] for _, table in kept])
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


def _started_s(found: list[Subscription], times_us: list[NDArray[np.uint64]]) -> float:
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
