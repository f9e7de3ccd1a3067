"""Tiles of many photos, of which few are decoded at a time.

The overview of a photo that was looked at stays: it shows the whole of it at once, and fills the
time until its pixels are decoded again, where those had to make room for another photo's.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from uavgram.imaging.photos.cache import LruCache
from uavgram.imaging.photos.decode import read_pixels
from uavgram.imaging.photos.preview import Pixels
from uavgram.imaging.photos.tiles import FIRST_COARSE, Overview, fine_tile, overview_of
from uavgram.imaging.photos.tone import AS_IT_IS, Tone, automatic_tone, stretched_tone

PIXELS_BYTES = 200_000_000
"""Of decoded photos: one of 48 megapixels takes 144 MB, one of 12 takes 36."""

OVERVIEWS_BYTES = 64_000_000
"""Of overviews: one of a photo of 48 megapixels takes 12 MB."""

IN_USE_S = 10.0
"""Between two requests of a page that is worked with, if at the same time as with others."""

_CHANNELS = 3


@dataclass(frozen=True)
class PhotoFile:
    """A photo to cut tiles from: where it is, and its size as stored."""

    path: str
    width_px: int
    height_px: int


class TiledPhotos:
    """Tiles of photos, for several threads.

    Parameters
    ----------
    files
        The photos.
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
            lambda k: overview_of(self._pixels.get(k)),
            lambda overview: overview.size_bytes,
            OVERVIEWS_BYTES,
        )
        self._tones: LruCache[int, tuple[Tone, Tone]] = LruCache(
            self._find_tones, len, 2 * len(self._files)
        )
        self._shown: dict[str, tuple[float, frozenset[int]]] = {}
        self._lock = threading.Lock()

    def show(self, page: str, photos: Collection[int]) -> None:
        """Know what a page shows side by side: that stays decoded, whatever it takes.

        Pages that sent nothing for `IN_USE_S` are taken to be closed.
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
        """(height, width, 3) BGR of a photo, decoded now if it must be.

        Raises
        ------
        InputError
            The file cannot be read, or is no photo.
        """
        return self._pixels.get(photo)

    def tile(
        self, photo: int, level: int, column: int, row: int, tone: Tone | None = AS_IT_IS
    ) -> bytes | None:
        """JPEG of one tile; None where there is none.

        Parameters
        ----------
        photo
            Row of the photo.
        level
            0: full size; each further one half of it.
        column, row
            Of the tile at that level.
        tone
            How bright it is shown; None: as bright as it is seen well.

        Raises
        ------
        InputError
            The file cannot be read, or is no photo.
        """
        if not 0 <= photo < len(self._files):
            return None
        tone = self._tones.get(photo)[0] if tone is None else tone
        if level < FIRST_COARSE:
            return fine_tile(self._pixels.get(photo), level, column, row, tone)
        overview = self._overviews.get(photo)
        self._pixels.prefetch(photo)  # who looks at the whole will look closer
        return overview.tile(level, column, row, tone)

    def tones(self, photo: int) -> tuple[Tone, Tone] | None:
        """How a photo is shown where nobody chose, and stretched; None where there is none.

        Raises
        ------
        InputError
            The file cannot be read, or is no photo.
        """
        if not 0 <= photo < len(self._files):
            return None
        return self._tones.get(photo)

    def read_ahead(self, photo: int) -> None:
        """Begin to decode and reduce a photo that will be looked at."""
        self._overviews.prefetch(photo)

    def _find_tones(self, photo: int) -> tuple[Tone, Tone]:
        small = self._overviews.get(photo).coarsest
        pixels = self._pixels.get(photo) if small is None else small
        return automatic_tone(pixels), stretched_tone(pixels)

    def _decode(self, photo: int) -> Pixels:
        file = self._files[photo]
        return read_pixels(file.path, (file.width_px, file.height_px))
