"""PX4's ULog through pyulog, as columns on the boot clock: the one door to pyulog.

File format: https://docs.px4.io/main/en/dev_log/ulog_file_format.html. It has no checksum: what
reads these columns must judge the values.
"""

from __future__ import annotations

import io
import struct
from contextlib import redirect_stdout
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pyulog import ULog
from pyulog.exceptions import ULogException

from uavgram.errors import InputError
from uavgram.io.logs.quality.rows import LONGEST_BOOT_S, as_numbers
from uavgram.model.arrays import Floats

ULOG_MAGIC = b"ULog\x01\x12\x35"

# What pyulog raises on damaged bytes besides its own exception: it trusts lengths, names and types.
_ON_DAMAGE = (
    ULogException,
    ValueError,
    KeyError,
    IndexError,
    TypeError,
    AttributeError,
    OverflowError,
    RecursionError,
    struct.error,
)

_MOST_SHORT_READS = 1000


class _BoundedFile(io.BytesIO):
    """A file that ends a reading which goes round in circles.

    On damaged definitions pyulog steps back from the end of the file by more than it had read,
    for ever (pyulog 1.3.0, _read_file_definitions).
    """

    def __init__(self, data: bytes) -> None:
        super().__init__(data)
        self._left = 16 * len(data) + 65536
        self._short_reads = 0

    def read(self, size: int | None = -1, /) -> bytes:
        found = super().read(size)
        self._left -= len(found)
        if size is not None and len(found) < size:
            self._short_reads += 1
        if self._left < 0 or self._short_reads > _MOST_SHORT_READS:
            raise ULogException("its messages cannot be followed")
        return found


@dataclass(frozen=True, eq=False)
class Topic:
    """One instance of one topic, N rows.

    Attributes
    ----------
    name
        As PX4 calls it.
    time_s
        (N,) of publishing, seconds since boot.
    fields
        By name: (N,) as stored; an array's elements are ``q[0]``, ``q[1]``...
    """

    name: str
    time_s: Floats
    fields: dict[str, NDArray[Any]]

    def column(self, *names: str) -> Floats:
        """(N,) the first of these fields that exists, as float64; NaN where none does."""
        for name in names:
            if name in self.fields:
                return as_numbers(self.fields[name])
        return np.full(len(self.time_s), np.nan)

    def array(self, name: str, size: int) -> Floats:
        """(N, size) the elements of an array field."""
        return np.stack([self.column(f"{name}[{k}]") for k in range(size)], axis=1)


@dataclass(frozen=True, eq=False)
class UlogTables:
    """A ULog, read.

    Attributes
    ----------
    topics
        By name: its instances, the lowest number first.
    info
        What the header says of the system.
    parameters
        As they were when logging began.
    started_s
        What was taken off every time: 0, but where the boot clock shows the time of day.
    notes
        What was odd about the file.
    """

    topics: dict[str, tuple[Topic, ...]]
    info: dict[str, Any]
    parameters: dict[str, float]
    started_s: float
    notes: tuple[str, ...]

    def topic(self, *names: str) -> Topic | None:
        """The first instance with rows of the first of these topics that the log has."""
        for name in names:
            for topic in self.topics.get(name, ()):
                if len(topic.time_s):
                    return topic
        return None


def read_tables(path: str, data: bytes) -> UlogTables:
    """Read every topic of a ULog.

    Raises
    ------
    InputError
        The bytes are no ULog, or are damaged beyond use.
    """
    if not data.startswith(ULOG_MAGIC):
        raise InputError(path, "is no ULog: it does not begin as PX4 begins one")
    try:
        with redirect_stdout(io.StringIO()):  # pyulog prints its warnings
            log = ULog(_BoundedFile(data))
    except _ON_DAMAGE as error:
        raise InputError(
            path, f"is damaged beyond use ({type(error).__name__}: {error}); copy it once more"
        ) from error
    found = [d for d in log.data_list if "timestamp" in d.data and len(d.data["timestamp"])]
    found.sort(key=lambda d: (d.name, d.multi_id, -len(d.data["timestamp"])))
    started_s = _started_s([np.asarray(d.data["timestamp"], dtype=np.float64) for d in found])
    topics: dict[str, tuple[Topic, ...]] = {}
    for d in found:
        time_s = np.asarray(d.data["timestamp"], dtype=np.float64) * 1e-6 - started_s
        topics[d.name] = (*topics.get(d.name, ()), Topic(d.name, time_s, d.data))
    return UlogTables(
        topics=topics,
        info=dict(log.msg_info_dict),
        parameters=dict(log.initial_parameters),
        started_s=started_s,
        notes=_notes(log, started_s),
    )


def _started_s(times_us: list[Floats]) -> float:
    """What to take off the times: PX4's simulator has its boot clock show the time of day."""
    if not times_us:
        return 0.0
    times_s = max(times_us, key=len) * 1e-6
    middle = float(np.quantile(times_s, 0.5, method="lower"))
    if middle < LONGEST_BOOT_S:
        return 0.0
    return float(np.floor(times_s[np.abs(times_s - middle) < LONGEST_BOOT_S].min()))


def _notes(log: ULog, started_s: float) -> tuple[str, ...]:
    notes = []
    if log.file_corruption:
        notes.append("the file is damaged or cut: what could be read was read")
    if log.has_data_appended:
        notes.append("data was appended after a crash of the autopilot")
    if log.dropouts:
        longest = max(drop.duration for drop in log.dropouts) * 1e-3
        text = f"the logger lost data {len(log.dropouts)} times, {longest:.2f} s at the longest"
        notes.append(text)
    if started_s:
        text = "its boot clock shows the time of day (a simulator's): counted from the log's start"
        notes.append(text)
    return tuple(notes)
