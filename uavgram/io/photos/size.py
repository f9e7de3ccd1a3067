"""Width and height of a photo from its header: no pixel is decoded."""

from __future__ import annotations

import mmap
import struct
from pathlib import Path
from typing import BinaryIO

import cv2

from uavgram.errors import InputError, no_file
from uavgram.io.photos.exif import read_exif_tags

_TIFF = (b"II*\0", b"MM\0*")
_PNG = b"\x89PNG\r\n\x1a\n"
_TIFF_SIDES = ("ImageWidth", "ImageLength")
# Start-of-frame markers of JPEG (ITU-T T.81, table B.1); 0xC4, 0xC8 and 0xCC are none.
_JPEG_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_JPEG_ALONE = frozenset({0x01, *range(0xD0, 0xD8)})  # markers without a segment


def image_size(path: str | Path) -> tuple[int, int]:
    """Width and height [px] of the stored, unrotated image.

    JPEG, PNG and TIFF are read from their headers; every other kind is decoded by OpenCV. Of a JPEG
    the end is looked for too: without it nothing of it can be decoded.

    Raises
    ------
    InputError
        The file is missing, cut off, or no photo.
    """
    if what := no_file(path):
        raise InputError(path, f"is {what}: take it out of `images`")
    is_whole = True
    try:
        with Path(path).open("rb") as file:
            head = file.read(26)
            if head[:2] == b"\xff\xd8":
                file.seek(2)
                size = _jpeg_size(file)
                is_whole = _has_end(file)
            elif head[:8] == _PNG and len(head) >= 24:
                size = struct.unpack(">II", head[16:24])
            elif head[:4] in _TIFF:
                size = _tiff_size(path)
            else:
                size = _decoded_size(path)
    except OSError as error:
        raise InputError(path, f"cannot be read: {error.strerror}") from error
    if size is None or min(size) <= 0:
        raise InputError(path, "is no photo that can be read; take it out of `images`")
    if not is_whole:
        raise InputError(
            path,
            "is cut off, the end of the picture is missing: copy it from the camera once more, or "
            "take it out of `images`",
        )
    return int(size[0]), int(size[1])


def _jpeg_size(file: BinaryIO) -> tuple[int, int] | None:
    while True:
        byte = file.read(1)
        if not byte:
            return None
        if byte != b"\xff":
            return None
        marker = file.read(1)
        while marker == b"\xff":  # fill bytes
            marker = file.read(1)
        if not marker or marker[0] in (0xD9, 0xDA):
            return None
        if marker[0] in _JPEG_ALONE:
            continue
        segment = file.read(2)
        if len(segment) < 2:
            return None
        length = int.from_bytes(segment, "big")
        if marker[0] in _JPEG_FRAMES:
            frame = file.read(5)
            if len(frame) < 5:
                return None
            height, width = struct.unpack(">HH", frame[1:5])
            return int(width), int(height)
        file.seek(length - 2, 1)


def _has_end(file: BinaryIO) -> bool:
    """Whether a JPEG's end marker stands somewhere behind its frame header, where `file` is."""
    with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        return content.rfind(b"\xff\xd9", file.tell()) >= 0


def _tiff_size(path: str | Path) -> tuple[int, int] | None:
    """Size of the first picture: a header can ask a decoder for gigabytes that are not there."""
    tags = read_exif_tags(path)
    sides = [getattr(tags.get(f"Image {name}"), "values", []) for name in _TIFF_SIDES]
    numbers = [side[0] for side in sides if side and isinstance(side[0], int)]
    return (numbers[0], numbers[1]) if len(numbers) == 2 else None


def _decoded_size(path: str | Path) -> tuple[int, int] | None:
    if not cv2.haveImageReader(str(path)):
        return None
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED | cv2.IMREAD_IGNORE_ORIENTATION)
    if image is None:
        return None
    return image.shape[1], image.shape[0]
