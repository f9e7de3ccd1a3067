"""Drawing seen from above, north up: world metres to its own units, and the grid behind it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.naming import Units
from uavgram.views.style import ABOVE, BELOW, hex_colour
from uavgram.views.units import round_bar, table_unit

WIDTH = 720.0
"""Width of every drawing, in its own units; letters are 11 of them high: 8 points on paper."""
MARGIN, MARGIN_SHARE = 60.0, 0.12
"""Margin around the drawing; for a low drawing a share of its height."""
MIN_HEIGHT, MAX_HEIGHT = 260.0, 840.0
MAX_STEP = 140.0
"""Largest distance of grid lines; the least is two fifths of that."""
EDGE, LETTER = 4.0, 5.6
"""Gap between the side of a drawing and text along it; width of a letter there."""
COMPASS, SCALE_BAR, EASTINGS = 90.0, 44.0, 24.0
"""Sizes of the areas of north arrow and scale bar, where no line of the grid is named, and of the
eastings' names along the top, where no northing is."""

INK = {
    "used": "#b0127a",
    "suspect": "#c62828",
    "removed": "#c62828",
    "checked": "#6a3fb5",
    "unseen": "#777777",
    "position": "#8e24aa",
    "measured": "#00796b",
    "point": "#222222",
    "ellipse": "#e07b00",
    "above": hex_colour(ABOVE),
    "below": hex_colour(BELOW),
}
"""Colours on white paper, where those of the screen are too faint."""


@dataclass(frozen=True)
class Sheet:
    """North up: x = margin + (east - west) * scale, y = margin + (north_m - north) * scale.

    Attributes
    ----------
    west_m, north_m
        World coordinates of the upper left corner inside the margins.
    scale
        Units of the drawing for a metre.
    height, margin
        Height and margin of the drawing.
    """

    west_m: float
    north_m: float
    scale: float
    height: float
    margin: float

    def __call__(self, world_m: Floats) -> Floats:
        """Map (..., 2 or 3) world positions to (..., 2) drawing coordinates."""
        east, north = world_m[..., 0], world_m[..., 1]
        x = self.margin + (east - self.west_m) * self.scale
        return np.stack([x, self.margin + (self.north_m - north) * self.scale], axis=-1)

    @property
    def corners(self) -> tuple[Floats, Floats]:
        """First and last corner (2,) of the drawing, in its own units."""
        return np.zeros(2), np.array([WIDTH, self.height])

    @property
    def extent_m(self) -> tuple[Floats, Floats]:
        """South-west and north-east corner (2,) of the ground that the whole drawing covers."""
        west, north = (
            self.west_m - self.margin / self.scale,
            self.north_m + self.margin / self.scale,
        )
        size = np.array([WIDTH, self.height]) / self.scale
        return np.array([west, north - size[1]]), np.array([west + size[0], north])


def lay_sheet(low_m: Floats, high_m: Floats, most_height: float = MAX_HEIGHT) -> Sheet:
    """Fit a rectangle of ground into a drawing.

    Parameters
    ----------
    low_m, high_m
        (2,) its south-western and north-eastern corner, in the world.
    most_height
        Largest height of the drawing.
    """
    margin = min(MARGIN, MARGIN_SHARE * most_height)
    size = np.maximum(high_m - low_m, 1.0)
    across, up = WIDTH - 2 * margin, most_height - 2 * margin
    # largest scale at which both sides fit
    scale = float(min(across / size[0], up / size[1]))
    return Sheet(
        west_m=float(low_m[0] - (across / scale - size[0]) / 2),
        north_m=float(high_m[1]),
        scale=scale,
        height=float(max(size[1] * scale + 2 * margin, min(MIN_HEIGHT, most_height))),
        margin=margin,
    )


@dataclass(frozen=True)
class GridLine:
    """Line of the grid: its ends, and its name, which may be empty, with the place of the name."""

    x1: float
    y1: float
    x2: float
    y2: float
    x: float
    y: float
    text: str


def grid_lines(sheet: Sheet, units: Units) -> Iterator[GridLine]:
    """Draw lines at round numbers of metres or feet from the origin, named along two sides."""
    low, high = sheet.extent_m
    step_m = round_bar(MAX_STEP / sheet.scale, units)[0]
    unit = table_unit(units)
    for axis, name in enumerate("EN"):
        first, last = np.ceil(low[axis] / step_m), np.floor(high[axis] / step_m)
        for count in np.arange(first, last + 1):
            at = float(sheet(np.full(2, count * step_m))[axis])
            text = f"{name} {count * step_m * unit.factor + 0.0:g}"
            half = LETTER * len(text) / 2
            if axis == 0:
                named = half < at < WIDTH - COMPASS - half
                yield GridLine(at, 0.0, at, sheet.height, at, 10.0, text if named else "")
            else:
                named = EASTINGS < at < sheet.height - SCALE_BAR
                at_x = EDGE + half
                yield GridLine(0.0, at, WIDTH, at, at_x, at - 3.0, text if named else "")
