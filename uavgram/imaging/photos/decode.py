"""Decoding of photo files, whole or at a fraction of their size, and comparison of two of them."""

from __future__ import annotations

import os
import struct
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from uavgram.errors import InputError
from uavgram.imaging.photos.reduction import Pixels

REDUCED = {
    1: cv2.IMREAD_COLOR,
    2: cv2.IMREAD_REDUCED_COLOR_2,
    4: cv2.IMREAD_REDUCED_COLOR_4,
    8: cv2.IMREAD_REDUCED_COLOR_8,
}
"""OpenCV flags by original pixels per pixel; reduced decoding of a JPEG is much faster."""

_UNTURNED = cv2.IMREAD_IGNORE_ORIENTATION
_END_OF_JPEG = b"\xff\xd9"


def read_pixels(
    path: str | os.PathLike[str],
    size_px: tuple[int, int] | None = None,
    room: Pixels | None = None,
) -> Pixels:
    """Decode a whole photo.

    Parameters
    ----------
    path
        Any format that OpenCV reads. EXIF rotation is not applied.
    size_px
        Its width and height as stored, if known: formats other than JPEG then take half the memory.
    room
        Pixels that are no longer needed: if they have the same shape, they are overwritten, as
        memory in use is available at once.

    Returns
    -------
    (height, width, 3) BGR.

    Raises
    ------
    InputError
        The file cannot be read, or is not a photo.
    """
    return _read(path, lambda _: 1, size_px, room)[0]


def read_reduced(path: str | os.PathLike[str], choose: Callable[[int], int]) -> tuple[Pixels, int]:
    """Decode a photo; a JPEG at a fraction of its size, for a fraction of the time.

    Parameters
    ----------
    path
        Any format that OpenCV reads. EXIF rotation is not applied.
    choose
        Function that gives the original pixels per pixel (1, 2, 4 or 8) from the width of a JPEG;
        other formats are not reduced.

    Returns
    -------
    (height, width, 3) BGR, and original pixels per pixel.

    Raises
    ------
    InputError
        The file cannot be read, or is not a photo.
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
        if encoded.rfind(_END_OF_JPEG, at) < 0:  # cut off: OpenCV would fill in the missing part
            size_px = None
    pixels = None if size_px is None else _decode_into(path, size_px, reduction, room)
    if pixels is None:
        pixels = decode_photo(path, encoded, REDUCED[reduction])
    return pixels, reduction


def _decode_into(
    path: str | os.PathLike[str], size_px: tuple[int, int], reduction: int, room: Pixels | None
) -> Pixels | None:
    """Decode a photo of known size into an array; None where this fails.

    Without an array OpenCV fills one of its own and copies it: twice the memory, and up to half as
    much time again. If a file cannot be read, for example with an umlaut in its name on Windows,
    the array stays unchanged without an error. Its last row, set to random values before, shows
    whether it was filled.
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


def decode_photo(path: str | os.PathLike[str], encoded: bytes, flags: int) -> Pixels:
    """Decode a photo's content as stored; EXIF rotation is not applied.

    Parameters
    ----------
    path
        Name of the photo in the error.
    encoded
        Content of the file.
    flags
        OpenCV's flags: grey or colour, and the reduction.

    Raises
    ------
    InputError
        It is not a photo.
    """
    pixels = _decode(encoded, flags | _UNTURNED)
    if pixels is None:
        raise InputError(path, "is no photo that can be decoded; replace it or leave it out")
    return pixels


def jpeg_size(encoded: bytes) -> tuple[int, int] | None:
    """Read width and height of the stored pixels from a JPEG's header; None for other formats."""
    frame = _jpeg_frame(encoded)
    return None if frame is None else frame[0]


def _jpeg_frame(encoded: bytes) -> tuple[tuple[int, int], int] | None:
    """Read width and height of a JPEG, and the position of its frame header.

    ISO/IEC 10918-1, B.2.2: the frame header is the first marker from SOF0 to SOF15 except DHT (C4),
    JPG (C8) and DAC (CC).
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
    # OpenCV's stubs declare an array; it returns None if the data is not a picture
    return None if pixels is None else np.asarray(pixels, dtype=np.uint8)


_REDUCTION = 8
_ROUNDING = 1.0
"""Grey levels by which pictures without content may differ through compression alone."""


def is_same_exposure(one: str, other: str) -> bool:
    """Return whether two photos of one size differ by less than a shift of a few pixels does.

    Parameters
    ----------
    one, other
        Their files, in any format that OpenCV reads.

    Raises
    ------
    InputError
        A file cannot be read, or is not a photo.
    """
    first, second = (read_reduced(path, lambda _: _REDUCTION)[0] for path in (one, other))
    size = min(first.shape[1::-1], second.shape[1::-1])  # only JPEGs are reduced
    first, second = (
        cv2.resize(pixels, size, interpolation=cv2.INTER_AREA).astype(np.float64).mean(axis=2)
        for pixels in (first, second)
    )
    shift = np.diff(first, axis=1).std()
    difference = np.sqrt(np.mean((first - second) ** 2))
    return bool(difference < max(_ROUNDING, 0.5 * shift))
