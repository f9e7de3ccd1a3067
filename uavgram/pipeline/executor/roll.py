"""Which workers of a cluster are there, and which were heard of lately."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class _Heard:
    threads: int
    sign: float
    """The scheduler's time of the last sign of life; its clock is not ours."""
    at: float
    """When that changed, on our clock."""


class Roll:
    """Workers by their addresses.

    Parameters
    ----------
    silent_s
        Seconds without a sign of life after which a worker counts as gone.
    """

    def __init__(self, silent_s: float) -> None:
        self._silent_s = silent_s
        self._all: dict[str, _Heard] = {}

    def call(self, workers: Mapping[str, Mapping[str, Any]], now: float) -> None:
        """Note what the scheduler says of its workers, by address, at a time of our clock."""
        before, self._all = self._all, {}
        for address, one in workers.items():
            sign, known = float(one["last_seen"]), before.get(address)
            at = now if known is None or known.sign != sign else known.at
            self._all[address] = _Heard(int(one["nthreads"]), sign, at)

    def heard(self, now: float) -> dict[str, int]:
        """Threads of those that were heard of lately."""
        return {
            name: one.threads for name, one in self._all.items() if now - one.at <= self._silent_s
        }
