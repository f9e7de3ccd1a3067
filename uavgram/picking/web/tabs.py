"""Open tabs of the page: each keeps a socket to the server."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator


class Tabs:
    """Number of open tabs, and the time since the last one was closed.

    Parameters
    ----------
    clock
        Clock [s].
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._open = clock, 0
        self._closed_at_s: float | None = None

    @contextlib.contextmanager
    def one(self) -> Iterator[None]:
        """Count a tab while it is open."""
        self._open += 1
        try:
            yield
        finally:
            self._open -= 1
            self._closed_at_s = self._clock()

    def expect(self) -> None:
        """Restart the time since the last tab, as a new address was given."""
        if self._closed_at_s is not None:
            self._closed_at_s = self._clock()

    def gone_s(self) -> float:
        """Return the time since the last tab was closed [s]; 0 while one is open, or none came."""
        if self._open or self._closed_at_s is None:
            return 0.0
        return self._clock() - self._closed_at_s
