"""Pixels of a photo file, whole or at a fraction of its size: never turned, as they are stored."""

from __future__ import annotations

import os
import struct
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from uavgram.errors import InputError
from uavgram.imaging.photos.shrink import Pixels

REDUCED = {
    1: cv2.IMREAD_COLOR,
    2: cv2.IMREAD_REDUCED_COLOR_2,
    4: cv2.IMREAD_REDUCED_COLOR_4,
    8: cv2.IMREAD_REDUCED_COLOR_8,
}
"""By original pixels per pixel: decoding a JPEG at a fraction of its size costs a fraction."""

_UNTURNED = cv2.IMREAD_IGNORE_ORIENTATION
_END_OF_JPEG = b"\xff\xd9"


def read_pixels(
    path: str | os.PathLike[str],
    size_px: tuple[int, int] | None = None,
    room: Pixels | None = None,
) -> Pixels:
    """Decode a photo, all of it.

    Parameters
    ----------
    path
        Any format that OpenCV reads. EXIF rotation is not applied.
    size_px
        Its width and height as stored, where they are known: what is no JPEG takes half the memory
        then.
    room
        Pixels that are no longer needed: where they are as many, these take their place. Memory
        that was used before is there at once.

    Returns
    -------
    (height, width, 3) BGR.

    Raises
    ------
    InputError
        The file cannot be read, or is no photo.
    """
    return _read(path, lambda _: 1, size_px, room)[0]


def read_reduced(path: str | os.PathLike[str], choose: Callable[[int], int]) -> tuple[Pixels, int]:
    """Decode a photo, a JPEG at a fraction of its size, which costs a fraction.

    Parameters
    ----------
    path
        Any format that OpenCV reads. EXIF rotation is not applied.
    choose
        Original pixels per pixel (1, 2, 4 or 8) of a JPEG of a width; others are not reduced.

    Returns
    -------
    (height, width, 3) BGR, and original pixels per pixel.

    Raises
    ------
    InputError
        The file cannot be read, or is no photo.
    """
    return _read(path, choose)


def _read(
    path: str | os.PathLike[str],
    choose: Callable[[int], int],
    size_px: tuple[int, int] | None = None,
    room: Pixels | None = None,
) -> tuple[Pixels, int]:
    try:
        encoded = Path(path).read_bytes()
    except OSError as error:
        raise InputError(path, f"cannot be read: {error.strerror}") from error
    reduction, frame = 1, _jpeg_frame(encoded)
    if frame is not None:
        size_px, at = frame
        reduction = choose(size_px[0])
        if encoded.rfind(_END_OF_JPEG, at) < 0:  # cut off: OpenCV would make up the rest of a file
            size_px = None
    pixels = None if size_px is None else _decoded_into(path, size_px, reduction, room)
    if pixels is None:
        pixels = decoded(path, encoded, REDUCED[reduction])
    return pixels, reduction


def _decoded_into(
    path: str | os.PathLike[str], size_px: tuple[int, int], reduction: int, room: Pixels | None
) -> Pixels | None:
    """Decode a photo of a width and height into an array; None where that does not work.

    OpenCV alone fills an array of its own and copies it: twice the memory, and up to half as much
    time again.
    A file that cannot be read, as one with an umlaut in its name on Windows, leaves the array as it
    was, without a word: so its last row shows whether it was filled.
    """
    width, height = (-(-side // reduction) for side in size_px)
    shape = height, width, 3
    untouched = np.random.default_rng(0).integers(0, 256, (width, 3), np.uint8)
    try:
        pixels = np.empty(shape, np.uint8) if room is None or room.shape != shape else room
        pixels[-1] = untouched
        found = cv2.imread(os.fspath(path), pixels, REDUCED[reduction] | _UNTURNED)
    except (cv2.error, MemoryError):  # a header with absurd sizes
        return None
    if found is None or found.shape != pixels.shape or np.array_equal(found[-1], untouched):
        return None
    return np.asarray(found, dtype=np.uint8)


def decoded(path: str | os.PathLike[str], encoded: bytes, flags: int) -> Pixels:
    """Pixels of a photo's content as stored; EXIF rotation is not applied.

    Parameters
    ----------
    path
        Names the photo in the error.
    encoded
        Content of the file.
    flags
        Of OpenCV: grey or colour, and by how much it is reduced.

    Raises
    ------
    InputError
        It is no photo.
    """
    pixels = _decode(encoded, flags | _UNTURNED)
    if pixels is None:
        raise InputError(path, "is no photo that can be decoded; replace it or leave it out")
    return pixels


def jpeg_size(encoded: bytes) -> tuple[int, int] | None:
    """Width and height of the stored pixels from the header of a JPEG; None for other formats."""
    frame = _jpeg_frame(encoded)
    return None if frame is None else frame[0]


def _jpeg_frame(encoded: bytes) -> tuple[tuple[int, int], int] | None:
    """Width and height of a JPEG, and where its frame header is.

    ISO/IEC 10918-1, B.2.2: the frame header is the first marker SOF0 to SOF15 that is none of DHT
    (C4), JPG (C8) and DAC (CC).
    """
    if encoded[:2] != b"\xff\xd8":
        return None
    at = 2
    while at + 9 <= len(encoded):
        marker = encoded[at + 1]
        if encoded[at] != 0xFF or marker == 0xFF:  # fill bytes before a marker
            at += 1
            continue
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            height, width = struct.unpack(">HH", encoded[at + 5 : at + 9])
            return (width, height), at
        at += 2 + struct.unpack(">H", encoded[at + 2 : at + 4])[0]
    return None


def _decode(encoded: bytes, flags: int) -> Pixels | None:
    try:
        pixels = cv2.imdecode(np.frombuffer(encoded, np.uint8), flags)
    except cv2.error:  # an empty buffer, or a header with absurd sizes
        return None
    # OpenCV's stubs promise an array; it returns None for what is no picture
    return None if pixels is None else np.asarray(pixels, dtype=np.uint8)
