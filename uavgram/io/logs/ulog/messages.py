"""Where the messages of a ULog lie, and whether what lies somewhere can be one.

A message is its size (two bytes, what follows the header), its kind (a letter), and its content;
one follows the other. https://docs.px4.io/main/en/dev_log/ulog_file_format.html.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from uavgram.io.logs.ulog.formats import format_of, key_and_value
from uavgram.model.arrays import Bools, Ints

HEADER = 3
LONGEST = HEADER + 65535
DATA, SYNC, ADDED, FORMAT, DROPOUT = b"DSAFO"
FLAGS, INFO, PARAMETER = b"BIP"
_INFO_MULTIPLE, _PARAMETER_DEFAULT, _REMOVED, _LOGGED, _LOGGED_TAGGED = b"MQRLC"
_SYNC_CONTENT = b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"
_LEVELS = frozenset(b"01234567\0\1\2\3\4\5\6\7")
_KNOWN = np.zeros(256, dtype=bool)
_KNOWN[list(b"DSAFOBIPMQRLC")] = True

Fits = Callable[[int, int], bool]
"""Whether a row of a topic's number can have so many bytes."""


def chain(data: bytes, begin: int, stop: int) -> Ints:
    """Starts of messages that follow each other by their sizes, and the end of the last.

    Each starts before `stop`, which leaves room for a header.

    Parameters
    ----------
    data
        Bytes of the file.
    begin, stop
        From where to where.
    """
    # each size says where the next one stands: the one loop over messages
    starts: list[int] = []
    add = starts.append
    at = begin
    while at < stop:
        add(at)
        at += data[at] + (data[at + 1] << 8) + HEADER
    add(at)
    return np.array(starts, dtype=np.int64)


def is_wild(data: NDArray[np.uint8], edges: Ints) -> Bools:
    """(N,) of N + 1 edges of a chain: an unknown kind, nothing inside, or no end in the data."""
    starts, ends = edges[:-1], edges[1:]
    unknown = ~_KNOWN[data[starts + 2]]
    return np.asarray(unknown | (ends - starts == HEADER) | (ends > len(data)))


def is_sound(data: bytes, at: int, fits: Fits) -> bool:
    """Whether the bytes at a place make sense as a message in every respect.

    Parameters
    ----------
    data
        Bytes of the file.
    at
        The place.
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


def next_sound(data: bytes, begin: int, stop: int, fits: Fits) -> int:
    """The first place from `begin` on where a sound message lies before another; else `stop`.

    Parameters
    ----------
    data
        Bytes of the file.
    begin, stop
        From where to where.
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
