"""Tokens of printed addresses: each admits one browser, once."""

from __future__ import annotations

import hmac
import math
import secrets
import time
from collections.abc import Callable

MOST_OPEN = 16
"""Largest number of unused tokens; with one more, the oldest becomes invalid."""


class Tokens:
    """Tokens that were issued and not used yet.

    Parameters
    ----------
    clock
        Clock [s].
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._ends_s: dict[str, float] = {}

    def new(self, lasts_s: float = math.inf) -> str:
        """Issue a token that is valid once, for `lasts_s` seconds."""
        token = secrets.token_urlsafe(32)
        self._ends_s[token] = self._clock() + lasts_s
        while len(self._ends_s) > MOST_OPEN:
            del self._ends_s[next(iter(self._ends_s))]
        return token

    def is_open(self, token: str) -> bool:
        """Return whether a token can still be used."""
        return self._ends_s.get(token, -math.inf) >= self._clock()

    def use(self, given: str) -> bool:
        """Return whether a token is valid, and consume it."""
        found = [token for token in self._ends_s if same(token, given)]  # all: constant time
        return any(self._ends_s.pop(token) >= self._clock() for token in found)


def same(given: str, wanted: str) -> bool:
    """Return whether two texts are equal, in a time independent of where they differ."""
    return hmac.compare_digest(given.encode(), wanted.encode())
