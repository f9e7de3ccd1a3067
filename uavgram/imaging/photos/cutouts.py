"""Parts of a photo as small pictures for a report."""

from __future__ import annotations

from collections.abc import Sequence

import cv2

from uavgram.imaging.photos.preview import Pixels
from uavgram.imaging.photos.shrink import half, shrunk
from uavgram.imaging.photos.tone import Tone, toned
from uavgram.model.result.pictures import Picture, Region

QUALITY = 85
LONGEST_PX = {"overview": 1400, "measurement": 900, "point": 360}
"""Longer side of a picture: a larger part is reduced to it."""


def cut_out(halves: Sequence[Pixels], tone: Tone, regions: Sequence[Region]) -> tuple[Picture, ...]:
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
                levels.append(half(levels[0]))
            part = shrunk(_part(levels[level], region, 1 << level), longest)
            quality = [cv2.IMWRITE_JPEG_QUALITY, QUALITY]
            encoded = cv2.imencode(".jpg", toned(part, tone), quality)[1]
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
