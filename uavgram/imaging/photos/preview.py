"""Reduced photos for display: unrotated, with their scale to the original."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from uavgram.imaging.photos.decode import REDUCED, read_reduced
from uavgram.imaging.photos.shrink import half, shrunk
from uavgram.imaging.photos.tone import AS_IT_IS, Tone, automatic_tone, toned

Pixels = NDArray[np.uint8]

MAX_WIDTH_PX = 1600
JPEG_QUALITY = 75

# Least width relative to the requested one: a smaller photo is preferred to decoding four times as
# many pixels.
_NARROWER = 0.8


@dataclass(frozen=True, eq=False)
class Preview:
    """Reduced photo in the orientation of the stored pixels.

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
        Curve by which it is brightened.
    """

    jpeg: bytes
    width_px: int
    height_px: int
    scale: tuple[float, float]
    tone: Tone = AS_IT_IS


def read_preview(
    path: str | os.PathLike[str], max_width_px: int = MAX_WIDTH_PX
) -> tuple[Preview, Pixels]:
    """Reduce one photo, and brighten it where it is too dark or flat to be seen.

    Parameters
    ----------
    path
        Any format that OpenCV reads. EXIF rotation is not applied.
    max_width_px
        The preview is at most this wide, and never wider than the photo.

    Returns
    -------
    The preview, and its (height, width, 3) pixels, BGR, before they were brightened and encoded.

    Raises
    ------
    InputError
        The file cannot be read, or is not a photo.
    """
    pixels, reduction = read_reduced(path, lambda width: _reduction(width, max_width_px))
    if reduction == 1:
        return preview_of_whole(pixels, max_width_px)[:2]
    return _shown(pixels, reduction, max_width_px)


def preview_of_whole(
    pixels: Pixels, max_width_px: int = MAX_WIDTH_PX
) -> tuple[Preview, Pixels, list[Pixels]]:
    """Reduce a completely decoded photo, to the size that `read_preview` gives.

    Parameters
    ----------
    pixels
        (height, width, 3) BGR.
    max_width_px
        The preview is at most this wide, and never wider than the photo.

    Returns
    -------
    The preview, its pixels, and the photo with the halves that were made.
    """
    halves, reduction = [pixels], _reduction(pixels.shape[1], max_width_px)
    while len(halves) < reduction.bit_length():
        halves.append(half(halves[-1]))
    return *_shown(halves[-1], reduction, max_width_px), halves


def _shown(pixels: Pixels, reduction: int, max_width_px: int) -> tuple[Preview, Pixels]:
    """Make preview and pixels of a photo whose pixels are `reduction` wide."""
    height, width = pixels.shape[:2]
    # the last column may cover only a part of a pixel, but counts as `reduction` wide
    covered = np.array([width, height], dtype=np.float64) * reduction
    pixels = shrunk(pixels, max_width_px, across_only=True)
    tone = automatic_tone(pixels)
    preview = _encoded(toned(pixels, tone), (float(covered[0]), float(covered[1])))
    return replace(preview, tone=tone), pixels


def preview_of(pixels: Pixels, max_width_px: int = MAX_WIDTH_PX) -> Preview:
    """Reduce a decoded photo: (height, width) grey, or (height, width, 3) BGR."""
    height, width = pixels.shape[:2]
    return _encoded(shrunk(pixels, max_width_px, across_only=True), (float(width), float(height)))


def _encoded(pixels: Pixels, covered_px: tuple[float, float]) -> Preview:
    """Encode a picture that covers the given number of original pixels."""
    height, width = pixels.shape[:2]
    encoded_preview = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1]
    return Preview(
        jpeg=encoded_preview.tobytes(),
        width_px=width,
        height_px=height,
        scale=(covered_px[0] / width, covered_px[1] / height),
    )


def jpeg_preview_scale(width_px: int, max_width_px: int = MAX_WIDTH_PX) -> float:
    """Compute the original pixels per preview pixel of a JPEG of this width, before it is read."""
    reduction = _reduction(width_px, max_width_px)
    return max(float(reduction), width_px / max_width_px)


def decode_preview(preview: Preview) -> Pixels:
    """Decode a preview to (height, width, 3) RGB."""
    return np.ascontiguousarray(_decode_own(preview.jpeg)[:, :, ::-1])


def jpeg_of_width(jpeg: bytes, width_px: int) -> bytes:
    """Reduce a JPEG made by this module to at most this width."""
    return preview_of(_decode_own(jpeg), width_px).jpeg


def _decode_own(jpeg: bytes) -> Pixels:
    pixels = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    if pixels is None:  # previews are encoded by this module
        raise ValueError("a preview holds no JPEG")
    return np.asarray(pixels, np.uint8)


def _reduction(width_px: int, max_width_px: int) -> int:
    """Choose the strongest reduction that leaves (nearly) enough pixels."""
    return max((r for r in REDUCED if width_px / r >= _NARROWER * max_width_px), default=1)
