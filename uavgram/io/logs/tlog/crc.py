"""MAVLink's checksum (CRC-16/MCRF4XX) of many frames at once.

https://mavlink.io/en/guide/serialization.html#checksum: over the frame without its first byte,
followed by one byte that ties it to the message's definition.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from uavgram.model.arrays import Ints

_ROWS = 16384  # at a time: what a processor's cache holds


def _byte_table() -> NDArray[np.uint16]:
    """Checksum register after each byte, from zero (reflected polynomial 0x8408)."""
    table = np.arange(256, dtype=np.uint16)
    for _ in range(8):
        table = np.where(table & 1, (table >> 1) ^ np.uint16(0x8408), table >> 1)
    return table.astype(np.uint16)


def _word_table(by_byte: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """The same after each pair of bytes (little-endian): the register is as wide as the pair."""
    word = np.arange(65536, dtype=np.uint16)
    first = (word >> 8) ^ by_byte[word & 0xFF]
    return np.asarray((first >> 8) ^ by_byte[first & 0xFF], dtype=np.uint16)


_BY_BYTE = _byte_table()
_BY_WORD = _word_table(_BY_BYTE)


def checksums(
    data: NDArray[np.uint8], start: Ints, length: Ints, extra: NDArray[np.integer]
) -> NDArray[np.uint16]:
    """MAVLink checksum of N byte ranges.

    Parameters
    ----------
    data
        Bytes.
    start, length
        (N,) the ranges, inside of `data`.
    extra
        (N,) the message's own byte, appended to its range.

    Returns
    -------
    (N,)
    """
    result = np.full(len(start), 0xFFFF, dtype=np.uint16)
    order = np.argsort(length.astype(np.uint16), kind="stable")  # 16 bits: a radix sort
    edges = np.append(0, np.cumsum(np.bincount(length))).tolist() if len(length) else [0]
    for size, (begin, end) in enumerate(itertools.pairwise(edges)):
        for low in range(begin, end, _ROWS):
            rows = order[low : min(low + _ROWS, end)]
            result[rows] = _of_one_length(data, start[rows], size)
    return _step(result, extra.astype(np.uint8))


def _of_one_length(data: NDArray[np.uint8], start: Ints, length: int) -> NDArray[np.uint16]:
    crc = np.full(len(start), 0xFFFF, dtype=np.uint16)
    if not length:
        return crc
    ranges = np.lib.stride_tricks.sliding_window_view(data, length)[start]
    even = length - length % 2
    for word in np.ascontiguousarray(np.ascontiguousarray(ranges[:, :even]).view("<u2").T):
        # every register has its place in the table: `clip` only saves the test
        crc = _BY_WORD.take(crc ^ word, mode="clip")
    return crc if even == length else _step(crc, ranges[:, -1])


def _step(crc: NDArray[np.uint16], byte: NDArray[np.uint8]) -> NDArray[np.uint16]:
    stepped: NDArray[np.uint16] = (crc >> 8) ^ _BY_BYTE[(crc ^ byte) & 0xFF]
    return stepped
