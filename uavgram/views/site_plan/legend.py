"""Strip beside the plan: scale, north, legend, and notes with their typesetting."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.maps import Plan, PlanSheet
from uavgram.model.provenance import case_from_options
from uavgram.model.result.result import Result
from uavgram.views.sentence_units import convert_sentence, list_names_like_lengths
from uavgram.views.style import INK
from uavgram.views.survey.drawing import BLACK, PAPER, Drawing, Look, Sign
from uavgram.views.survey.key_facts import accuracy_words
from uavgram.views.survey.sheet import Sheet
from uavgram.views.survey.text_placement import ASIDE, LETTERS, Letters, half_size
from uavgram.views.survey.top_view import (
    BOLD,
    DIAMOND,
    DOUBT_MARK,
    FINE,
    is_doubtful,
    known_look,
)
from uavgram.views.survey.verdict import summarise_result
from uavgram.views.units import table_unit, units_of

MIN_NOTE = 0.64
"""Least size of the notes' letters, as a share of the usual; they are as large as there is room."""

_LINE_MM, _GAP = 3.0, 0.35
"""Distance of lines [mm] of the usual size, and gap between paragraphs as a share of that."""

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
    """Lines of each paragraph with relative size of the letters and distances [mm]."""

    paragraphs: tuple[tuple[str, ...], ...]
    size: float
    line_mm: float
    gap_mm: float

    @property
    def height_mm(self) -> float:
        """Height of all lines and gaps."""
        return sum(len(lines) * self.line_mm + self.gap_mm for lines in self.paragraphs)


def plan_notes(result: Result, page: PlanPage) -> tuple[str, ...]:
    """List the notes of every plan, the verdict first.

    Parameters
    ----------
    result
        Result shown by the plan.
    page
        One of its sheets, with all its content.
    """
    case = "; ".join(
        f"{word}: {text}" for word, text in case_from_options(result.provenance.options)
    )
    verdict = convert_sentence(
        summarise_result(result), units_of(result), list_names_like_lengths(result)
    )
    told = [case, verdict, accuracy_words(result), LEANS, _grid_note(result)]
    if is_doubtful(result).any():
        told.append(
            f"{DOUBT_MARK.strip()} after a value: it is doubtful. The report gives the reason."
        )
    told.append(ACTUAL_SIZE)
    if len(page.plan.sheets) > 1:
        told.append(JOIN)
    return tuple(filter(None, told))


def _grid_note(result: Result) -> str:
    origin = result.world.origin
    if origin is None:
        return ""
    unit = "metres" if table_unit(units_of(result)).symbol == "m" else "feet"
    return (
        f"Grid: {unit} east (E) and north (N) of latitude {origin.latitude_deg:.7f}°, "
        f"longitude {origin.longitude_deg:.7f}°."
    )


def fit_notes(told: tuple[str, ...], size_mm: tuple[float, float]) -> Note:
    """Break sentences into lines, with the largest font size that fits.

    Parameters
    ----------
    told
        The paragraphs.
    size_mm
        Width and height available.
    """
    for size in np.arange(1.0, MIN_NOTE, -0.03).tolist():
        note = _set(told, size_mm[0], size)
        if note.height_mm <= size_mm[1]:
            return note
    return _set(told, size_mm[0], MIN_NOTE)


def _set(told: tuple[str, ...], across_mm: float, size: float) -> Note:
    paragraphs = tuple(_lines(text, across_mm / size) for text in told)
    return Note(paragraphs, size, _LINE_MM * size, _GAP * _LINE_MM * size)


def _lines(text: str, across_mm: float) -> tuple[str, ...]:
    """Break a text into lines for letters of the usual size."""
    lines: list[str] = []
    for word in text.split():
        longer = f"{lines[-1]} {word}" if lines else word
        width = 2 * (half_size(longer, PLAN_LETTERS["note"])[0] - ASIDE) * UNIT_MM
        if lines and width <= across_mm:
            lines[-1] = longer
        else:
            lines.append(word)
    return tuple(lines)


SIGNS_MM, NOTES_MM = 62.0, 113.0
"""Left edges of the columns below a frame, from the frame's left."""

BELOW_TITLE_MM = 12.0
INCH_MM = 25.4
INDEX_MM = 21.0
FOOT_MM = 6.5
UNIT_MM = 0.225
"""Millimetres of one unit of the drawing: letters of 11 have 7 points."""

PLAN_LETTERS = LETTERS | {
    "title": Letters(17.0, is_bold=True),
    "subtitle": Letters(11.0),
    "sign": Letters(9.5),
    "note": Letters(11.0),
    "foot": Letters(7.8, colour="#5b6470"),
    "sheet": Letters(11.0, colour="#5b6470"),
    "number": Letters(17.0),
}


class PlanPage:
    """Paper with a frame that shows the ground.

    Attributes
    ----------
    plan, one
        The sheet's position on the ground.
    drawing
        The drawing in millimetres of paper.
    sheet
        Mapping from the world to it.
    """

    def __init__(self, plan: Plan, one: PlanSheet) -> None:
        """Make an empty sheet."""
        (left, bottom, across, up), (width, height) = plan.frame_mm, plan.paper_mm
        low = np.array([left, height - bottom - up])
        self.plan, self.one = plan, one
        self.drawing = Drawing(
            "Plan to scale", width, height, unit=UNIT_MM, letters=PLAN_LETTERS,
            frame=(low, low + np.array([across, up])),
        )  # fmt: skip
        scale = 1000.0 / plan.scale
        corner = np.array([one.west_m, one.north_m]) - low / scale * [1.0, -1.0]
        self.sheet = Sheet(float(corner[0]), float(corner[1]), scale, width, height, 0.0)

    def in_world(self, drawn_mm: Floats) -> Floats:
        """Convert (..., 2) millimetres on paper to places in the world."""
        corner = np.array([self.sheet.west_m, self.sheet.north_m])
        return np.asarray(corner + drawn_mm / self.sheet.scale * [1.0, -1.0])


def draw_legend(
    page: PlanPage, result: Result, title: str, notes: tuple[str, ...], foot: str
) -> None:
    """Fill the paper below the frame, or beside it on a landscape sheet.

    Parameters
    ----------
    page
        The sheet.
    result
        Result shown by the plan.
    title
        Title of the sheet, below the name.
    notes
        Sentences in addition to those of every plan.
    foot
        One line at the very bottom.
    """
    drawing = page.drawing
    (left, top), (right, bottom) = drawing.low, drawing.high
    told = (*plan_notes(result, page), *notes)
    if drawing.width < drawing.height:
        _title(page, result, title, left, bottom + 6.0)
        _index(page, left, bottom + 6.0 + BELOW_TITLE_MM)
        _signs(drawing, result, left + SIGNS_MM, bottom + 5.0)
        corner, low = (left + NOTES_MM, bottom + 5.0), drawing.height - FOOT_MM - 2.0
        _paragraphs(drawing, told, corner, (right - corner[0], low - corner[1]))
    else:
        x = right + 5.0
        _title(page, result, title, x, top + 4.0)
        below = _index(page, x, top + 4.0 + BELOW_TITLE_MM)
        below = _signs(drawing, result, x, below + 2.0) + 2.0
        _paragraphs(drawing, told, (x, below), (drawing.width - left - x, bottom - below))
    drawing.write((left, drawing.height - FOOT_MM), foot, "foot", side=-1)


def _title(page: PlanPage, result: Result, title: str, left: float, top: float) -> None:
    page.drawing.write((left, top), result.name, "title", side=-1)
    scale = f"1:{page.plan.scale}"
    if units_of(result).length != "m":
        scale += f" (1 in is {page.plan.scale / 12:g} ft)"
    page.drawing.write((left, top + 6.0), f"Plan {scale}, {title}", "subtitle", side=-1)


def _signs(drawing: Drawing, result: Result, x: float, y: float) -> float:
    """Draw the signs that occur in the survey; return the lower end of the list."""
    words = {
        "used": "known length, used",
        "checked": "known length, withheld as a check",
        "suspect": "known length that does not fit",
        "removed": "known length that does not fit",
        "unseen": "known length, not seen",
    }
    rows = {"measured ± standard deviation": Look(INK["measured"], BOLD)}
    for status in result.lines.status:
        rows.setdefault(words[status], known_look(status, INK[status], BOLD))
    if result.control_lines.name:
        rows["line of known position"] = known_look("used", INK["position"], FINE)
    for text, look in rows.items():
        drawing.lines("samples", [np.array([[x, y - 1.0], [x + 7.0, y - 1.0]])], look)
        drawing.write((x + 8.5, y), text, "sign", side=-1)
        y += 4.0
    marks: list[tuple[str, Sign, float, Look]] = [("point", "ring", 2.2, Look(fill=INK["point"]))]
    if result.points.is_off_ground.any():
        text, look = "off the ground, and how high", Look(INK["point"], 1.1)
        marks.append((text, "diamond", DIAMOND, look))
    for text, sign, radius, look in marks:
        drawing.signs("samples", np.array([[x + 3.5, y - 1.0]]), radius, look, sign=sign)
        drawing.write((x + 8.5, y), text, "sign", side=-1)
        y += 4.0
    return y


def _paragraphs(
    drawing: Drawing, told: tuple[str, ...], corner: tuple[float, float], size: tuple[float, float]
) -> None:
    """Write paragraphs below each other from an upper left corner on, in a width and height."""
    note = fit_notes(told, size)
    x, y = corner
    for lines in note.paragraphs:
        for line in lines:
            drawing.write((x, y), line, "note", side=-1, size=note.size)
            y += note.line_mm
        y += note.gap_mm


def _index(page: PlanPage, x: float, y: float) -> float:
    """Draw a small index of all sheets, this one filled, if there are several; return its end."""
    plan, drawing = page.plan, page.drawing
    if len(plan.sheets) == 1:
        return y
    side = min(INDEX_MM / plan.columns, INDEX_MM / plan.rows)
    square = side * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    for one in plan.sheets:
        corner = np.array([x + one.column * side, y + one.row * side])
        fill = "#c9d3df" if one.number == page.one.number else PAPER
        drawing.lines("index", [corner + square], Look(BLACK, 0.6, fill=fill), closed=True)
        middle = corner + side * np.array([0.5, 0.65])
        drawing.write(middle, str(one.number), "sign", size=min(1.0, 0.25 * side))
    return y + plan.rows * side + 4.0
