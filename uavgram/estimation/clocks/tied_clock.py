"""The offset of a camera's clock at which a flight log goes with what tie points say of the photos.

Ties alone tell how photos stand to each other: their places up to a similarity, their directions up
to one turn. Along the log's track they fit at the right instants, and elsewhere the worse the more
the flight turned, climbed or changed its pace between the photos.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from uavgram.estimation.clocks.tied_fit import Fit, fit
from uavgram.model.arrays import Floats

STEP_S = 0.5
"""Of the offsets that are tried: a drone flies a few metres in it."""

FINE_S = 0.02
"""How near the best offset is searched."""

RIVAL = 25.0
"""Sum of squares by which another offset must be worse: five sigmas."""

APART_S = 2.0
"""Offsets nearer than this are the same one."""

MOST_MINIMA = 20
"""Minima that are looked at closely."""

LAG_S = 0.05
"""By which a log's positions and attitudes may be late, all alike."""

Flown = Callable[[Floats], tuple[Floats, Floats]]
"""Positions (N, 3) and attitudes of the vehicle (N, 3, 3) of a log at instants (N,)."""


@dataclass(frozen=True, eq=False)
class TiedClock:
    """What ties say of a camera's clock.

    Attributes
    ----------
    offset_s, sigma_s
        Camera clock minus the log's, and its standard deviation.
    misfit
        Root mean square of what is left, in sigmas of the log.
    rival_s
        Other offsets that fit as well.
    """

    offset_s: float
    sigma_s: float
    misfit: float
    rival_s: tuple[float, ...]


def tied_clock(
    poses: tuple[Floats, Floats], reading_s: Floats, flown: Flown, span_s: tuple[float, float]
) -> TiedClock | None:
    """The offset that fits best; None where no offset puts all photos into the log.

    Parameters
    ----------
    poses
        (N, 3), (N, 3, 3) places and attitudes of at least four photos, in axes of their own.
    reading_s
        (N,) of the camera's clock.
    flown, span_s
        The log, and from when to when it knows where the vehicle was.
    """
    first = float(reading_s.max()) - span_s[1] + FINE_S
    last = float(reading_s.min()) - span_s[0] - FINE_S
    if first >= last:
        return None

    def at(offset_s: float) -> Fit:
        return fit(poses, flown(reading_s - offset_s))

    tried = np.linspace(first, last, max(int((last - first) / STEP_S) + 1, 3))
    cost = np.array([at(offset).cost for offset in tried.tolist()])
    if np.isinf(cost).all():
        return None
    around = np.pad(cost, 1, constant_values=np.inf)
    low = np.flatnonzero(np.isfinite(cost) & (cost <= around[:-2]) & (cost <= around[2:]))
    low = low[np.argsort(cost[low])][:MOST_MINIMA]
    found = sorted(_finest(at, float(tried[k]), (first, last)) for k in low.tolist())
    least, best = found[0]
    square = least / at(best).degrees
    scale = max(square, 1.0)
    # Where the cost hardly rises, the neighbours fit as well, though they are no minima.
    every = [*found, *zip(cost.tolist(), tried.tolist(), strict=True)]
    rivals: list[float] = []
    for cost_there, offset in sorted(every):
        apart = min(abs(offset - other) for other in (best, *rivals))
        if cost_there < least + RIVAL * scale and apart > APART_S:
            rivals.append(offset)
    sigma = _sigma(at, best, scale, (first, last))
    return TiedClock(best, sigma, float(np.sqrt(square)), tuple(rivals))


def _finest(
    at: Callable[[float], Fit], offset_s: float, bounds: tuple[float, float]
) -> tuple[float, float]:
    """Cost and offset of the minimum beside a tried one, halving the step."""
    step, best = STEP_S, (at(offset_s).cost, offset_s)
    while step > FINE_S:
        step *= 0.5
        near = [float(np.clip(best[1] + way * step, *bounds)) for way in (-1, 1)]
        best = min([best, *((at(o).cost, o) for o in near)])
    return best


def _sigma(
    at: Callable[[float], Fit], offset_s: float, scale: float, bounds: tuple[float, float]
) -> float:
    """From how the cost rises on both sides, over the scatter."""
    low, high = max(offset_s - STEP_S, bounds[0]), min(offset_s + STEP_S, bounds[1])
    here = at(offset_s).cost
    rise = max(
        (at(side).cost - here) / (side - offset_s) ** 2 for side in (low, high) if side != offset_s
    )
    return float(np.hypot(np.sqrt(scale / max(rise, 1e-12)), LAG_S))
