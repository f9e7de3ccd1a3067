"""Survey drawn on the ground: measurements, known lengths, points, and a grid."""

from __future__ import annotations

import math

import numpy as np

from uavgram.model.arrays import Bools, Floats
from uavgram.model.result.result import Result
from uavgram.stages.products.map_layers import (
    ENCLOSED,
    measured_strips,
    position_strips,
    reference_strips,
)
from uavgram.views.formatting import measurement_text, number, order_worst_first
from uavgram.views.site_plan.sheet import PAPER, QUIET, THIN_PT, Sheet, half_text
from uavgram.views.style import INK
from uavgram.views.units import round_bar, table_unit, units_of, value_text

MEASURED_PT, KNOWN_PT, NAME_PT, GRID_PT = 7.0, 6.0, 6.0, 5.0
"""Font sizes."""

LINE_PT, CASING_PT = 1.1, 2.4
DASHES = (4.0, 2.5)
GRID_MM = 50.0
"""Largest distance on paper between two lines of the grid."""

GRID_ASIDE_MM = 2.6
"""Distance of the grid's numbers from the frame, outside."""

CROSS_MM = 2.0
"""Half width of the grid's crosses."""

MANY = 25
"""Number of measurements above which they are thin, and named only if there is room."""

DOUBT_MARK = " ?"
"""Mark after a value that is contradicted, or differs in another solution that fits as well."""

DIAMOND_MM = 1.4
IN_MIDDLE_MM = 0.01
"""Half length of the short line in the middle of an area that carries its name."""


def draw_survey(sheet: Sheet, result: Result) -> None:
    """Draw a survey and write all names; measured values have priority.

    Parameters
    ----------
    sheet
        The sheet.
    result
        The survey.
    """
    measured, known = measured_strips(result), reference_strips(result)
    _areas(sheet, result, measured)
    for i, strip in known.items():
        _draw_cased(sheet, strip, INK[result.lines.status[i]], DASHES)
    positions = list(zip(result.control_lines.name, position_strips(result), strict=True))
    for (_, strip), status in zip(positions, result.control_lines.status, strict=True):
        _draw_cased(
            sheet, strip, INK["position" if status == "used" else status], DASHES, share=0.5
        )
    are_few = len(measured) <= MANY
    for strips in measured.values():
        for strip in strips:
            _draw_cased(sheet, strip, INK["measured"], share=1.0 if are_few else 0.5)
    _points(sheet, result)
    units, rows, doubt = units_of(result), result.measurements, is_doubtful(result)
    for k in order_worst_first(rows):
        if strips := measured.get(int(k), []):
            row = measurement_text(rows, int(k), units)
            text = f"{row.name}: {row.value}{DOUBT_MARK if doubt[k] else ''}"
            if rows.kind[k] in ENCLOSED:
                _name_area(sheet, strips, text, is_needed=are_few)
            else:
                _name_strip(sheet, strips, text, "measured", is_needed=are_few)
    for i, strip in known.items():
        length, sigma = float(result.lines.length_m[i]), float(result.lines.sigma_m[i])
        text = f"{result.lines.name[i]}: {value_text(length, sigma, 'm', units)}"
        _name_strip(sheet, [strip], text, result.lines.status[i])
    for (name, strip), status in zip(positions, result.control_lines.status, strict=True):
        _name_strip(sheet, [strip], name, "position" if status == "used" else status)
    _names(sheet, result)
    sheet.write_names()


def is_doubtful(result: Result) -> Bools:
    """Mark the (M,) measured values that have a question mark."""
    rows, units = result.measurements, units_of(result)
    return np.array(
        [
            status in ("doubtful", "contradicted") or bool(measurement_text(rows, k, units).others)
            for k, status in enumerate(rows.status)
        ],
        dtype=np.bool_,
    )


def draw_grid(sheet: Sheet, result: Result) -> float:
    """Draw the grid in local metres or feet, with numbers outside the frame; return its step."""
    plan, units = sheet.plan, units_of(result)
    step, _ = round_bar(GRID_MM * plan.scale / 1000.0, units)
    one = table_unit(units)
    places = max(0, -math.floor(math.log10(step * one.factor) + 1e-9))
    ground, (left, bottom, _, up) = sheet.sheet, plan.frame_mm
    for axis, (low, high) in enumerate(
        ((ground.west_m, ground.east_m), (ground.south_m, ground.north_m))
    ):
        for k in range(math.ceil(low / step), math.floor(high / step) + 1):
            at = float(sheet.on_paper(np.full(2, k * step))[axis])
            sheet.axes.text(
                *((at, bottom + up + GRID_ASIDE_MM) if axis == 0 else (left - GRID_ASIDE_MM, at)),
                f"{'EN'[axis]} {number(k * step * one.factor, places)} {one.symbol}",
                fontsize=GRID_PT, color=QUIET, ha="center", va="center", rotation=90.0 * axis,
            )  # fmt: skip
    _crosses(sheet, step)
    return step


def _crosses(sheet: Sheet, step: float) -> None:
    ground = sheet.sheet
    east, north = (
        step * np.arange(math.ceil(low / step), math.floor(high / step) + 1)
        for low, high in ((ground.west_m, ground.east_m), (ground.south_m, ground.north_m))
    )
    arms = CROSS_MM * np.array([[[-1.0, 0.0], [1.0, 0.0]], [[0.0, -1.0], [0.0, 1.0]]])
    for spot in sheet.on_paper(np.stack(np.meshgrid(east, north), axis=-1).reshape(-1, 2)):
        for colour, width in ((PAPER, 4 * THIN_PT), (QUIET, THIN_PT)):
            for arm in arms:
                sheet.line(spot + arm, colour, width)


def _draw_cased(
    sheet: Sheet, strip: Floats, colour: str, dashes: tuple[float, ...] = (), share: float = 1.0
) -> None:
    """Draw a line on a wider white one, to be visible on any ground."""
    drawn = sheet.on_paper(strip)
    sheet.line(drawn, PAPER, share * CASING_PT)
    sheet.line(drawn, colour, share * LINE_PT, dashes)


def _areas(sheet: Sheet, result: Result, measured: dict[int, list[Floats]]) -> None:
    for i, strips in measured.items():
        if result.measurements.kind[i] in ENCLOSED:
            for strip in strips:
                (face,) = sheet.axes.fill(
                    *sheet.on_paper(strip).T, color=INK["measured"], alpha=0.15, linewidth=0
                )
                face.set_clip_path(sheet.frame)


def _points(sheet: Sheet, result: Result) -> None:
    """Draw dots, with diamonds for points off the ground, which the picture shows displaced."""
    points = result.points
    corners = DIAMOND_MM * np.array([[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    for spot, is_off in zip(
        sheet.on_paper(points.position_world_m), points.is_off_ground, strict=True
    ):
        if not sheet.inside(spot):
            continue
        if is_off:
            sheet.line(spot + corners, INK["above"], LINE_PT)
        sheet.axes.plot(
            *spot, "o", markersize=2.2, color=INK["point"], zorder=5, markeredgecolor=PAPER,
            markeredgewidth=0.4,
        )  # fmt: skip
        sheet.reserve(spot, np.full(2, 0.5))


def _names(sheet: Sheet, result: Result) -> None:
    points, units = result.points, units_of(result)
    height, sigma = points.height_above_ground_m, points.height_sigma_m
    for k, spot in enumerate(sheet.on_paper(points.position_world_m)):
        if sheet.inside(spot):
            text = points.label[k]
            if points.is_off_ground[k]:
                sign = "+" if height[k] > 0 else ""
                text += f" {sign}{value_text(float(height[k]), float(sigma[k]), 'm', units)}"
            sheet.name(text, INK["point"], NAME_PT, spot[None])


def _name_area(sheet: Sheet, strips: list[Floats], text: str, *, is_needed: bool) -> None:
    """Name an area in its middle, or beside its longest side if the middle is off the sheet."""
    middle = sheet.on_paper(np.concatenate([strip[1:] for strip in strips]).mean(axis=0))
    if sheet.inside(middle):
        spots = middle + np.array([[-IN_MIDDLE_MM, 0.0], [IN_MIDDLE_MM, 0.0]])
        sheet.name(text, INK["measured"], MEASURED_PT, spots, is_needed=is_needed)
    else:
        _name_strip(sheet, strips, text, "measured", is_needed=is_needed)


def _name_strip(
    sheet: Sheet, strips: list[Floats], text: str, ink: str, *, is_needed: bool = True
) -> None:
    """Name a line along its longest visible part, or around its middle if that is too short."""
    size_pt = MEASURED_PT if ink == "measured" else KNOWN_PT
    parts = [
        part
        for strip in strips
        for a, b in zip(sheet.on_paper(strip)[:-1], sheet.on_paper(strip)[1:], strict=True)
        if (part := clip_line(a, b, sheet.plan.frame_mm)) is not None
    ]
    if not parts:
        return
    start, end = max(parts, key=lambda part: float(np.linalg.norm(part[1] - part[0])))
    spots = np.stack([start, end])
    spots = spots[np.lexsort(spots.T[::-1])]  # from left to right, as texts are read
    if np.linalg.norm(end - start) >= 2 * half_text(text, size_pt)[0]:
        sheet.name(text, INK[ink], size_pt, spots, "along", is_needed=is_needed)
    else:
        sheet.name(text, INK[ink], size_pt, spots.mean(axis=0)[None], is_needed=is_needed)


def clip_line(
    start: Floats, end: Floats, frame: tuple[float, float, float, float]
) -> tuple[Floats, Floats] | None:
    """Clip a line to a rectangle (Liang and Barsky 1984); return None if it is outside.

    Parameters
    ----------
    start, end
        (2,) ends of the line.
    frame
        Left, bottom, width and height.
    """
    low, high = np.array(frame[:2]), np.array(frame[:2]) + np.array(frame[2:])
    # part of the line inside all four half planes, as an interval of its parameter
    way, enter, leave = end - start, 0.0, 1.0
    for axis in range(2):
        for edge, sign in ((low[axis], -1.0), (high[axis], 1.0)):
            speed, room = sign * way[axis], sign * (edge - start[axis])
            if speed == 0.0:
                if room < 0.0:
                    return None
            elif speed < 0.0:
                enter = max(enter, room / speed)
            else:
                leave = min(leave, room / speed)
    return None if enter >= leave else (start + enter * way, start + leave * way)
