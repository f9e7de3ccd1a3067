"""Strip beside the plan: scale, north, legend, and notes with their typesetting."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from matplotlib.patches import Polygon, Rectangle

from uavgram.model.maps import Plan
from uavgram.model.provenance import case_from_options
from uavgram.model.result.result import Result
from uavgram.views.sentence_units import convert_sentence, list_names_like_lengths
from uavgram.views.site_plan.drawing import DASHES, DIAMOND_MM, DOUBT_MARK, LINE_PT, is_doubtful
from uavgram.views.site_plan.sheet import INK as BLACK
from uavgram.views.site_plan.sheet import PAPER, QUIET, THIN_PT, Sheet, plain, width_mm
from uavgram.views.style import INK
from uavgram.views.survey.key_facts import accuracy_words
from uavgram.views.survey.verdict import summarise_result
from uavgram.views.units import round_bar, table_unit, units_of

NOTE_PT, MIN_NOTE_PT = 7.0, 4.5
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
    verdict = convert_sentence(
        summarise_result(result), units_of(result), list_names_like_lengths(result)
    )
    told = [case, verdict, accuracy_words(result), LEANS, _grid_note(result)]
    if is_doubtful(result).any():
        told.append(
            f"{DOUBT_MARK.strip()} after a value: it is doubtful. The report gives the reason."
        )
    told.append(ACTUAL_SIZE)
    if len(sheet.plan.sheets) > 1:
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
    for size_pt in np.arange(NOTE_PT, MIN_NOTE_PT, -0.25).tolist():
        note = _set(told, size_mm[0], size_pt)
        if note.height_mm <= size_mm[1]:
            return note
    return _set(told, size_mm[0], MIN_NOTE_PT)


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


TITLE_PT, TEXT_PT, FOOT_PT, NUMBER_PT = 11.0, 6.0, 5.0, 11.0
BAR_MM, NORTH_MM = 50.0, 59.0
"""Largest length of the scale bar, and place of the north arrow right of it."""

SIGNS_MM, NOTES_MM = 66.0, 113.0
"""Left edges of the columns below a frame, from the frame's left."""

BELOW_TITLE_MM = 22.0
INCH_MM = 25.4
INDEX_MM = 21.0
FOOT_MM = 6.5


def draw_legend(
    sheet: Sheet, result: Result, title: str, notes: tuple[str, ...], foot: str
) -> None:
    """Fill the paper below the frame, or beside it on a landscape sheet.

    Parameters
    ----------
    sheet
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
    left, bottom, across, up = sheet.plan.frame_mm
    told = (*plan_notes(result, sheet), *notes)
    if sheet.plan.paper_mm[0] < sheet.plan.paper_mm[1]:
        top = bottom - 3.0
        _title(sheet, result, title, left, top)
        _index(sheet, left, top - BELOW_TITLE_MM)
        _signs(sheet, result, left + SIGNS_MM, top - 1.5)
        size = across - NOTES_MM, top - 1.5 - FOOT_MM - 2.0
        _paragraphs(sheet, told, (left + NOTES_MM, top - 1.5), size)
    else:
        left, top = left + across + 5.0, bottom + up
        right = sheet.plan.paper_mm[0] - sheet.plan.frame_mm[0]
        _title(sheet, result, title, left, top)
        below = _index(sheet, left, top - BELOW_TITLE_MM - 2.0)
        below = _signs(sheet, result, left, below)
        _paragraphs(sheet, told, (left, below - 2.0), (right - left, below - 2.0 - bottom))
    _write(sheet, sheet.plan.frame_mm[0], FOOT_MM, foot, FOOT_PT, colour=QUIET)


def _title(sheet: Sheet, result: Result, title: str, left: float, top: float) -> None:
    _write(sheet, left, top - 2.5, result.name, TITLE_PT, weight="bold")
    scale = f"1:{sheet.plan.scale}"
    if units_of(result).length != "m":
        scale += f" (1 in is {sheet.plan.scale / 12:g} ft)"
    _write(sheet, left, top - 8.0, f"Plan {scale}, {title}", 7.0)
    _scale_bar(sheet, result, left, top - 14.0)
    _north(sheet, left + NORTH_MM, top - 15.0)


def _write(
    sheet: Sheet, x: float, y: float, text: str, size_pt: float, *, colour: str = BLACK,
    weight: str = "normal", align: str = "left",
) -> None:  # fmt: skip
    sheet.axes.text(
        x, y, plain(text), fontsize=size_pt, color=colour, weight=weight, ha=align, va="center"
    )


def _scale_bar(sheet: Sheet, result: Result, left: float, y: float) -> None:
    """Draw the scale bar, with its length on the ground and on paper."""
    bar_m, words = round_bar(BAR_MM * sheet.plan.scale / 1000.0, units_of(result))
    long = bar_m * 1000.0 / sheet.plan.scale
    for k in range(5):
        face = BLACK if k % 2 == 0 else PAPER
        sheet.axes.add_patch(
            Rectangle(
                (left + k * long / 5, y - 0.9),
                long / 5,
                1.8,
                facecolor=face,
                edgecolor=BLACK,
                linewidth=THIN_PT,
            )
        )
    metric = units_of(result).length == "m"
    paper = f"{long:.1f} mm on paper" if metric else f"{long / INCH_MM:.2f} in on paper"
    _write(sheet, left, y - 3.2, "0", TEXT_PT)
    _write(sheet, left + long, y - 3.2, words, TEXT_PT, align="center")
    _write(sheet, left + long / 2, y - 3.2, paper, FOOT_PT, align="center")


def _north(sheet: Sheet, x: float, y: float) -> None:
    shape = np.array([[0.0, 5.0], [2.0, -3.0], [0.0, -1.4], [-2.0, -3.0]]) + np.array([x, y])
    sheet.axes.add_patch(Polygon(shape, closed=True, facecolor=BLACK, linewidth=0))
    _write(sheet, x, y + 6.6, "N", 7.0, align="center")


def _signs(sheet: Sheet, result: Result, x: float, y: float) -> float:
    """Draw the signs that occur in the survey; return the lower end of the list."""
    rows: list[tuple[str, tuple[float, ...], str]] = [
        (INK["measured"], (), "measured ± standard deviation")
    ]
    words = {
        "used": "known length, used",
        "checked": "known length, kept for checking",
        "suspect": "known length that does not fit",
        "removed": "known length that does not fit",
        "unseen": "known length, not seen",
    }
    kinds = dict.fromkeys(words[status] for status in result.lines.status)
    inks = {words[status]: INK[status] for status in result.lines.status}
    rows += [(inks[kind], DASHES, kind) for kind in kinds]
    if result.control_lines.name:
        rows.append((INK["position"], DASHES, "line of known position"))
    for k, (ink, dashes, text) in enumerate(rows):
        at = y - k * 4.0
        (line,) = sheet.axes.plot([x, x + 7.0], [at, at], color=ink, linewidth=LINE_PT)
        if dashes:
            line.set_dashes(dashes)
        _write(sheet, x + 8.5, at, text, TEXT_PT)
    at = y - len(rows) * 4.0
    sheet.axes.plot(x + 3.5, at, "o", markersize=2.2, color=INK["point"])
    _write(sheet, x + 8.5, at, "point", TEXT_PT)
    if result.points.is_off_ground.any():
        at -= 4.0
        corners = DIAMOND_MM * np.array([[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]])
        shape = corners + np.array([x + 3.5, at])
        sheet.axes.add_patch(
            Polygon(shape, closed=True, fill=False, edgecolor=INK["above"], linewidth=LINE_PT)
        )
        _write(sheet, x + 8.5, at, "off the ground, and how high", TEXT_PT)
    return at - 3.0


def _paragraphs(
    sheet: Sheet, told: tuple[str, ...], corner: tuple[float, float], size: tuple[float, float]
) -> None:
    """Write paragraphs below each other from an upper left corner on, in a width and height."""
    note = fit_notes(told, size)
    x, y = corner
    for lines in note.paragraphs:
        for line in lines:
            _write(sheet, x, y, line, note.size_pt)
            y -= note.line_mm
        y -= note.gap_mm


def _index(sheet: Sheet, x: float, y: float) -> float:
    """Draw a small index of all sheets, this one filled, if there are several; return its end."""
    plan = sheet.plan
    if len(plan.sheets) == 1:
        return y
    side = min(INDEX_MM / plan.columns, INDEX_MM / plan.rows)
    for one in plan.sheets:
        face = "#c9d3df" if one.number == sheet.sheet.number else PAPER
        corner = x + one.column * side, y - (one.row + 1) * side
        sheet.axes.add_patch(
            Rectangle(corner, side, side, facecolor=face, edgecolor=BLACK, linewidth=THIN_PT)
        )
        middle = corner[0] + side / 2, corner[1] + side / 2
        _write(sheet, *middle, str(one.number), min(6.0, 1.6 * side), align="center")
    return y - plan.rows * side - 4.0


def outline_sheets(sheet: Sheet, tiled: Plan) -> None:
    """Outline the sheets of the tiled plan on an overview, with their numbers."""
    left, bottom, _, up = sheet.plan.frame_mm
    for one in tiled.sheets:
        west, south = one.west_m, one.south_m
        corners = np.array(
            [
                [west, south], [one.east_m, south], [one.east_m, one.north_m],
                [west, one.north_m], [west, south],
            ]
        )  # fmt: skip
        drawn = sheet.on_paper(corners)
        sheet.line(drawn, PAPER, 6 * THIN_PT)
        sheet.line(drawn, BLACK, 2 * THIN_PT)
        corner = np.maximum(drawn[3], [left, -np.inf])
        corner = np.minimum(corner, [np.inf, bottom + up])
        sheet.name(str(one.number), BLACK, NUMBER_PT, corner[None] + [4.0, -4.0], "at")
