"""The field sheet: self-contained HTML, to be printed in black and white."""

from __future__ import annotations

import hashlib
import math

from uavgram.model.maps import Paper
from uavgram.model.naming import METRIC, Units
from uavgram.model.planned import FlightPlanned
from uavgram.views.field_sheet.drawing import field_drawing
from uavgram.views.field_sheet.names import LETTERS
from uavgram.views.pages import page
from uavgram.views.pages_pdf import PAPER_SIZES, page_pdf
from uavgram.views.planned.numbers import metres
from uavgram.views.planned.tables import line_rows, plate_rows, value_rows
from uavgram.views.planned.words import (
    assumed,
    chosen,
    corners_on_earth,
    flight_facts,
    headline,
    if_a_line_is_lost,
    outcome,
    plate_side,
    take_off_words,
    unchecked,
)
from uavgram.views.unit_words import like_lengths
from uavgram.views.units import column

NAME = "field_sheet"
"""Name of its files, without their endings."""


def field_sheet(planned: FlightPlanned, units: Units = METRIC) -> str:
    """Render the page of a plan, to be taken along on paper.

    Parameters
    ----------
    planned
        The plan; names written by people are escaped.
    units
        Units in which lengths are shown.
    """
    lengths = planned.lines.length_m
    named = (*planned.lines.name, *planned.measurements.name, *planned.points.label, planned.name)
    return page(
        "field_sheet/page.html",
        planned=planned,
        view=field_drawing(planned, units),
        letters=LETTERS,
        headline=headline(planned),
        outcome=outcome(planned),
        lines=line_rows(planned),
        plates=plate_rows(planned),
        wanted=value_rows(planned, units),
        facts=flight_facts(planned),
        corners=corners_on_earth(planned),
        unchecked=unchecked(planned),
        lost=if_a_line_is_lost(planned),
        take_off=take_off_words(planned),
        chosen=chosen(planned),
        assumed=assumed(planned),
        plate_side=plate_side(planned),
        longest=metres(math.ceil(lengths.max())) if len(lengths) else "",
        length_of_map=metres(planned.grid.length_m),
        has_log=planned.assumptions.telemetry != "none",
        units=units,
        length_unit=column(units).symbol,
        kept_names=like_lengths(named),
    )


def field_sheet_pdf(html: str, paper: Paper) -> bytes:
    """Convert the sheet to PDF; equal pages give equal bytes.

    Parameters
    ----------
    html
        The page from `field_sheet`.
    paper
        Size of the paper.

    Raises
    ------
    UavgramError
        If WeasyPrint, or a library of the system that it needs, is missing.
    """
    sheet = f"@page {{ size: {PAPER_SIZES[paper]} !important; }}"
    digest = hashlib.sha256(html.encode()).digest()
    return page_pdf(html, sheet, NAME, pdf_identifier=digest[:16])
