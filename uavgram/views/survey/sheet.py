"""Drawing seen from above, north up: world metres to its own units, and the grid behind it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.naming import Units
from uavgram.views.survey.drawing import COMPASS_ROOM, PAPER, Drawing, Look
from uavgram.views.units import round_bar, table_unit

WIDTH = 720.0
"""Width of every drawing, in its own units; letters are 11 of them high: 8 points on paper."""
MARGIN, MARGIN_SHARE = 60.0, 0.08
"""Margin around the drawing; for a low drawing a share of its height."""
MIN_HEIGHT, MAX_HEIGHT = 260.0, 840.0
MAX_STEP = 140.0
"""Largest distance of grid lines; the least is two fifths of that."""
EDGE, LETTER = 4.0, 5.6
"""Gap between the side of a drawing and text along it; width of a letter there."""
SCALE_BAR, EASTINGS = 44.0, 24.0
"""Heights of the areas of the scale bar and of the eastings' names, where no northing is named."""


@dataclass(frozen=True)
class Sheet:
    """North up: x = margin + (east - west) * scale, y = margin + (north_m - north) * scale.

    Attributes
    ----------
    west_m, north_m
        World coordinates of the upper left corner inside the margins.
    scale
        Units of the drawing for a metre.
    width, height, margin
        Size and margin of the drawing.
    """

    west_m: float
    north_m: float
    scale: float
    width: float
    height: float
    margin: float

    def __call__(self, world_m: Floats) -> Floats:
        """Map (..., 2 or 3) world positions to (..., 2) drawing coordinates."""
        east, north = world_m[..., 0], world_m[..., 1]
        x = self.margin + (east - self.west_m) * self.scale
        return np.stack([x, self.margin + (self.north_m - north) * self.scale], axis=-1)

    @property
    def extent_m(self) -> tuple[Floats, Floats]:
        """South-west and north-east corner (2,) of the ground that the whole drawing covers."""
        west, north = (
            self.west_m - self.margin / self.scale,
            self.north_m + self.margin / self.scale,
        )
        size = np.array([self.width, self.height]) / self.scale
        return np.array([west, north - size[1]]), np.array([west + size[0], north])


def lay_sheet(
    low_m: Floats,
    high_m: Floats,
    most_height: float = MAX_HEIGHT,
    *,
    width: float = WIDTH,
    least_height: float = MIN_HEIGHT,
    margin: float = MARGIN,
) -> Sheet:
    """Fit a rectangle of ground into a drawing, in its middle.

    Parameters
    ----------
    low_m, high_m
        (2,) its south-western and north-eastern corner, in the world.
    most_height, least_height
        Limits of the height of the drawing.
    width, margin
        Width of the drawing, and of the margin around the ground.
    """
    margin = min(margin, MARGIN_SHARE * most_height)
    size = np.maximum(high_m - low_m, 1.0)
    across, up = width - 2 * margin, most_height - 2 * margin
    # largest scale at which both sides fit
    scale = float(min(across / size[0], up / size[1]))
    height = max(float(size[1]) * scale + 2 * margin, min(least_height, most_height))
    spare = (np.array([width, height]) - 2 * margin) / scale - size
    return Sheet(
        west_m=float(low_m[0] - spare[0] / 2),
        north_m=float(low_m[1] + size[1] + spare[1] / 2),
        scale=scale,
        width=width,
        height=height,
        margin=margin,
    )


def draw_frame(
    drawing: Drawing,
    sheet: Sheet,
    longest_m: float,
    units: Units,
    *,
    is_north_known: bool,
    on_picture: bool = False,
    bar_note: Callable[[float], str] = lambda _: "",
    most_step: float = MAX_STEP,
) -> None:
    """Draw lines at round numbers of metres or feet, named along two sides, scale bar and north.

    Parameters
    ----------
    drawing, sheet
        The drawing, and its place in the world.
    longest_m
        Largest length of the scale bar.
    units
        Units of lengths.
    is_north_known
        Whether up in the drawing is north.
    on_picture
        Whether it has a picture of the ground.
    bar_note
        Returns what is written after the length of the scale bar, from its length in the drawing.
    most_step
        Largest distance of the lines, in units of the letters.
    """
    unit, u, origin = table_unit(units), drawing.unit, sheet(np.zeros(2))
    step_m = round_bar(most_step * u / sheet.scale, units)[0]
    lines: list[Floats] = []
    for axis, name in enumerate("EN" if is_north_known else "xy"):
        step = step_m * sheet.scale * (1.0 if axis == 0 else -1.0)
        reach = sorted((edge[axis] - origin[axis]) / step for edge in (drawing.low, drawing.high))
        for count in np.arange(np.ceil(reach[0]), np.floor(reach[1]) + 1):
            ends = np.stack([drawing.low, drawing.high])
            ends[:, axis] = at = origin[axis] + count * step
            lines.append(ends)
            text = f"{name} {count * step_m * unit.factor + 0.0:g}"
            half = u * LETTER * len(text) / 2
            low, high = drawing.low[axis], drawing.high[axis]
            if axis == 0:
                place = at, drawing.low[1] + 10.0 * u
                low, high = low + half, high - COMPASS_ROOM * u - half
            else:
                place = drawing.low[0] + EDGE * u + half, at - 3.0 * u
                low, high = low + EASTINGS * u, high - SCALE_BAR * u
            if low < at < high:
                drawing.write(place, text, "grid", patch=0.65 * on_picture)
    look = Look(PAPER, 0.6, opacity=0.55) if on_picture else Look("#9aa3ad", 0.6, opacity=0.45)
    drawing.lines("grid", lines, look)
    patch = 0.8 * on_picture
    bar_m, text = round_bar(longest_m, units)
    corner = drawing.low[0] + 24.0 * u, drawing.high[1] - 22.0 * u
    drawing.scale_bar(*corner, bar_m * sheet.scale, text + bar_note(bar_m * sheet.scale), patch)
    drawing.compass("N" if is_north_known else "up in photo 1", patch)
