"""Drawings of a simulation: ranges of each measurement, and convergence of the simulation."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uavgram.model.simulation import Simulation

LEFT, WIDTH, RIGHT = 210.0, 1000.0, 30.0
ROW, TOP, BOTTOM = 26.0, 22.0, 34.0
LOWEST, HIGHEST = 0.25, 8.0
"""Ratios at the ends of the axis; values beyond are drawn at the end."""

TICKS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
CURVE_HEIGHT = 190.0


class Bar(NamedTuple):
    """Row of a measurement: name, height in the drawing, ends and estimate on the axis."""

    name: str
    y: float
    low: float
    high: float
    at: float
    is_bad: bool


class Ranges(NamedTuple):
    """Drawing of ranges: size, positions of ticks with their texts, rows."""

    width: float
    height: float
    ticks: list[tuple[float, str]]
    rows: list[Bar]


class Curve(NamedTuple):
    """Convergence of spread over prediction; `band` is the effect of chance on one value."""

    width: float
    height: float
    path: str
    band: str
    one: float
    ticks: list[tuple[float, str]]
    heights: list[tuple[float, str]]


def _across(ratio: float) -> float:
    """Return the position on the logarithmic axis."""
    share = math.log(min(max(ratio, LOWEST), HIGHEST) / LOWEST) / math.log(HIGHEST / LOWEST)
    return LEFT + (WIDTH - LEFT - RIGHT) * share


def ranges_of(simulation: Simulation) -> Ranges:
    """Draw the error over stated sigma of each measurement, with its 95 % range.

    Parameters
    ----------
    simulation
        The simulation.
    """
    accuracy = simulation.accuracy
    known = np.flatnonzero(np.isfinite(accuracy.z)).tolist()
    rows = []
    for k, i in enumerate(known):
        low, high = accuracy.z_range[i].tolist()
        rows.append(
            Bar(
                name=simulation.repetitions.name[i],
                y=TOP + ROW * (k + 0.5),
                low=_across(low),
                high=_across(high),
                at=_across(float(accuracy.z[i])),
                is_bad=low > 1.0,
            )
        )
    ticks = [(_across(tick), f"{tick:g}") for tick in TICKS]
    return Ranges(WIDTH, TOP + ROW * len(rows) + BOTTOM, ticks, rows)


def curve_of(simulation: Simulation) -> Curve | None:
    """Draw spread over prediction against the number of repetitions; return None if too few.

    Parameters
    ----------
    simulation
        The simulation.
    """
    points = [(n, ratio) for n, ratio in simulation.running if n > 2 and math.isfinite(ratio)]
    if len(points) < 3:
        return None
    first, last = points[0][0], points[-1][0]

    def x(count: float) -> float:
        return 60.0 + (WIDTH - 90.0) * math.log(count / first) / math.log(last / first)

    def y(ratio: float) -> float:
        return CURVE_HEIGHT - BOTTOM - (CURVE_HEIGHT - BOTTOM - 12.0) * min(ratio, 2.0) / 2.0

    # 95 % range of a standard deviation from n samples: 1 +- 1.96 / sqrt(2 (n - 1))
    chance = [(n, 1.96 / math.sqrt(2.0 * (n - 1))) for n, _ in points]
    upper = [(x(n), y(1.0 + off)) for n, off in chance]
    lower = [(x(n), y(max(1.0 - off, 0.0))) for n, off in reversed(chance)]
    counts = sorted({first, last} | {n for n in (10, 30, 100, 300, 1000) if first < n < last})
    return Curve(
        width=WIDTH,
        height=CURVE_HEIGHT,
        path=_path([(x(n), y(ratio)) for n, ratio in points]),
        band=_path(upper + lower) + " Z",
        one=y(1.0),
        ticks=[(x(n), str(n)) for n in counts],
        heights=[(y(ratio), f"{ratio:g}") for ratio in (0.0, 0.5, 1.0, 1.5, 2.0)],
    )


def _path(points: list[tuple[float, float]]) -> str:
    return "M " + " L ".join(f"{x:.1f} {y:.1f}" for x, y in points)
