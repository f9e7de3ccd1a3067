"""Decoding of photo files, whole or reduced, and reduction of decoded pictures."""

from __future__ import annotations

import math
import mmap
import os
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from uavgram.errors import InputError
from uavgram.imaging.raster import Image
from uavgram.model.arrays import Floats

Pixels = NDArray[np.uint8]


def shrink(pixels: Pixels, longest_px: int, *, across_only: bool = False) -> Pixels:
    """Reduce a picture so that its longer side is at most `longest_px`.

    The same array is returned where it already is.

    Parameters
    ----------
    pixels
        (height, width) or (height, width, channels).
    longest_px
        Limit of the longer side.
    across_only
        Whether the limit applies to the width alone.

    Notes
    -----
    OpenCV's mean over areas takes four times as long as its bilinear mean, and twenty times as long
    as that of exactly 2 x 2 pixels. So a picture is halved as often as possible; the remaining
    reduction, by less than one half, is bilinear: all covered pixels contribute to each new pixel,
    though not by their area alone.
    """
    height, width = pixels.shape[:2]
    share = longest_px / (width if across_only else max(height, width, 1))
    if share >= 1.0:
        return pixels
    size = max(1, round(share * width)), max(1, round(share * height))
    while _reduction(pixels, size) >= 2.0 and not (pixels.shape[0] % 2 or pixels.shape[1] % 2):
        pixels = halve(pixels)
    halvings = int(math.log2(_reduction(pixels, size)))
    larger = size[0] << halvings, size[1] << halvings
    pixels = np.asarray(cv2.resize(pixels, larger, interpolation=cv2.INTER_LINEAR), np.uint8)
    for _ in range(halvings):
        pixels = halve(pixels)
    return pixels


def _reduction(pixels: Pixels, size: tuple[int, int]) -> float:
    """Compute how many pixels become one, along the side where they are fewer."""
    return float(min(pixels.shape[1] / size[0], pixels.shape[0] / size[1]))


def halve(pixels: Pixels) -> Pixels:
    """Compute means of 2 x 2 pixels, odd edges repeated."""
    rows, columns = pixels.shape[0] // 2, pixels.shape[1] // 2
    halved = np.empty(
        (-(-pixels.shape[0] // 2), -(-pixels.shape[1] // 2), *pixels.shape[2:]), np.uint8
    )
    _fill_halved(pixels[: 2 * rows, : 2 * columns], halved[:rows, :columns])
    if len(halved) > rows:
        _fill_halved(pad_to_even(pixels[-1:]), halved[-1:])
    if halved.shape[1] > columns:
        _fill_halved(pad_to_even(pixels[:, -1:]), halved[:, -1:])
    return halved


def _fill_halved(even: Pixels, halved: Pixels) -> None:
    """Fill a picture with means of 2 x 2 pixels of another one."""
    if halved.size:
        # INTER_AREA at exactly one half gives this mean, rounded.
        cv2.resize(even, halved.shape[1::-1], dst=halved, interpolation=cv2.INTER_AREA)


def pad_to_even(pixels: Pixels) -> Pixels:
    """Repeat the last row or column where the height or the width is odd."""
    down, right = pixels.shape[0] % 2, pixels.shape[1] % 2
    if not (down or right):
        return pixels
    return np.asarray(cv2.copyMakeBorder(pixels, 0, down, 0, right, cv2.BORDER_REPLICATE), np.uint8)


FULL_OPACITY = 255


def halve_with_opacity(rgba: Pixels) -> Pixels:
    """Average two by two pixels into one, weighted by their opacity.

    Parameters
    ----------
    rgba
        (H, W, 4) colour, not multiplied by opacity, and opacity.

    Returns
    -------
    (ceil(H / 2), ceil(W / 2), 4), opacity the plain mean. The last row and column are not averaged
    with others where H or W is odd.
    """
    rgba = pad_to_even(rgba)
    means = halve(rgba)
    height, width = means.shape[:2]
    opacity = means[..., 3]
    rim = np.nonzero(
        (opacity > 0) & (opacity < FULL_OPACITY)
    )  # few pixels: only the edge is partly opaque
    if rim[0].size:
        four = rgba.reshape(height, 2, width, 2, 4)[rim[0], :, rim[1]].reshape(-1, 4, 4)
        weight = four[..., 3:].astype(np.float64)
        means[..., :3][rim] = np.rint((four[..., :3] * weight).sum(1) / weight.sum(1))
    return means


def make_reduced_copies(image: Image, widths_px: tuple[int, ...]) -> Iterator[tuple[int, Image]]:
    """Make copies from small to large, each with its original pixels per pixel.

    Parameters
    ----------
    image
        (height, width) grey.
    widths_px
        Least longer sides of the copies: photos are reduced by whole factors, which is fast. The
        photo itself replaces the first copy that needs no reduction, and ends the series.
    """
    height, width = image.shape
    for wanted in widths_px:
        factor = max(height, width) // wanted
        if factor < 2:
            yield 1, image
            return
        size = (width // factor, height // factor)
        whole = image[: size[1] * factor, : size[0] * factor]
        yield factor, np.asarray(cv2.resize(whole, size, interpolation=cv2.INTER_AREA), np.uint8)


def scale_to_original(pixel_px: Floats, factor: int) -> Floats:
    """Convert pixels (..., 2) to the original.

    (0, 0) is the centre of the top-left pixel in both.
    """
    return np.asarray((pixel_px + 0.5) * factor - 0.5, np.float64)


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
    reduction, frame = 1, find_jpeg_frame(encoded)
    if frame is not None:
        reduction = choose(frame.size_px[0])
        # cut off: OpenCV would fill in the missing part
        size_px = frame.size_px if frame.is_whole else None
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


SOS, EOI = 0xDA, 0xD9
START = b"\xff\xd8"
_ALONE = {0x01, *range(0xD0, 0xD9)}  # TEM, RSTn, SOI: no length follows
# Start-of-frame markers of JPEG (ITU-T T.81, table B.1), without 0xC4, 0xC8 and 0xCC.
_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}


@dataclass(frozen=True)
class Segment:
    """Marker (its second byte) with its payload, without marker and length."""

    marker: int
    payload: bytes


def read_segments(data: bytes | mmap.mmap) -> Iterator[tuple[Segment, int]]:
    """Yield the segments of a JPEG file, each with its end in bytes; nothing for other formats.

    The last one, without payload, is the marker of the first scan (or of the end of the file): if
    it is missing, the file is truncated.
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


class JpegFrame(NamedTuple):
    """Width and height of the stored pixels, and whether the file's end marker follows."""

    size_px: tuple[int, int]
    is_whole: bool


def find_jpeg_frame(encoded: bytes | mmap.mmap) -> JpegFrame | None:
    """Read a JPEG's frame header; None for other formats."""
    for segment, end in read_segments(encoded):
        if segment.marker in _FRAMES and len(segment.payload) >= 5:
            height, width = struct.unpack_from(">HH", segment.payload, 1)
            return JpegFrame((width, height), encoded.rfind(_END_OF_JPEG, end) >= 0)
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
    is_same_grey = abs(float((first - second).mean())) < 2.0 * _ROUNDING
    is_alike = (first - second).std() < max(_ROUNDING, 0.5 * shift)
    return bool(is_same_grey and is_alike)
