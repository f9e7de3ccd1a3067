"""A photo reduced for looking at: unrotated, and with its scale to the original."""

from __future__ import annotations

import os
import struct
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from uavgram.errors import InputError
from uavgram.imaging.photos.shrink import shrunk
from uavgram.imaging.photos.tone import AS_IT_IS, Tone, automatic_tone, toned

Pixels = NDArray[np.uint8]

MAX_WIDTH_PX = 1600
JPEG_QUALITY = 75

# Decoding at 1/2, 1/4 or 1/8 of the size costs a fraction of decoding all of a JPEG.
_REDUCED = {
    1: cv2.IMREAD_COLOR,
    2: cv2.IMREAD_REDUCED_COLOR_2,
    4: cv2.IMREAD_REDUCED_COLOR_4,
    8: cv2.IMREAD_REDUCED_COLOR_8,
}
# A reduced photo may be this much narrower than asked for: sooner that than decode four times as
# many pixels.
_NARROWER = 0.8


@dataclass(frozen=True, eq=False)
class Preview:
    """A reduced photo in the orientation of the stored pixels.

    Attributes
    ----------
    jpeg
        Encoded picture.
    width_px, height_px
        Its size.
    scale
        Original pixels per preview pixel, along u and v. With (0, 0) the centre of the top-left
        pixel in both: original = (preview + 0.5) * scale - 0.5.
    tone
        By which it is brightened, to be seen.
    """

    jpeg: bytes
    width_px: int
    height_px: int
    scale: tuple[float, float]
    tone: Tone = AS_IT_IS


def read_preview(
    path: str | os.PathLike[str],
    max_width_px: int = MAX_WIDTH_PX,
    whole: Callable[[Pixels], object] | None = None,
) -> tuple[Preview, Pixels]:
    """Reduce one photo, and brighten it where it is too dark or flat to be seen.

    Parameters
    ----------
    path
        Any format that OpenCV reads. EXIF rotation is not applied.
    max_width_px
        The preview is at most this wide, and never wider than the photo.
    whole
        Called with the photo's own pixels where all of them are decoded for the preview: a JPEG
        that is much wider is decoded at a fraction of its size.

    Returns
    -------
    The preview, and its (height, width, 3) pixels, BGR, before they were brightened and encoded.

    Raises
    ------
    InputError
        The file cannot be read, or is no photo.
    """
    pixels, reduction = read_reduced(path, lambda width: _reduction(width, max_width_px))
    if whole is not None and reduction == 1:
        whole(pixels)
    height, width = pixels.shape[:2]
    # libjpeg's last column stands for a partial block: its pixels are `reduction` wide all the same
    covered = np.array([width, height], dtype=np.float64) * reduction
    pixels = shrunk(pixels, max_width_px, across_only=True)
    tone = automatic_tone(pixels)
    preview = _encoded(toned(pixels, tone), (float(covered[0]), float(covered[1])))
    return replace(preview, tone=tone), pixels


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
    try:
        encoded = Path(path).read_bytes()
    except OSError as error:
        raise InputError(path, f"cannot be read: {error.strerror}") from error
    size = jpeg_size(encoded)
    reduction = choose(size[0]) if size else 1
    return decoded(path, encoded, _REDUCED[reduction]), reduction


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
    pixels = _decode(encoded, flags | cv2.IMREAD_IGNORE_ORIENTATION)
    if pixels is None:
        raise InputError(path, "is no photo that can be decoded; replace it or leave it out")
    return pixels


def preview_of(pixels: Pixels, max_width_px: int = MAX_WIDTH_PX) -> Preview:
    """Reduce a photo that is decoded already: (height, width) grey, or (height, width, 3) BGR."""
    height, width = pixels.shape[:2]
    return _encoded(shrunk(pixels, max_width_px, across_only=True), (float(width), float(height)))


def _encoded(pixels: Pixels, covered_px: tuple[float, float]) -> Preview:
    """Encode a picture that stands for so many original pixels."""
    height, width = pixels.shape[:2]
    encoded_preview = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1]
    return Preview(
        jpeg=encoded_preview.tobytes(),
        width_px=width,
        height_px=height,
        scale=(covered_px[0] / width, covered_px[1] / height),
    )


def jpeg_preview_scale(width_px: int, max_width_px: int = MAX_WIDTH_PX) -> float:
    """Original pixels per preview pixel of a JPEG of this width, before it is read."""
    reduction = _reduction(width_px, max_width_px)
    return max(float(reduction), width_px / max_width_px)


def decode_preview(preview: Preview) -> Pixels:
    """(height, width, 3) RGB of a preview."""
    return np.ascontiguousarray(_decode_own(preview.jpeg)[:, :, ::-1])


def jpeg_of_width(jpeg: bytes, width_px: int) -> bytes:
    """A smaller copy of a JPEG of ours, at most this wide."""
    return preview_of(_decode_own(jpeg), width_px).jpeg


def _decode_own(jpeg: bytes) -> Pixels:
    pixels = _decode(jpeg, cv2.IMREAD_COLOR)
    if pixels is None:  # previews are encoded by this module
        raise ValueError("a preview holds no JPEG")
    return pixels


def jpeg_size(encoded: bytes) -> tuple[int, int] | None:
    """Width and height of the stored pixels from the header of a JPEG; None for other formats.

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
            return width, height
        at += 2 + struct.unpack(">H", encoded[at + 2 : at + 4])[0]
    return None


def _reduction(width_px: int, max_width_px: int) -> int:
    """The strongest reduction that leaves (nearly) enough pixels."""
    return max((r for r in _REDUCED if width_px / r >= _NARROWER * max_width_px), default=1)


def _decode(encoded: bytes, flags: int) -> Pixels | None:
    try:
        pixels = cv2.imdecode(np.frombuffer(encoded, np.uint8), flags)
    except cv2.error:  # an empty buffer, or a header with absurd sizes
        return None
    # OpenCV's stubs promise an array; it returns None for what is no picture
    return None if pixels is None else np.asarray(pixels, dtype=np.uint8)
