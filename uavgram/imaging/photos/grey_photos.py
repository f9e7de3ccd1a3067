"""Grey pixels of photos in which something is sought: decoded beforehand, in the background."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping, Sequence

from uavgram.errors import UavgramError
from uavgram.imaging.photos.cache import LruCache
from uavgram.imaging.raster import Image

log = logging.getLogger(__name__)

GREY_BYTES = 140_000_000
"""Of decoded photos: eleven of 12 megapixels, two of 48."""

LEAST_AHEAD = 4
"""Photos of which fewer have room are decoded when they are looked at, not before: two of them
beside those that are shown in colour would take more memory than the page may."""


class GreyPhotos:
    """Grey pixels of photos by name, for several threads.

    Parameters
    ----------
    size_bytes
        Of each photo: its number of pixels.
    read
        Decodes one, as it is stored.
    most_bytes
        That all decoded ones may take together.
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
        """Decode photos in this order, as many as have room; those asked for before are left."""
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
        """Decode nothing more ahead; waits for the photo under way."""
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
            except UavgramError as why:  # told where it is asked for
                log.info("not decoded ahead: %s", why)
