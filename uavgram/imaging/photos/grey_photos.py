"""Grey pixels of photos in which something is sought: decoded beforehand, in the background."""

from __future__ import annotations

import logging
import os
import threading
from collections.abc import Sequence

import cv2
import numpy as np

from uavgram.errors import InputError, UavgramError
from uavgram.imaging.photos.cache import LruCache
from uavgram.imaging.photos.preview import Pixels
from uavgram.imaging.photos.tiled_photos import PhotoFile

log = logging.getLogger(__name__)

GREY_BYTES = 200_000_000
"""Of decoded photos: one of 12 megapixels takes 12 MB, one of 48 takes 48."""


class GreyPhotos:
    """Grey pixels of photos, for several threads.

    Parameters
    ----------
    files
        The photos.
    most_bytes
        That all decoded ones may take together.
    """

    def __init__(self, files: Sequence[PhotoFile], most_bytes: int = GREY_BYTES) -> None:
        self._files, self._most_bytes = tuple(files), most_bytes
        self._pixels: LruCache[int, Pixels] = LruCache(
            self._decode,
            lambda pixels: pixels.nbytes,
            most_bytes,
            expected_bytes=lambda k: self._files[k].width_px * self._files[k].height_px,
        )
        self._changed = threading.Condition()
        self._wanted: tuple[int, ...] = ()
        self._stopped = False
        self._thread = threading.Thread(target=self._work, name="grey photos", daemon=True)
        self._thread.start()

    def pixels(self, photo: int) -> Pixels:
        """(height, width) of a photo as it is stored, decoded now if it must be.

        Raises
        ------
        InputError
            The file cannot be read, is no photo, or has another size than it had.
        """
        return self._pixels.get(photo)

    def is_ready(self, photo: int) -> bool:
        """Whether a photo is decoded."""
        return self._pixels.has(photo)

    def read_ahead(self, photos: Sequence[int]) -> None:
        """Decode photos in this order, as many as have room; those asked for before are left."""
        room, wanted = self._most_bytes, []
        for k in photos:
            room -= self._files[k].width_px * self._files[k].height_px
            if room < 0:
                break
            wanted.append(k)
        with self._changed:
            self._wanted = tuple(wanted)
            self._changed.notify()

    def stop(self) -> None:
        """Decode nothing more ahead; waits for the photo under way."""
        with self._changed:
            self._stopped, self._wanted = True, ()
            self._changed.notify()
        self._thread.join()

    def _work(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._wanted or self._stopped)
                if self._stopped:
                    return
                photo, *rest = self._wanted
                self._wanted = tuple(rest)
            try:
                self._pixels.get(photo)
            except UavgramError as why:  # told where it is asked for
                log.info("not decoded ahead: %s", why)

    def _decode(self, photo: int) -> Pixels:
        file = self._files[photo]
        flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
        pixels = cv2.imread(os.fspath(file.path), flags)
        if pixels is None:
            raise InputError(file.path, "cannot be read as a photo: is it still there?")
        if pixels.shape != (file.height_px, file.width_px):
            raise InputError(file.path, "has another size than when the project was read")
        return np.asarray(pixels, dtype=np.uint8)
