"""Tiles of many photos, few of which are decoded at a time.

The overview of a viewed photo is kept: it shows the whole photo at once, and bridges the time until
its pixels are decoded again after another photo replaced them.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from uavgram.imaging.photos.cache import LruCache
from uavgram.imaging.photos.decode import read_pixels
from uavgram.imaging.photos.preview import Pixels
from uavgram.imaging.photos.tiles import FIRST_COARSE, Overview, fine_tile, make_overview
from uavgram.imaging.photos.tone import IDENTITY_TONE, Tone, choose_full_range_tone, choose_tone

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
