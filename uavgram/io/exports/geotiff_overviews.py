"""Marks in a TIFF file that its further pictures are overviews of the first."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

# TIFF 6.0 (1992), pages 36 and 80: tags, a value of the first, and its type
NEW_SUBFILE_TYPE, SAMPLE_FORMAT = 254, 339
REDUCED, LONG = 1, 4


class _Layout(NamedTuple):
    """Formats of a directory's numbers: TIFF 6.0, page 13; the same in 64 bits in BigTIFF."""

    first_at: int
    offset: str
    number: str
    entry: str


_LAYOUTS = {
    b"II*\0": _Layout(4, "<I", "<H", "<HHII"),
    b"II+\0": _Layout(8, "<Q", "<Q", "<HHQQ"),
}


def mark_overviews(path: Path) -> None:
    """Mark all pictures of a file but the first as reductions of it.

    The entry replaces that of the sample format, which must exist (without it, the default is
    unsigned integers): so no directory grows, and no data is moved.

    Raises
    ------
    ValueError
        The file is not a little-endian TIFF, or a picture in it has no sample format.
    """
    with path.open("r+b") as file:
        head = file.read(4)
        if head not in _LAYOUTS:
            raise ValueError(f"{path} is no little-endian TIFF")
        layout = _LAYOUTS[head]
        for number, at in enumerate(_directories(file, layout)):
            if number:
                _mark(file, layout, at)


def _directories(file: BinaryIO, layout: _Layout) -> Iterator[int]:
    """Iterate over the positions of all directories."""
    at = _number(file, layout.first_at, layout.offset)
    while at:
        yield at
        entries = at + struct.calcsize(layout.number)
        past = entries + _number(file, at, layout.number) * struct.calcsize(layout.entry)
        at = _number(file, past, layout.offset)


def _mark(file: BinaryIO, layout: _Layout, at: int) -> None:
    count = _number(file, at, layout.number)
    first = at + struct.calcsize(layout.number)
    file.seek(first)
    written = file.read(count * struct.calcsize(layout.entry))
    entries = list(struct.iter_unpack(layout.entry, written))
    kept = [each for each in entries if each[0] != SAMPLE_FORMAT]
    if len(kept) != count - 1:
        raise ValueError(f"the picture at byte {at} has no sample format")
    file.seek(first)
    stated = (NEW_SUBFILE_TYPE, LONG, 1, REDUCED)  # entries are sorted by tag: this is the smallest
    file.writelines(struct.pack(layout.entry, *each) for each in (stated, *kept))


def _number(file: BinaryIO, at: int, form: str) -> int:
    file.seek(at)
    return int(struct.unpack(form, file.read(struct.calcsize(form)))[0])
