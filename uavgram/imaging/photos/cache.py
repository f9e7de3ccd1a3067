"""Values within a memory limit, safe for threads, and grey photos decoded ahead of their use."""

from __future__ import annotations

import logging
import threading
from collections import OrderedDict
from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from typing import Generic, TypeVar

from uavgram.errors import UavgramError
from uavgram.imaging.raster import Image

Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")


def _unforeseen(_: object) -> int:
    return 0


class LruCache(Generic[Key, Value]):
    """Cache of values, each made once; the least recently used are removed first.

    Threads that request the same value at the same time share its making. A requested value is kept
    even if it alone exceeds the limit.

    Parameters
    ----------
    make
        Makes a value.
    size_bytes
        Size of a value.
    most_bytes
        Limit of the size of all kept values.
    expected_bytes
        Expected size of a value before it is made: this much room is made first, so that the new
        and the old never take memory at the same time. 0 where it is not known.
    """

    def __init__(
        self,
        make: Callable[[Key], Value],
        size_bytes: Callable[[Value], int],
        most_bytes: int,
        *,
        expected_bytes: Callable[[Key], int] = _unforeseen,
    ) -> None:
        self._make = make
        self._size_bytes = size_bytes
        self._most_bytes = most_bytes
        self._expected_bytes = expected_bytes
        self._lock = threading.Lock()
        self._kept: OrderedDict[Key, Future[Value]] = OrderedDict()
        self._held: frozenset[Key] = frozenset()

    def get(self, key: Key) -> Value:
        """Return the value of a key, made now if necessary; an error of its making is raised."""
        future, mine = self._request_value(key)
        if mine:
            self._fill(key, future)
        return future.result()

    def has(self, key: Key) -> bool:
        """Return whether the value of a key is made."""
        with self._lock:
            future = self._kept.get(key)
        return future is not None and future.done()

    def prefetch(self, key: Key) -> None:
        """Start to make a value that will be requested."""
        future, mine = self._request_value(key)
        if mine:
            threading.Thread(target=self._prefetch, args=(key, future), daemon=True).start()

    def hold(self, keys: Collection[Key]) -> None:
        """Keep these values, regardless of the limit, until others are held.

        Otherwise values that are needed side by side would be made in turn, again and again.
        """
        held = frozenset(keys)
        with self._lock:
            if held != self._held:
                self._held = held
                self._trim()

    def _request_value(self, key: Key) -> tuple[Future[Value], bool]:
        """Return the future of a key's value, and whether the caller has to make it."""
        with self._lock:
            future = self._kept.get(key)
            mine = future is None
            if future is None:
                future = self._kept[key] = Future()
            self._kept.move_to_end(key)
            if mine:
                self._trim()
        return future, mine

    def _fill(self, key: Key, future: Future[Value]) -> None:
        try:
            value = self._make(key)
        except BaseException as fault:
            with self._lock:
                del self._kept[key]
            future.set_exception(fault)
            raise
        future.set_result(value)
        with self._lock:
            self._trim()

    def _prefetch(self, key: Key, future: Future[Value]) -> None:
        with suppress(UavgramError):  # it is made again, and the error raised, on request
            self._fill(key, future)

    def _trim(self) -> None:
        """Remove values beyond the limit, except the last requested one; the lock must be held."""
        sizes = {
            key: self._size_bytes(future.result()) if future.done() else self._expected_bytes(key)
            for key, future in self._kept.items()
        }
        total = sum(sizes.values())
        for key, future in list(self._kept.items())[:-1]:  # the least recently used first
            if total <= self._most_bytes:
                return
            if future.done() and key not in self._held:
                total -= sizes[key]
                del self._kept[key]


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
