"""Tiles of many photos: not rotated, reduced by exact halves, cut on request.

Level 0 is the photo; a pixel of level k is the mean of 2^k x 2^k pixels of the photo. Odd edges are
repeated, so that pixel (i, j) of every level covers the same part of the photo everywhere: resizing
to half of an odd width would stretch the picture by a pixel along its width.

The overview of a viewed photo is kept: it shows the whole photo at once, and bridges the time until
its pixels are decoded again after another photo replaced them.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from uavgram.imaging.photos.cache import LruCache
from uavgram.imaging.photos.decoding import halve, read_pixels
from uavgram.imaging.photos.preview import (
    IDENTITY_TONE,
    Pixels,
    Tone,
    apply_tone,
    choose_full_range_tone,
    choose_tone,
)

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
        return _encode_tile(_part(pixels, column * TILE_PX, row * TILE_PX, TILE_PX), tone)


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
    return None if part is None else _encode_tile(halve_repeatedly(part, level), tone)


def _part(pixels: Pixels, left: int, top: int, side: int) -> Pixels | None:
    """Cut a square of pixels, smaller at the edges; None outside."""
    height, width = pixels.shape[:2]
    if not (0 <= left < width and 0 <= top < height):
        return None
    return pixels[top : top + side, left : left + side]


def _encode_tile(part: Pixels | None, tone: Tone) -> bytes | None:
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


PIXELS_BYTES = 200_000_000
"""Memory limit of decoded photos: one of 48 megapixels takes 144 MB, one of 12 takes 36."""

OVERVIEWS_BYTES = 64_000_000
"""Memory limit of overviews: that of a photo of 48 megapixels takes 12 MB."""

IN_USE_S = 10.0
"""Longest time between two requests of a page in use, while other pages are in use, too."""

_CHANNELS = 3


@dataclass(frozen=True)
class PhotoFile:
    """Photo to cut tiles from: its file, and its size as stored."""

    path: str
    width_px: int
    height_px: int


class TiledPhotos:
    """Tiles of photos, for several threads.

    Parameters
    ----------
    files
        Photos.
    """

    def __init__(self, files: Sequence[PhotoFile]) -> None:
        self._files = tuple(files)
        self._pixels: LruCache[int, Pixels] = LruCache(
            self._decode,
            lambda pixels: pixels.nbytes,
            PIXELS_BYTES,
            expected_bytes=lambda k: _CHANNELS * self._files[k].width_px * self._files[k].height_px,
        )
        self._overviews: LruCache[int, Overview] = LruCache(
            lambda k: make_overview(self._pixels.get(k)),
            lambda overview: overview.size_bytes,
            OVERVIEWS_BYTES,
        )
        self._tones: LruCache[int, tuple[Tone, Tone]] = LruCache(
            self._find_tones, len, 2 * len(self._files)
        )
        self._shown: dict[str, tuple[float, frozenset[int]]] = {}
        self._lock = threading.Lock()

    def show(self, page: str, photos: Collection[int]) -> None:
        """Register the photos that a page shows side by side, to keep them decoded.

        The limit does not apply to them. Pages without a request for `IN_USE_S` are taken to be
        closed.
        """
        now = time.monotonic()
        with self._lock:
            self._shown[page] = now, frozenset(photos)
            self._shown = {
                name: look for name, look in self._shown.items() if look[0] >= now - IN_USE_S
            }
            held = frozenset[int]().union(*(shown for _, shown in self._shown.values()))
            self._pixels.hold(held)
            self._overviews.hold(held)

    def pixels(self, photo: int) -> Pixels:
        """Return the pixels of a photo, (height, width, 3) BGR, decoded now if necessary.

        Raises
        ------
        InputError
            The file cannot be read, or is not a photo.
        """
        return self._pixels.get(photo)

    def tile(
        self, photo: int, level: int, column: int, row: int, tone: Tone | None = IDENTITY_TONE
    ) -> bytes | None:
        """Return one tile as JPEG; None where it does not exist.

        Parameters
        ----------
        photo
            Row of the photo.
        level
            0: full size; each further one half of it.
        column, row
            Position of the tile at that level.
        tone
            Curve of brightness; None for the automatic one.

        Raises
        ------
        InputError
            The file cannot be read, or is not a photo.
        """
        if not 0 <= photo < len(self._files):
            return None
        tone = self._tones.get(photo)[0] if tone is None else tone
        if level < FIRST_COARSE:
            return fine_tile(self._pixels.get(photo), level, column, row, tone)
        overview = self._overviews.get(photo)
        self._pixels.prefetch(photo)  # a closer view is likely to follow
        return overview.tile(level, column, row, tone)

    def tones(self, photo: int) -> tuple[Tone, Tone] | None:
        """Return the automatic and the stretched tone of a photo; None where it does not exist.

        Raises
        ------
        InputError
            The file cannot be read, or is not a photo.
        """
        if not 0 <= photo < len(self._files):
            return None
        return self._tones.get(photo)

    def read_ahead(self, photo: int) -> None:
        """Start to decode and reduce a photo that will be viewed."""
        self._overviews.prefetch(photo)

    def _find_tones(self, photo: int) -> tuple[Tone, Tone]:
        small = self._overviews.get(photo).coarsest
        pixels = self._pixels.get(photo) if small is None else small
        return choose_tone(pixels), choose_full_range_tone(pixels)

    def _decode(self, photo: int) -> Pixels:
        file = self._files[photo]
        return read_pixels(file.path, (file.width_px, file.height_px))
