"""The strip below the plan: scale, north, what the signs mean, and what a reader must know."""

from __future__ import annotations

import textwrap

import numpy as np
from matplotlib.patches import Polygon, Rectangle

from uavgram.model.arrays import Floats
from uavgram.model.maps.plan import Plan, PlanSheet
from uavgram.model.result.result import Result
from uavgram.views.plan.sheet import INK as BLACK
from uavgram.views.plan.sheet import PAPER, QUIET, THIN_PT, Sheet, plain
from uavgram.views.plan.surveyed import DASHES, DIAMOND_MM, LINE_PT
from uavgram.views.survey.top_view import INK
from uavgram.views.survey.verdict import headline
from uavgram.views.units import round_bar, spread_text, units_of

TEXT_PT, TITLE_PT, FOOT_PT = 6.0, 11.0, 5.0
BAR_MM = 50.0
SIGNS_MM, NOTES_MM = 60.0, 106.0
"""Where the columns below a frame begin, from its left."""

LETTER_MM = 1.1
"""Of a line of notes, the usual width of a letter."""

INDEX_MM = 22.0

LEANS = (
    "Picture: the photos, laid onto the plane of the ground. What stands above the ground leans "
    "away from the camera and is not where it seems: only its surveyed points are in their place."
)
ACTUAL_SIZE = (
    'Print at "actual size" (100 %) and hold a ruler to the scale bar: it says how long it must be.'
)


def draw_legend(
    sheet: Sheet, result: Result, title: str, notes: tuple[str, ...], foot: str
) -> None:
    """Fill the paper below the frame, or beside it where the sheet lies.

    Parameters
    ----------
    sheet
        Where to.
    result
        Whose plan it is.
    title
        Below the name: which sheet it is.
    notes
        Sentences beside those that every plan has.
    foot
        One line at the very bottom.
    """
    left, bottom, across, up = sheet.plan.frame_mm
    told = (headline(result), ACTUAL_SIZE, LEANS, *notes)
    index = INDEX_MM + 4.0 if len(sheet.plan.sheets) > 1 else 0.0
    if sheet.plan.paper_mm[0] < sheet.plan.paper_mm[1]:
        top = bottom - 3.0
        _title(sheet, result, title, left, top)
        _signs(sheet, result, left + SIGNS_MM, top - 1.5)
        _paragraphs(sheet, told, left + NOTES_MM, top - 1.5, across - NOTES_MM - index)
        _index(sheet, left + across - INDEX_MM, top - 1.0)
    else:
        left, top = left + across + 5.0, bottom + up
        right = sheet.plan.paper_mm[0] - sheet.plan.frame_mm[0]
        _title(sheet, result, title, left, top)
        below = _signs(sheet, result, left, top - 26.0)
        below = _paragraphs(sheet, told, left, below - 2.0, right - left)
        _index(sheet, left, below - 2.0)
    _write(sheet, sheet.plan.frame_mm[0], 6.5, foot, FOOT_PT, colour=QUIET)


def _title(sheet: Sheet, result: Result, title: str, left: float, top: float) -> None:
    _write(sheet, left, top - 2.5, result.name, TITLE_PT, weight="bold")
    _write(sheet, left, top - 8.0, f"Plan 1:{sheet.plan.scale}, {title}", 7.0)
    _scale_bar(sheet, result, left, top - 14.0)
    _north(sheet, left + 53.0, top - 14.5)


def accuracy_note(result: Result) -> str:
    """``Places on earth: about 2.1 m. Distances between neighbours: about 1 cm ...``."""
    points, units = result.points, units_of(result)
    near = points.neighbour_sigma_m
    told = []
    if np.isfinite(near).any():
        one = spread_text(float(np.nanmedian(near)), "m", units)
        told.append(f"Distances between neighbouring points are known to ± {one}.")
    if result.world.gauge == "plane":
        told.append("Nothing ties this survey to the earth: north is arbitrary, lengths hold.")
    else:
        where = "on earth"
        if result.world.origin is None:
            where = "among the control points and lines, whose east and north these are,"
        sigma = np.sqrt(np.trace(points.covariance_m2, axis1=1, axis2=2) / 2)
        place = spread_text(float(np.median(sigma)), "m", units)
        told.append(
            f"The place of the whole survey {where} is known to ± {place} (east, north): an error "
            "of it shifts the grid, and changes no length."
        )
    return " ".join(told)


def _write(
    sheet: Sheet, x: float, y: float, text: str, size_pt: float, *, colour: str = BLACK,
    weight: str = "normal", align: str = "left",
) -> None:  # fmt: skip
    sheet.axes.text(
        x, y, plain(text), fontsize=size_pt, color=colour, weight=weight, ha=align, va="center"
    )


def _scale_bar(sheet: Sheet, result: Result, left: float, y: float) -> None:
    """Draw it, with its length on the ground and on paper."""
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
    _write(sheet, left, y - 3.2, "0", TEXT_PT)
    _write(sheet, left + long, y - 3.2, words, TEXT_PT, align="center")
    _write(sheet, left + long / 2, y - 3.2, f"{long:.1f} mm on paper", FOOT_PT, align="center")


def _north(sheet: Sheet, x: float, y: float) -> None:
    shape = np.array([[0.0, 5.0], [2.0, -3.0], [0.0, -1.4], [-2.0, -3.0]]) + np.array([x, y])
    sheet.axes.add_patch(Polygon(shape, closed=True, facecolor=BLACK, linewidth=0))
    _write(sheet, x, y + 6.6, "N", 7.0, align="center")


def _signs(sheet: Sheet, result: Result, x: float, y: float) -> float:
    """Only those that occur in the survey; where they end."""
    rows: list[tuple[str, tuple[float, ...], str]] = [
        (INK["measured"], (), "measured ± standard deviation")
    ]
    words = {
        "used": "known length, used",
        "checked": "known length, withheld",
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


def _paragraphs(sheet: Sheet, told: tuple[str, ...], x: float, y: float, width_mm: float) -> float:
    """Write them below each other; where they end."""
    for text in told:
        for line in textwrap.wrap(text, max(int(width_mm / LETTER_MM), 20)):
            _write(sheet, x, y, line, TEXT_PT)
            y -= 2.6
        y -= 0.7
    return y


def _index(sheet: Sheet, x: float, y: float) -> None:
    """All sheets, small; this one is filled. One alone needs none."""
    plan = sheet.plan
    if len(plan.sheets) == 1:
        return
    side = min(INDEX_MM / plan.columns, INDEX_MM / plan.rows)
    for one in plan.sheets:
        face = "#c9d3df" if one.number == sheet.sheet.number else PAPER
        corner = x + one.column * side, y - (one.row + 1) * side
        sheet.axes.add_patch(
            Rectangle(corner, side, side, facecolor=face, edgecolor=BLACK, linewidth=THIN_PT)
        )
        middle = corner[0] + side / 2, corner[1] + side / 2
        _write(sheet, *middle, str(one.number), min(6.0, 1.6 * side), align="center")


def outline_sheets(sheet: Sheet, tiled: Plan) -> None:
    """On an overview: where the sheets of the tiled plan lie, with their numbers."""
    for one in tiled.sheets:
        corners = np.array(
            [
                [one.west_m, one.south_m], [one.east_m, one.south_m], [one.east_m, one.north_m],
                [one.west_m, one.north_m], [one.west_m, one.south_m],
            ]
        )  # fmt: skip
        drawn = sheet.on_paper(corners)
        sheet.line(drawn, BLACK, 2 * THIN_PT)
        _sheet_number(sheet, one, (drawn[0] + drawn[2]) / 2)


def _sheet_number(sheet: Sheet, one: PlanSheet, middle: Floats) -> None:
    text = sheet.axes.text(
        float(middle[0]),
        float(middle[1]),
        str(one.number),
        fontsize=16,
        color=BLACK,
        alpha=0.6,
        ha="center",
        va="center",
    )
    text.set_clip_path(sheet.frame)
