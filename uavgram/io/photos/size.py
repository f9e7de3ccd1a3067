"""Width and height of a photo from its header, without decoding."""

from __future__ import annotations

import mmap
import struct
from pathlib import Path

import cv2
import numpy as np

from uavgram.errors import InputError, no_file
from uavgram.input_files import refuse_unread
from uavgram.io.photos.metadata import START, read_exif_tags, read_segments

_TIFF = (b"II*\0", b"MM\0*")
_PNG = b"\x89PNG\r\n\x1a\n"
_TIFF_SIDES = ("ImageWidth", "ImageLength")
# Start-of-frame markers of JPEG (ITU-T T.81, table B.1), without 0xC4, 0xC8 and 0xCC.
_JPEG_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}


def image_size(path: str | Path) -> tuple[int, int]:
    """Read width and height [px] of the stored, unrotated image.

    JPEG, PNG and TIFF are read from their headers; every other format is decoded by OpenCV. A JPEG
    is also checked for its end marker: a truncated file cannot be decoded.

    Raises
    ------
    InputError
        The file is missing, truncated, of an unsupported format, or not a photo.
    """
    if what := no_file(path):
        raise InputError(path, f"is {what}: take it out of `images`")
    refuse_unread(path)
    is_whole = True
    try:
        with Path(path).open("rb") as file:
            head = file.read(26)
            if head.startswith(START):
                with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
                    size, is_whole = _jpeg_size(content)
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


def _jpeg_size(content: mmap.mmap) -> tuple[tuple[int, int] | None, bool]:
    """Read the size, and whether the end marker is somewhere after the frame header."""
    for segment, end in read_segments(content):
        if segment.marker in _JPEG_FRAMES and len(segment.payload) >= 5:
            height, width = struct.unpack_from(">HH", segment.payload, 1)
            return (width, height), content.rfind(b"\xff\xd9", end) >= 0
    return None, True


def _tiff_size(path: str | Path) -> tuple[int, int] | None:
    """Read the size of the first picture from the tags.

    A decoder could be made to allocate gigabytes by a false header.
    """
    tags = read_exif_tags(path)
    sides = [getattr(tags.get(f"Image {name}"), "values", []) for name in _TIFF_SIDES]
    numbers = [side[0] for side in sides if side and isinstance(side[0], int)]
    return (numbers[0], numbers[1]) if len(numbers) == 2 else None


def _decoded_size(path: str | Path) -> tuple[int, int] | None:
    if str(path).isascii() and not cv2.haveImageReader(str(path)):
        return None
    # Decode the content, as OpenCV finds no file with an umlaut in its name on Windows.
    image = cv2.imdecode(
        np.fromfile(path, np.uint8), cv2.IMREAD_UNCHANGED | cv2.IMREAD_IGNORE_ORIENTATION
    )
    if image is None:
        return None
    return image.shape[1], image.shape[0]
