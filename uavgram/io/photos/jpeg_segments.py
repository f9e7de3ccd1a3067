"""JPEG files as markers with their segments (ITU-T T.81, annex B); pixels are not touched."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass

SOI, APP0, APP1, SOS, EOI = 0xD8, 0xE0, 0xE1, 0xDA, 0xD9
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


def parse_jpeg(data: bytes) -> Jpeg | None:
    """Split a JPEG file; None where it is none, or its segments are cut short."""
    if not data.startswith(b"\xff\xd8"):
        return None
    at = 2
    segments: list[Segment] = []
    while at + 4 <= len(data):
        if data[at] != 0xFF:
            return None
        marker = data[at + 1]
        if marker == 0xFF:  # fill byte
            at += 1
            continue
        if marker in (SOS, EOI):
            return Jpeg(tuple(segments), data[at:])
        if marker in _ALONE:
            at += 2
            continue
        (length,) = struct.unpack_from(">H", data, at + 2)
        if length < 2 or at + 2 + length > len(data):
            return None
        segments.append(Segment(marker, data[at + 4 : at + 2 + length]))
        at += 2 + length
    return None


def build_jpeg(segments: Iterable[Segment], scan: bytes) -> bytes:
    """Join segments and scan to a file.

    Raises
    ------
    ValueError
        A segment is longer than the format allows.
    """
    parts = [b"\xff\xd8"]
    for segment in segments:
        if len(segment.payload) > LARGEST_SEGMENT:
            raise ValueError(f"segment of {len(segment.payload)} bytes: at most {LARGEST_SEGMENT}")
        head = struct.pack(">BBH", 0xFF, segment.marker, len(segment.payload) + 2)
        parts += [head, segment.payload]
    return b"".join([*parts, scan])
