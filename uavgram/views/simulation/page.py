"""simulation.html: one self-contained page on a simulated survey."""

from __future__ import annotations

from uavgram.model.simulation import Simulation
from uavgram.views.pages import page
from uavgram.views.simulation.drawings import curve_of, ranges_of
from uavgram.views.simulation.words import (
    amiss,
    costs,
    counts,
    headline,
    level_of,
    reasons,
    rows_of,
    unlike,
    warned,
)


def render_simulation_page(simulation: Simulation) -> str:
    """Render the page as text; it loads nothing from elsewhere."""
    found = simulation.repetitions
    return page(
        "simulation.html",
        simulation=simulation,
        level=level_of(simulation),
        headline=headline(simulation),
        counts=counts(found),
        rows=rows_of(found, simulation.accuracy),
        ranges=ranges_of(simulation),
        curve=curve_of(simulation),
        reasons=reasons(found),
        amiss=amiss(simulation),
        unlike=unlike(simulation),
        warned=warned(found),
        costs=costs(simulation),
    )
