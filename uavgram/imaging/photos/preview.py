"""Reduced photos for display, with their scale to the original, and parts of photos for a report.

No picture is rotated: all are in the orientation of the stored pixels.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from uavgram.imaging.photos.decode import REDUCED, read_reduced
from uavgram.imaging.photos.reduction import halve, shrink
from uavgram.imaging.photos.tone import IDENTITY_TONE, Tone, apply_tone, choose_tone
from uavgram.model.result.pictures import Picture, Region

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
    tone: Tone = IDENTITY_TONE


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
        return make_preview_of_decoded(pixels, max_width_px)[:2]
    return _shown(pixels, reduction, max_width_px)


def make_preview_of_decoded(
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
        halves.append(halve(halves[-1]))
    return *_shown(halves[-1], reduction, max_width_px), halves


def _shown(pixels: Pixels, reduction: int, max_width_px: int) -> tuple[Preview, Pixels]:
    """Make preview and pixels of a photo whose pixels are `reduction` wide."""
    height, width = pixels.shape[:2]
    # the last column may cover only a part of a pixel, but counts as `reduction` wide
    covered = np.array([width, height], dtype=np.float64) * reduction
    pixels = shrink(pixels, max_width_px, across_only=True)
    tone = choose_tone(pixels)
    preview = _encoded(apply_tone(pixels, tone), (float(covered[0]), float(covered[1])))
    return replace(preview, tone=tone), pixels


def make_preview(pixels: Pixels, max_width_px: int = MAX_WIDTH_PX) -> Preview:
    """Reduce a decoded photo: (height, width) grey, or (height, width, 3) BGR."""
    height, width = pixels.shape[:2]
    return _encoded(shrink(pixels, max_width_px, across_only=True), (float(width), float(height)))


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


def shrink_jpeg(jpeg: bytes, width_px: int) -> bytes:
    """Reduce a JPEG made by this module to at most this width."""
    return make_preview(_decode_own(jpeg), width_px).jpeg


def _decode_own(jpeg: bytes) -> Pixels:
    pixels = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    if pixels is None:  # previews are encoded by this module
        raise ValueError("a preview holds no JPEG")
    return np.asarray(pixels, np.uint8)


def _reduction(width_px: int, max_width_px: int) -> int:
    """Choose the strongest reduction that leaves (nearly) enough pixels."""
    return max((r for r in REDUCED if width_px / r >= _NARROWER * max_width_px), default=1)


QUALITY = 85
LONGEST_PX = {"overview": 1400, "measurement": 900, "point": 360}
"""Longer side of a picture: a larger part is reduced to it."""


def cut_parts(
    halves: Sequence[Pixels], tone: Tone, regions: Sequence[Region]
) -> tuple[Picture, ...]:
    """Cut parts out of a photo; pixels are those of the photo, or means over several of them.

    Parameters
    ----------
    halves
        (height, width, 3) BGR of the whole photo; then, where they exist already, its halves.
    tone
        Curve that brightens all of them, where the photo is too dark or flat to be seen.
    regions
        Parts of it.
    """
    # Parts of a photo often overlap: halve the photo once for all of them.
    levels = list(halves[:2])
    stretch = None if tone.is_identity else (tone.black, tone.white, tone.gamma)
    shown: dict[tuple[int, ...], tuple[bytes, int]] = {}  # some measurements have the same points
    pictures = []
    for region in regions:
        longest = LONGEST_PX[region.subject]
        place = region.left_px, region.top_px, region.width_px, region.height_px, longest
        if place not in shown:
            level = int(_is_halved(region, longest))
            if level == len(levels):
                levels.append(halve(levels[0]))
            part = shrink(_part(levels[level], region, 1 << level), longest)
            quality = [cv2.IMWRITE_JPEG_QUALITY, QUALITY]
            encoded = cv2.imencode(".jpg", apply_tone(part, tone), quality)[1]
            shown[place] = encoded.tobytes(), part.shape[1]
        jpeg, width = shown[place]
        pictures.append(Picture(region=region, jpeg=jpeg, shown_px=width, stretch=stretch))
    return tuple(pictures)


def _is_halved(region: Region, longest_px: int) -> bool:
    """Return whether a part is shown at half its size or less, with edges on 2 x 2 pixel blocks."""
    size = region.width_px, region.height_px
    return max(size) >= 2 * longest_px and not any(
        edge % 2 for edge in (region.left_px, region.top_px, *size)
    )


def _part(pixels: Pixels, region: Region, step: int) -> Pixels:
    """Cut a part of a photo whose pixels are `step` wide."""
    left, top = region.left_px // step, region.top_px // step
    height, width = region.height_px // step, region.width_px // step
    return pixels[top : top + height, left : left + width]
