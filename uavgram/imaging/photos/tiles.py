"""Tiles of photos: not rotated, reduced by exact halves, cut on request.

Level 0 is the photo; a pixel of level k is the mean of 2^k x 2^k pixels of the photo. Odd edges are
repeated, so that pixel (i, j) of every level covers the same part of the photo everywhere: resizing
to half of an odd width would stretch the picture by a pixel along its width.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from uavgram.imaging.photos.preview import Pixels
from uavgram.imaging.photos.reduction import halve
from uavgram.imaging.photos.tone import IDENTITY_TONE, Tone, apply_tone

TILE_PX = 512
TILE_QUALITY = 95
SMALLEST_LEVEL_PX = 256
"""Longer side of a level up to which no further reduction is needed."""

FIRST_COARSE = 2
"""First level of an overview; finer ones are made from the photo on request."""

_STRIP_PX = 512  # a multiple of 2**FIRST_COARSE

# 4:4:4: colour at full resolution; otherwise thin coloured marks smear over their neighbours.
_TILE_CODING = [
    cv2.IMWRITE_JPEG_QUALITY,
    TILE_QUALITY,
    cv2.IMWRITE_JPEG_SAMPLING_FACTOR,
    cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444,
]


@dataclass(frozen=True, eq=False)
class Overview:
    """Coarse levels of a photo: a twelfth of its memory, and sufficient for a small window.

    Attributes
    ----------
    levels
        `FIRST_COARSE` and up; empty for a photo that is too small to have them.
    """

    levels: tuple[Pixels, ...]

    @property
    def coarsest(self) -> Pixels | None:
        """Whole photo at its smallest; None for a photo without overview."""
        return self.levels[-1] if self.levels else None

    @property
    def size_bytes(self) -> int:
        """Memory of the levels."""
        return sum(level.nbytes for level in self.levels)

    def tile(self, level: int, column: int, row: int, tone: Tone = IDENTITY_TONE) -> bytes | None:
        """Return one tile as JPEG, smaller at the edges; None where the overview has none.

        Parameters
        ----------
        level
            `FIRST_COARSE` or more.
        column, row
            Position of the tile at that level.
        tone
            Curve of brightness.
        """
        if not 0 <= level - FIRST_COARSE < len(self.levels):
            return None
        pixels = self.levels[level - FIRST_COARSE]
        return _encoded(_part(pixels, column * TILE_PX, row * TILE_PX, TILE_PX), tone)


def fine_tile(
    photo: Pixels, level: int, column: int, row: int, tone: Tone = IDENTITY_TONE
) -> bytes | None:
    """Return one tile of a level finer than an overview's as JPEG; None where there is none.

    Parameters
    ----------
    photo
        (height, width, 3) BGR: level 0.
    level, column, row
        Level and position of the tile.
    tone
        Curve of brightness.
    """
    height, width = photo.shape[:2]
    if not 0 <= level < min(FIRST_COARSE, level_count(width, height)):
        return None
    left, top, side = ((TILE_PX * place) << level for place in (column, row, 1))
    part = _part(photo, left, top, side)
    return None if part is None else _encoded(halve_repeatedly(part, level), tone)


def _part(pixels: Pixels, left: int, top: int, side: int) -> Pixels | None:
    """Cut a square of pixels, smaller at the edges; None outside."""
    height, width = pixels.shape[:2]
    if not (0 <= left < width and 0 <= top < height):
        return None
    return pixels[top : top + side, left : left + side]


def _encoded(part: Pixels | None, tone: Tone) -> bytes | None:
    if part is None:
        return None
    # Brighten before encoding: otherwise the steps of the JPEG would be amplified, too.
    return cv2.imencode(".jpg", apply_tone(part, tone), _TILE_CODING)[1].tobytes()


def level_count(width_px: int, height_px: int) -> int:
    """Count the levels of a photo of this size."""
    count, longer = 1, max(width_px, height_px)
    while longer > SMALLEST_LEVEL_PX:
        count, longer = count + 1, (longer + 1) // 2
    return count


def make_overview(photo: Pixels) -> Overview:
    """Reduce a decoded photo (height, width, 3) by halves."""
    height, width = photo.shape[:2]
    count = level_count(width, height)
    if count <= FIRST_COARSE:
        return Overview(())
    # Work in strips, which need no memory for the levels in between.
    pixels_each = 1 << FIRST_COARSE
    first = np.empty((-(-height // pixels_each), -(-width // pixels_each), 3), np.uint8)
    for top in range(0, height, _STRIP_PX):
        strip = halve_repeatedly(photo[top : top + _STRIP_PX], FIRST_COARSE)
        first[top // pixels_each :][: len(strip)] = strip
    levels = [first]
    while len(levels) < count - FIRST_COARSE:
        levels.append(halve(levels[-1]))
    return Overview(tuple(levels))


def halve_repeatedly(pixels: Pixels, level: int) -> Pixels:
    """Halve pixels `level` times.

    A part of a photo that begins at a multiple of ``2**level`` gives the same pixels as the whole.
    """
    for _ in range(level):
        pixels = halve(pixels)
    return pixels
