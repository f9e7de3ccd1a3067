"""Grey pixels of photos for matching, decoded in the background before they are needed."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping, Sequence

from uavgram.errors import UavgramError
from uavgram.imaging.photos.cache import LruCache
from uavgram.imaging.raster import Image

log = logging.getLogger(__name__)

GREY_BYTES = 140_000_000
"""Memory limit of decoded photos: eleven of 12 megapixels, two of 48."""

LEAST_AHEAD = 4
"""Least number of photos that must fit into the limit for decoding ahead.

Larger photos are decoded when they are needed: two of them beside those shown in colour would take
more memory than the page may use.
"""


class GreyPhotos:
    """Grey pixels of photos by name, for several threads.

    Parameters
    ----------
    size_bytes
        Number of pixels of each photo.
    read
        Decodes one, as it is stored.
    most_bytes
        Memory limit of all decoded photos.
    """

    def __init__(
        self,
        size_bytes: Mapping[str, int],
        read: Callable[[str], Image],
        most_bytes: int = GREY_BYTES,
    ) -> None:
        self._size_bytes, self._most_bytes = dict(size_bytes), most_bytes
        self.photos: LruCache[str, Image] = LruCache(
            read,
            lambda pixels: pixels.nbytes,
            most_bytes,
            expected_bytes=self._size_bytes.__getitem__,
        )
        self._changed = threading.Condition()
        self._wanted: tuple[str, ...] = ()
        self._stopped = False
        self._thread = threading.Thread(target=self._work, name="grey photos", daemon=True)
        self._thread.start()

    def read_ahead(self, names: Sequence[str]) -> None:
        """Decode photos in this order, as many as fit; the order replaces an earlier one."""
        room, wanted = self._most_bytes, []
        for name in names:
            room -= self._size_bytes[name]
            if room < 0 or LEAST_AHEAD * self._size_bytes[name] > self._most_bytes:
                break
            wanted.append(name)
        with self._changed:
            self._wanted = tuple(wanted)
            self._changed.notify()

    def stop(self) -> None:
        """Stop decoding ahead, after the photo in progress."""
        with self._changed:
            self._stopped = True
            self._changed.notify()
        self._thread.join()

    def _work(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._wanted or self._stopped)
                if self._stopped:
                    return
                name, *rest = self._wanted
                self._wanted = tuple(rest)
            try:
                self.photos.get(name)
            except UavgramError as why:  # reported where the photo is requested
                log.info("not decoded ahead: %s", why)
