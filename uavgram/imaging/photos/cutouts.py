"""Parts of a photo as small pictures, for a report."""

from __future__ import annotations

import os
from collections.abc import Sequence

import cv2

from uavgram.imaging.photos.preview import Pixels, read_reduced
from uavgram.imaging.photos.shrink import shrunk
from uavgram.imaging.photos.tone import automatic_tone, toned
from uavgram.model.result.pictures import Picture, Region

QUALITY = 85
LONGEST_PX = {"overview": 1400, "measurement": 900, "point": 360}
"""Longer side of a picture: a larger part is reduced to it."""


def cut_out(path: str | os.PathLike[str], regions: Sequence[Region]) -> tuple[Picture, ...]:
    """Decode a photo once, and cut parts out of it.

    All of them are brightened alike, where the whole photo is too dark or flat to be seen. Pixels
    are those of the photo, or means of those that they cover.

    Parameters
    ----------
    path
        Any format that OpenCV reads. EXIF rotation is not applied.
    regions
        Parts of this photo.

    Raises
    ------
    InputError
        The file cannot be read, or is no photo.
    """
    pixels, _ = read_reduced(path, lambda _: 1)
    tone = automatic_tone(pixels)
    stretch = None if tone.is_identity else (tone.black, tone.white, tone.gamma)
    pictures = []
    for region in regions:
        part = shrunk(_part(pixels, region), LONGEST_PX[region.subject])
        shown = toned(part, tone)
        encoded = cv2.imencode(".jpg", shown, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1]
        pictures.append(
            Picture(region=region, jpeg=encoded.tobytes(), shown_px=part.shape[1], stretch=stretch)
        )
    return tuple(pictures)


def _part(pixels: Pixels, region: Region) -> Pixels:
    rows = slice(region.top_px, region.top_px + region.height_px)
    return pixels[rows, region.left_px : region.left_px + region.width_px]
