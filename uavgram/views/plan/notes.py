"""Sentences beside the plan, and their typesetting."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.model.provenance import case_from_options
from uavgram.model.result.result import Result
from uavgram.views.plan.sheet import Sheet, width_mm
from uavgram.views.plan.surveyed import DOUBT, is_doubtful
from uavgram.views.survey.accuracy import accuracy_words
from uavgram.views.survey.verdict import headline
from uavgram.views.unit_words import in_units, names_like_lengths
from uavgram.views.units import column, units_of

TEXT_PT, LEAST_PT = 7.0, 4.5
"""Limits of the font size of the notes, which is as large as the room allows."""

_LINE_MM, _GAP = 0.43, 0.35
"""Line spacing [mm] per point of font size, and gap between paragraphs as a share of that."""

LEANS = (
    "Picture: the photos, projected onto the plane of the ground. Objects above the ground "
    "appear displaced away from the camera: only surveyed points are at their true place."
)
ACTUAL_SIZE = (
    'Print at "actual size" (100 %) and check the scale bar with a ruler: its length is stated.'
)
JOIN = (
    "To join the sheets: cut along the dashed lines, right and below, and lay each cut edge onto "
    "the frame of the next sheet."
)


class Note(NamedTuple):
    """Lines of each paragraph with font size [pt] and distances [mm]."""

    paragraphs: tuple[tuple[str, ...], ...]
    size_pt: float
    line_mm: float
    gap_mm: float

    @property
    def height_mm(self) -> float:
        """Height of all lines and gaps."""
        return sum(len(lines) * self.line_mm + self.gap_mm for lines in self.paragraphs)


def plan_notes(result: Result, sheet: Sheet) -> tuple[str, ...]:
    """List the notes of every plan, the verdict first.

    Parameters
    ----------
    result
        Result shown by the plan.
    sheet
        One of its sheets, with all its content.
    """
    case = "; ".join(
        f"{word}: {text}" for word, text in case_from_options(result.provenance.options)
    )
    verdict = in_units(headline(result), units_of(result), names_like_lengths(result))
    told = [case, verdict, accuracy_words(result), LEANS, _grid_note(result)]
    if is_doubtful(result).any():
        told.append(f"{DOUBT.strip()} after a value: it is doubtful. The report gives the reason.")
    told.append(ACTUAL_SIZE)
    if len(sheet.plan.sheets) > 1:
        told.append(JOIN)
    return tuple(filter(None, told))


def _grid_note(result: Result) -> str:
    origin = result.world.origin
    if origin is None:
        return ""
    unit = "metres" if column(units_of(result)).symbol == "m" else "feet"
    return (
        f"Grid: {unit} east (E) and north (N) of latitude {origin.latitude_deg:.7f}°, "
        f"longitude {origin.longitude_deg:.7f}°."
    )


def fitted(told: tuple[str, ...], size_mm: tuple[float, float]) -> Note:
    """Break sentences into lines, with the largest font size that fits.

    Parameters
    ----------
    told
        The paragraphs.
    size_mm
        Width and height available.
    """
    for size_pt in np.arange(TEXT_PT, LEAST_PT, -0.25).tolist():
        note = _set(told, size_mm[0], size_pt)
        if note.height_mm <= size_mm[1]:
            return note
    return _set(told, size_mm[0], LEAST_PT)


def _set(told: tuple[str, ...], across_mm: float, size_pt: float) -> Note:
    paragraphs = tuple(_lines(text, across_mm / size_pt) for text in told)
    line = _LINE_MM * size_pt
    return Note(paragraphs, size_pt, line, _GAP * line)


def _lines(text: str, across: float) -> tuple[str, ...]:
    """Break a text into lines for a font size of one point."""
    space = width_mm("a a", 1.0) - 2 * width_mm("a", 1.0)
    lines: list[list[str]] = []
    room = 0.0
    for word in text.split():
        need = space + width_mm(word, 1.0)
        if not lines or need > room:
            lines.append([])
            room = across + space
        lines[-1].append(word)
        room -= need
    return tuple(" ".join(line) for line in lines)
