"""Parts of a photo as small pictures, for a report."""

from __future__ import annotations

import os
from collections.abc import Sequence

import cv2

from uavgram.imaging.photos.decode import read_reduced
from uavgram.imaging.photos.preview import Pixels
from uavgram.imaging.photos.shrink import half, shrunk
from uavgram.imaging.photos.tone import automatic_tone, toned
from uavgram.model.result.pictures import Picture, Region

QUALITY = 85
LONGEST_PX = {"overview": 1400, "measurement": 900, "point": 360}
"""Longer side of a picture: a larger part is reduced to it."""


def read_whole(path: str | os.PathLike[str]) -> Pixels:
    """(height, width, 3) BGR of a photo in any format that OpenCV reads.

    EXIF rotation is not applied.

    Raises
    ------
    InputError
        The file cannot be read, or is no photo.
    """
    return read_reduced(path, lambda _: 1)[0]


def cut_out(pixels: Pixels, regions: Sequence[Region]) -> tuple[Picture, ...]:
    """Cut parts out of a photo.

    All of them are brightened alike, where the whole photo is too dark or flat to be seen. Pixels
    are those of the photo, or means of those that they cover.

    Parameters
    ----------
    pixels
        (height, width, 3) BGR of the whole photo.
    regions
        Parts of it.
    """
    # Many parts of a photo overlap: what all are reduced by is done to the photo, once.
    halved = half(pixels)
    tone = automatic_tone(pixels if pixels.shape[0] % 2 or pixels.shape[1] % 2 else halved)
    stretch = None if tone.is_identity else (tone.black, tone.white, tone.gamma)
    pictures = []
    for region in regions:
        longest = LONGEST_PX[region.subject]
        step = 2 if _is_halved(region, longest) else 1
        part = shrunk(_part(halved if step == 2 else pixels, region, step), longest)
        shown = toned(part, tone)
        encoded = cv2.imencode(".jpg", shown, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1]
        pictures.append(
            Picture(region=region, jpeg=encoded.tobytes(), shown_px=part.shape[1], stretch=stretch)
        )
    return tuple(pictures)


def _is_halved(region: Region, longest_px: int) -> bool:
    """Whether a part is shown at half its size or less, and its edges are edges of 2 x 2 pixels."""
    size = region.width_px, region.height_px
    return max(size) >= 2 * longest_px and not any(
        edge % 2 for edge in (region.left_px, region.top_px, *size)
    )


def _part(pixels: Pixels, region: Region, step: int) -> Pixels:
    """A part of a photo whose pixels are `step` wide."""
    left, top = region.left_px // step, region.top_px // step
    height, width = region.height_px // step, region.width_px // step
    return pixels[top : top + height, left : left + width]
