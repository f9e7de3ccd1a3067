"""Cache of values within a memory limit, safe for threads."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Collection, Hashable
from concurrent.futures import Future
from contextlib import suppress
from typing import Generic, TypeVar

from uavgram.errors import UavgramError

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
        future, mine = self._asked(key)
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
        future, mine = self._asked(key)
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

    def _asked(self, key: Key) -> tuple[Future[Value], bool]:
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
