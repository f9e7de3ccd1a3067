"""Open tabs of the page: each keeps a socket to the server."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator


class Tabs:
    """Number of open tabs, and the time without one: since the last was closed, or the beginning.

    Parameters
    ----------
    clock
        Clock [s].
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._open = clock, 0
        self._none_since_s = clock()

    @contextlib.contextmanager
    def one(self) -> Iterator[None]:
        """Count a tab while it is open."""
        self._open += 1
        try:
            yield
        finally:
            self._open -= 1
            self._none_since_s = self._clock()

    def expect(self) -> None:
        """Restart the time without a tab, as a new address was given."""
        self._none_since_s = self._clock()

    def gone_s(self) -> float:
        """Return the time without a tab [s]; 0 while one is open."""
        return 0.0 if self._open else self._clock() - self._none_since_s
