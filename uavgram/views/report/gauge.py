"""Number of sigmas as a mark on a scale."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

REACH = 6.0
"""Sigmas from the middle of a gauge to its ends; larger values are drawn at the end."""


class Gauge(NamedTuple):
    """Number of sigmas as a mark on a scale from minus to plus `REACH`.

    Attributes
    ----------
    at, low, high
        Positions of the mark and of the ends of the zone within the limit, in percent of the scale.
    outside
        Whether the mark is beyond the limit.
    """

    at: float
    low: float
    high: float
    outside: bool


def gauge(sigmas: float, limit: float) -> Gauge | None:
    """Draw a number of sigmas against a limit; return None if it is not finite."""
    if not np.isfinite(sigmas):
        return None
    at = float(np.clip(sigmas, -REACH, REACH))
    return Gauge(
        at=_percent(at),
        low=_percent(-limit),
        high=_percent(limit),
        outside=abs(sigmas) > limit,
    )


def _percent(sigmas: float) -> float:
    return round(50.0 + 50.0 * sigmas / REACH, 1)
