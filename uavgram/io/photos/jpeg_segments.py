"""JPEG files as markers with their segments (ITU-T T.81, annex B); pixels are not touched."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from mmap import mmap

APP0, APP1, SOS, EOI = 0xE0, 0xE1, 0xDA, 0xD9
START = b"\xff\xd8"
EXIF_HEAD = b"Exif\x00\x00"
XMP_HEAD = b"http://ns.adobe.com/xap/1.0/\x00"
LARGEST_SEGMENT = 65533
_ALONE = {0x01, *range(0xD0, 0xD9)}  # TEM, RSTn, SOI: no length follows


@dataclass(frozen=True)
class Segment:
    """A marker (its second byte) with its payload, without marker and length."""

    marker: int
    payload: bytes


@dataclass(frozen=True)
class Jpeg:
    """What lies before the first scan as segments, and everything from there on as it is."""

    segments: tuple[Segment, ...]
    scan: bytes

    def app1(self, head: bytes) -> bytes | None:
        """Payload behind `head` of the first APP1 segment that begins with it."""
        for segment in self.segments:
            if segment.marker == APP1 and segment.payload.startswith(head):
                return segment.payload[len(head) :]
        return None


def read_segments(data: bytes | mmap) -> Iterator[tuple[Segment, int]]:
    """Segments of a JPEG file, each with the byte at which it ends; none where it is no JPEG.

    The last one, without payload, is the marker of the first scan (or of the end): where none
    comes, the file is cut short.
    """
    at = 2 if data[:2] == START else len(data)
    while at + 4 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        if marker == 0xFF:  # fill byte
            at += 1
        elif marker in _ALONE:
            at += 2
        elif marker in (SOS, EOI):
            yield Segment(marker, b""), at
            return
        else:
            (length,) = struct.unpack_from(">H", data, at + 2)
            if length < 2 or at + 2 + length > len(data):
                return
            yield Segment(marker, data[at + 4 : at + 2 + length]), at + 2 + length
            at += 2 + length


def parse_jpeg(data: bytes) -> Jpeg | None:
    """Split a JPEG file; None where it is none, or its segments are cut short."""
    found = list(read_segments(data))
    if not found or found[-1][0].marker not in (SOS, EOI):
        return None
    return Jpeg(tuple(segment for segment, _ in found[:-1]), data[found[-1][1] :])


def build_jpeg(segments: Iterable[Segment], scan: bytes) -> bytes:
    """Join segments and scan to a file.

    Raises
    ------
    ValueError
        A segment is longer than the format allows.
    """
    parts = [START]
    for segment in segments:
        if len(segment.payload) > LARGEST_SEGMENT:
            raise ValueError(f"segment of {len(segment.payload)} bytes: at most {LARGEST_SEGMENT}")
        head = struct.pack(">BBH", 0xFF, segment.marker, len(segment.payload) + 2)
        parts += [head, segment.payload]
    return b"".join([*parts, scan])
