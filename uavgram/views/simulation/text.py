"""Simulation for the terminal."""

from __future__ import annotations

from uavgram.model.simulation import Simulation
from uavgram.views.simulation.words import (
    HEADER,
    amiss,
    costs,
    counts,
    headline,
    reasons,
    rows_of,
    unlike,
)
from uavgram.views.terminal import aligned

COST_HEADER = ("disturbance", "error, times", "error/stated", "in 95 %", "green")


def simulation_lines(simulation: Simulation) -> list[str]:
    """Format table, headline and counts.

    Parameters
    ----------
    simulation
        The simulation.
    """
    rows = rows_of(simulation.repetitions, simulation.accuracy)
    table = aligned([HEADER, *(row[:-1] for row in rows)], right=tuple(range(2, len(HEADER))))
    lines = [table, "", headline(simulation), counts(simulation.repetitions)]
    lines += [text for text in (amiss(simulation), unlike(simulation)) if text]
    lines += [f"  {count} times: {text}" for count, text in reasons(simulation.repetitions)]
    if found := costs(simulation):
        lines += ["", aligned([COST_HEADER, *found], right=(1, 2, 3, 4))]
    return lines
