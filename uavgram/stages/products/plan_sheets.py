"""Lay a plan onto paper: scale, and number of sheets."""

from __future__ import annotations

import math

import numpy as np

from uavgram.errors import GeometryError
from uavgram.model.arrays import Floats
from uavgram.model.maps import PAPER_MM, Paper, Plan, PlanSheet
from uavgram.model.result.result import Result
from uavgram.stages.products.map_layers import measured_strips

MARGIN_MM = 10.0
"""Margin of the sheet: printers leave about half of it white."""

LEGEND_MM = (50.0, 66.0)
"""Height of the legend below the frame of a portrait sheet, and its width beside a landscape
one."""

OVERLAP_MM = 10.0
MOST_SHEETS = 100

ROOM_SHARE, LEAST_ROOM_M = 0.08, 0.5
"""Margin of ground around the survey: as a share of its size, and at least [m]."""

METRIC_STEPS = (1.0, 2.0, 2.5, 5.0)
FOOT_STEPS = (1.2, 2.4, 3.6, 4.8, 6.0, 7.2)
"""Factors of a power of ten for scales; with feet, an inch is 1, 2, ... 6 times such feet."""


def find_surveyed_extent(result: Result) -> tuple[Floats, Floats]:
    """Return the south-west and north-east corner (2,) of the plan's ground.

    Raises
    ------
    GeometryError
        There is no point.
    """
    places = [result.points.position_world_m, *measured_strips(result).values()]
    together = np.concatenate(places)[:, :2]
    if not len(together):
        raise GeometryError("no point has a place, so there is no plan: pick points in the photos")
    low, high = together.min(axis=0), together.max(axis=0)
    room = max(ROOM_SHARE * float((high - low).max()), LEAST_ROOM_M)
    return low - room, high + room


def lay_plan(
    extent: tuple[Floats, Floats],
    paper: Paper,
    scale: int | None = None,
    steps: tuple[float, ...] = METRIC_STEPS,
) -> Plan:
    """Lay the ground onto sheets, portrait or landscape.

    Parameters
    ----------
    extent
        South-west and north-east corner (2,) of the ground.
    paper
        Its size.
    scale
        Such as 100; by default the largest at which one sheet is enough.
    steps
        Scales to choose from are these times a power of ten.

    Raises
    ------
    GeometryError
        That scale takes too many sheets.
    """
    low, high = extent
    upright = PAPER_MM[paper]
    turned = [_frame(upright), _frame(upright[::-1])]
    if scale is None:
        scale = min(_round_scale(high - low, frame, steps) for _, frame in turned)
    counts = [_count((high - low) * 1000.0 / scale, frame) for _, frame in turned]
    best = int(np.argmin([columns * rows for columns, rows in counts]))
    (columns, rows), (size, frame) = counts[best], turned[best]
    if columns * rows > MOST_SHEETS:
        one = min(_round_scale(high - low, frame, steps) for _, frame in turned)
        raise GeometryError(
            f"a plan at 1:{scale} takes {columns * rows} sheets, more than {MOST_SHEETS}: ask for "
            f"a smaller scale (--plan-scale with a larger number); at 1:{one} it fits on one sheet"
        )
    return Plan(
        scale=scale,
        paper_mm=size,
        frame_mm=frame,
        overlap_mm=OVERLAP_MM,
        columns=columns,
        rows=rows,
        sheets=_sheets((low + high) / 2, frame, scale, columns, rows),
    )


def _frame(
    size: tuple[float, float],
) -> tuple[tuple[float, float], tuple[float, float, float, float]]:
    """Return the oriented paper, and the frame on it."""
    width, height = size[0] - 2 * MARGIN_MM, size[1] - 2 * MARGIN_MM
    if size[0] < size[1]:
        return size, (MARGIN_MM, MARGIN_MM + LEGEND_MM[0], width, height - LEGEND_MM[0])
    return size, (MARGIN_MM, MARGIN_MM, width - LEGEND_MM[1], height)


def _round_scale(size_m: Floats, frame: tuple[float, ...], steps: tuple[float, ...]) -> int:
    """Return the largest of the usual scales at which the ground fits into the frame."""
    least = float((size_m * 1000.0 / np.array(frame[2:])).max())
    power = 10.0 ** math.floor(math.log10(least))
    usual = sorted(step * p for step in steps for p in (power / 10, power, 10 * power))
    fits = (round(scale) for scale in usual if scale >= least and scale >= 1)
    return max(next(fits), 1)


def _count(size_mm: Floats, frame: tuple[float, ...]) -> tuple[int, int]:
    """Return the numbers of columns and rows of sheets."""
    step = np.array(frame[2:]) - OVERLAP_MM
    columns, rows = np.maximum(np.ceil((size_mm - OVERLAP_MM) / step - 1e-9), 1).astype(int)
    return int(columns), int(rows)


def _sheets(
    middle: Floats, frame: tuple[float, ...], scale: int, columns: int, rows: int
) -> tuple[PlanSheet, ...]:
    size = np.array(frame[2:]) * scale / 1000.0
    step = size - OVERLAP_MM * scale / 1000.0
    whole = step * [columns - 1, rows - 1] + size
    west, north = float(middle[0] - whole[0] / 2), float(middle[1] + whole[1] / 2)
    sheets = []
    for row in range(rows):
        for column in range(columns):
            left, top = west + column * float(step[0]), north - row * float(step[1])
            sheets.append(
                PlanSheet(
                    number=row * columns + column + 1,
                    column=column,
                    row=row,
                    west_m=left,
                    south_m=top - float(size[1]),
                    east_m=left + float(size[0]),
                    north_m=top,
                )
            )
    return tuple(sheets)
