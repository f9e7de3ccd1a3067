"""Page breaks on paper: which styles fill the pages better, from where things are on them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

END = "end"
"""Id of the empty element after all others."""

ABOVE_PLAN, PLAN, LEGEND, BELOW_PLAN = "above-plan", "plan", "plan-legend", "below-plan"
"""Ids of the plan of the first page and of its legend, and of the empty elements around both."""

GAPS = 26.0
"""Height of the gaps above and below a plan."""

HALF = 0.5
"""Share of a page below which it is half empty."""

FEW = 0.35
"""Share of a page whose content closer lines may bring onto the pages before it."""

CLOSER = """
body { line-height: 1.3 !important; } h2 { margin-top: 9pt !important; }
td, th { padding-top: 2px !important; padding-bottom: 2px !important; }
.card { margin-bottom: 5px !important; } .card.third { width: 30% !important; }
table.sign td { height: 34px !important; }
"""
"""Style of closer lines and smaller pictures."""


BREAK = "break-before: page;"


class Sheet(NamedTuple):
    """Where the elements with an id begin on a page.

    Attributes
    ----------
    top, bottom
        Upper and lower end of the room for text.
    filled
        Lower end of the elements on it.
    places
        Distances from the upper edge by id, in the same unit (96 to an inch).
    """

    top: float
    bottom: float
    filled: float
    places: dict[str, float]


class Layout(NamedTuple):
    """Pages, and the additional styles with which they were laid out."""

    styles: tuple[str, ...]
    sheets: tuple[Sheet, ...]


def improve_pages(layouts: Sequence[Layout]) -> tuple[str, ...]:
    """Choose the styles of the next layout, so that no page is half empty.

    A plan for which there is no room below the text of its page becomes lower. A last page with
    little on it is avoided by closer lines; if these do not suffice, the last two pages share
    their content evenly.

    Parameters
    ----------
    layouts
        All layouts up to now.

    Returns
    -------
    Those of the last layout if nothing is to be changed.
    """
    styles, sheets = layouts[-1]
    if lower := _lower_plan(sheets):
        return styles if lower in styles else (*styles, lower)
    few = _share_of_last_page(sheets)
    if few > HALF or any(BREAK in one for one in styles):
        return styles
    if few < FEW and CLOSER not in styles:
        return (*styles, CLOSER)
    if CLOSER in styles and len(sheets) == len(layouts[-2].sheets):
        styles, sheets = layouts[-2]
    name = _find_even_break(sheets)
    return (*styles, f"#{name} {{ {BREAK} }}") if name else styles


def _lower_plan(sheets: Sequence[Sheet]) -> str:
    """Make a plan that is on the page after the text above it as low as the room below the text."""
    for sheet, after in pairwise(sheets):
        if ABOVE_PLAN in sheet.places and PLAN in after.places:
            legend = after.places[BELOW_PLAN] - after.places[LEGEND]
            room = sheet.bottom - sheet.places[ABOVE_PLAN] - legend - GAPS
            return f"#{PLAN} img {{ height: {room:.0f}px !important; width: auto !important; }}"
    return ""


def _share_of_last_page(sheets: Sequence[Sheet]) -> float:
    """Return the share of the last page above the end; 1 for a single page, or without an end."""
    last = sheets[-1] if sheets else None
    if last is None or len(sheets) == 1 or END not in last.places:
        return 1.0
    return (last.places[END] - last.top) / (last.bottom - last.top)


def _find_even_break(sheets: Sequence[Sheet]) -> str:
    """Find the element of the page before the last from which on all moves to the last page.

    Returns
    -------
    Its id; empty if the emptier of both pages would then have less on it than now.
    """
    before, last = sheets[-2:]
    now = last.places[END] - last.top
    lesser = {
        name: min(place - before.top, moved)
        for name, place in before.places.items()
        if name not in (ABOVE_PLAN, PLAN, LEGEND, BELOW_PLAN)
        and (moved := before.filled - place + now) < last.bottom - last.top
    }
    best = max(lesser, key=lesser.__getitem__, default="")
    return best if best and lesser[best] > now else ""
