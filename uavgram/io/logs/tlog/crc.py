"""MAVLink's checksum (CRC-16/MCRF4XX) of many frames at once.

https://mavlink.io/en/guide/serialization.html#checksum: over the frame without its first byte,
followed by one byte that ties it to the message's definition.

A frame is a polynomial over GF(2), its first bit the highest; its checksum is the remainder modulo
P(x) = x^16 + x^12 + x^5 + 1. As P(x)^n = P(x^n) for every power of two n, modulo P x^16n is
x^12n + x^5n + 1: a few shifts take 64 bits from each of thousands of frames, where a table is
looked up for every byte. Checksums are reflected: in a little-endian word the lowest bit is that of
the highest power, and what multiplies by x^k shifts right.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavgram.model.arrays import Ints

Words = NDArray[np.integer[Any]]  # not signed

_ROWS = 8192  # at a time: what a processor's cache holds
_PAIR = 16  # bytes of two words, which shifts of whole words leave of each frame
_INITIAL = 0xFFFF  # of the register


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
    data: NDArray[np.uint8], start: Ints, length: NDArray[np.integer], extra: NDArray[np.integer]
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
    crc = np.empty(len(start), dtype=np.uint16)
    if not len(start):
        return crc
    end, short = start + length, length.astype(np.uint16)
    pairs = np.maximum((short + np.uint16(_PAIR - 1)) >> 4, np.uint16(1))
    before = _PAIR * int(pairs.max()) - int(end.min())
    if before > 0:  # the words of a range at the beginning of the file reach beyond it
        data, end = np.concatenate([np.zeros(before, np.uint8), data]), end + before
    order = np.argsort(pairs, kind="stable")  # 16 bits: a radix sort
    edges = np.append(0, np.cumsum(np.bincount(pairs))).tolist()
    initial = _of_zeros(int(short.max()))
    for count, (begin, stop) in enumerate(itertools.pairwise(edges)):
        for low in range(begin, stop, _ROWS):
            rows = order[low : min(low + _ROWS, stop)]
            own = short[rows]
            rest = _remainders(_words(data, end[rows], own, count))
            # times x^16, and what the register held before the first byte
            register = _BY_WORD.take(rest, mode="clip") ^ initial.take(own, mode="clip")
            crc[rows] = _step(register, extra[rows].astype(np.uint8))
    return crc


def items_at(data: NDArray[np.uint8], where: Ints, dtype: str) -> NDArray[Any]:
    """(N,) items that begin at any bytes, each copied at once.

    Parameters
    ----------
    data
        Bytes.
    where
        (N,) first bytes, so that items end inside of `data`.
    dtype
        Of the items.
    """
    count = max(len(data) - np.dtype(dtype).itemsize + 1, 0)
    return np.ndarray((count,), dtype, data, strides=(1,))[where]


def _words(
    data: NDArray[np.uint8], end: Ints, length: NDArray[np.uint16], count: int
) -> NDArray[np.uint64]:
    """(2 count, N) the words up to the ends of ranges, zero before their beginnings."""
    size = _PAIR * count
    items = items_at(data, end - size, f"V{size}")
    words = np.ascontiguousarray(items.view("<u8").reshape(-1, 2 * count).T)
    outside = 8 * (size - length.astype(np.uint64))  # bits; of 64 and more nothing is left
    beyond = np.maximum(outside, np.uint64(64)) - np.uint64(64)
    words[0] = words[0] >> outside << outside
    words[1] = words[1] >> beyond << beyond
    return words


def _remainders(words: NDArray[np.uint64]) -> NDArray[np.uint16]:
    """(N,) of polynomials in (2 count, N) words, which are used up."""
    for k in range(len(words) - 2):
        first = words[k]
        first ^= first << 32  # x^128 is x^96 + x^40 + 1: x^96 of its upper half is x^128 again
        words[k + 1] ^= (first >> 32) ^ (first << 24)
        words[k + 2] ^= first ^ (first >> 40)
    both = _low_half(words[-2], words[-1], 4).view(np.uint32)
    both = _low_half(both[::2].copy(), both[1::2].copy(), 2).view(np.uint16)
    return _low_half(both[::2].copy(), both[1::2].copy(), 1).view(np.uint16)


def _low_half(high: Words, low: Words, n: int) -> Words:
    """(N,) remainders modulo P(x^n), of 16n bits, of polynomials of twice as many.

    The quotient is that of the upper half by 1 + x^-4n + x^-11n + x^-16n, whose inverse is
    1 + x^-4n + x^-8n + x^-11n + x^-12n as far as there are bits.
    """
    quotient = high ^ (high << 4 * n) ^ (high << 8 * n) ^ (high << 11 * n) ^ (high << 12 * n)
    rest: Words = low ^ quotient ^ (quotient >> 5 * n) ^ (quotient >> 12 * n)
    return rest


def _of_zeros(most: int) -> NDArray[np.uint16]:
    """(most + 1,) the register after so many zero bytes."""
    by_byte, register = _BY_BYTE.tolist(), [_INITIAL]
    for _ in range(most):
        register.append(register[-1] >> 8 ^ by_byte[register[-1] & 0xFF])
    return np.array(register, dtype=np.uint16)


def _step(crc: NDArray[np.uint16], byte: NDArray[np.uint8]) -> NDArray[np.uint16]:
    stepped: NDArray[np.uint16] = (crc >> 8) ^ _BY_BYTE[(crc ^ byte) & 0xFF]
    return stepped
