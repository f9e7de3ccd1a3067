"""Tokens of printed addresses: each lets one browser in, once."""

from __future__ import annotations

import hmac
import math
import secrets
import time
from collections.abc import Callable

MOST_OPEN = 16
"""Tokens that wait to be used; with one more, the oldest serves no longer."""


class Tokens:
    """Tokens that were given out and not used yet.

    Parameters
    ----------
    clock
        Seconds.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._ends_s: dict[str, float] = {}

    def new(self, lasts_s: float = math.inf) -> str:
        """A token that serves once, within so many seconds [s]."""
        token = secrets.token_urlsafe(32)
        self._ends_s[token] = self._clock() + lasts_s
        while len(self._ends_s) > MOST_OPEN:
            del self._ends_s[next(iter(self._ends_s))]
        return token

    def is_open(self, token: str) -> bool:
        """Whether a token can still be used."""
        return self._ends_s.get(token, -math.inf) >= self._clock()

    def use(self, given: str) -> bool:
        """Whether a token may come in; it cannot a second time."""
        found = [token for token in self._ends_s if same(token, given)]  # all: no time tells which
        return any(self._ends_s.pop(token) >= self._clock() for token in found)


def same(given: str, wanted: str) -> bool:
    """Whether two texts are the same, in a time that does not tell where they differ."""
    return hmac.compare_digest(given.encode(), wanted.encode())
