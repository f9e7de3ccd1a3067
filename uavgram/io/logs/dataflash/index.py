"""Where every message of a binary DataFlash file begins."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

from uavgram.io.logs.dataflash.formats import FMT_LENGTH, FMT_TYPE, HEADER, format_at

#: Offsets of the messages of each of the 256 types, in the order of the file.
Starts = list[list[int]]


def indexed_by_pymavlink(data: bytes) -> Starts | None:
    """Pymavlink's compiled indexer (since 2.4.50); None where this pymavlink has none."""
    try:
        from pymavlink import dfindexer  # noqa: PLC0415 - absent in older releases
    except ImportError:
        return None
    if not dfindexer.available:
        return None
    with _silent_standard_error():  # it prints one line for every byte that it skips
        starts: Starts = dfindexer.build_offsets(
            memoryview(data), FMT_TYPE, FMT_LENGTH, 3, 4, HEADER[0], HEADER[1]
        )
    return starts


def indexed_by_loop(
    data: bytes, first: int = 0, known_lengths: dict[int, int] | None = None
) -> Starts:
    """The same without the compiled indexer; believes format messages that make sense only.

    Parameters
    ----------
    data
        Bytes of the file.
    first
        Where to begin.
    known_lengths
        Bytes of a message by its type, as stated before `first`.
    """
    starts: Starts = [[] for _ in range(256)]
    lengths = [0] * 256
    for number, length in (known_lengths or {}).items():
        lengths[number] = length
    lengths[FMT_TYPE] = FMT_LENGTH
    at = data.find(HEADER, first)
    while 0 <= at < len(data) - 2:
        number = data[at + 2]
        fmt = format_at(data, at) if number == FMT_TYPE else None
        if fmt is not None:
            lengths[fmt.number] = fmt.length
        if not lengths[number] or (number == FMT_TYPE and fmt is None):
            at = data.find(HEADER, at + 1)
            continue
        starts[number].append(at)
        end = at + lengths[number]
        # where no message follows, bytes are missing or damaged: look from inside this one
        at = end if data[end : end + 2] == HEADER else data.find(HEADER, at + 3)
    return starts


@contextmanager
def _silent_standard_error() -> Iterator[None]:
    """Send file descriptor 2 to nowhere: C code does not write through sys.stderr."""
    kept = os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)
