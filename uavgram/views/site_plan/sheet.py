"""Sheet of paper under construction: coordinates are millimetres from its lower left corner."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.textpath import TextPath

from uavgram.model.arrays import Floats
from uavgram.model.maps import Plan, PlanSheet
from uavgram.stages.products.text_places import Label, Where, place_labels

MM_OF_POINT = 25.4 / 72.0
INK, QUIET, PAPER = "#1d232b", "#5b6470", "#ffffff"
THIN_PT = 0.4
_LINE = 1.5
"""Height of a line of text, relative to the font size."""

_GAP_MM, _FARTHEST = 0.7, 12.0
"""Gap between a text and its object [mm], and largest distance in heights of the text."""


class _Name(NamedTuple):
    """Text to be placed: colour and font size, and label of its object."""

    text: str
    colour: str
    size_pt: float
    label: Label


class Sheet:
    """Paper with a frame that shows the ground; texts in it do not overlap.

    Attributes
    ----------
    plan, sheet
        Position of the ground on the sheet.
    figure, axes
        The drawing: its coordinates are millimetres on paper.
    """

    def __init__(self, plan: Plan, sheet: PlanSheet) -> None:
        """Make an empty sheet."""
        self.plan, self.sheet = plan, sheet
        width, height = plan.paper_mm
        self.figure = Figure(figsize=(width / 25.4, height / 25.4))
        self.axes: Axes = self.figure.add_axes((0.0, 0.0, 1.0, 1.0))
        self.axes.set_xlim(0.0, width)
        self.axes.set_ylim(0.0, height)
        self.axes.set_axis_off()
        left, bottom, across, up = plan.frame_mm
        self.frame = Rectangle((left, bottom), across, up, transform=self.axes.transData)
        self._names: list[_Name] = []
        self._taken: list[Floats] = []
        self.left_out = 0

    def on_paper(self, world_m: Floats) -> Floats:
        """Convert (..., 2) places in the world to millimetres on paper."""
        return self.plan.on_paper(self.sheet, world_m)

    def in_world(self, drawn_mm: Floats) -> Floats:
        """Convert (..., 2) millimetres on paper to places in the world."""
        corner = np.array([self.sheet.west_m, self.sheet.south_m])
        frame = np.array(self.plan.frame_mm[:2])
        return np.asarray(corner + (drawn_mm - frame) * self.plan.scale / 1000.0)

    def line(
        self, drawn: Floats, colour: str, width_pt: float, dashes: tuple[float, ...] = ()
    ) -> None:
        """Draw a polyline with all its vertices, clipped to the frame.

        Parameters
        ----------
        drawn
            (n, 2) millimetres.
        colour, width_pt
            Colour and width of the line.
        dashes
            Lengths of dashes and gaps in widths of the line; by default it is solid.
        """
        # plot() would spend most of the time on limits that are known
        line = Line2D(*drawn.T, color=colour, linewidth=width_pt, zorder=4)
        self.axes.add_artist(line)
        line.get_path().should_simplify = False
        line.set_solid_capstyle("butt")
        if dashes:
            line.set_dashes(dashes)
        line.set_clip_path(self.frame)

    def inside(self, drawn: Floats) -> bool:
        """Return whether a place (2,) is in the frame."""
        left, bottom, across, up = self.plan.frame_mm
        return bool(left <= drawn[0] <= left + across and bottom <= drawn[1] <= bottom + up)

    def reserve(self, middle: Floats, half: Floats) -> None:
        """Keep a rectangle parallel to the axes free of texts."""
        self._taken.append(np.array([*middle, *half, 0.0]))

    def name(
        self,
        text: str,
        colour: str,
        size_pt: float,
        spots: Floats,
        where: Where = "beside",
        *,
        is_needed: bool = True,
        turn: float = 0.0,
    ) -> None:
        """Name an object; `write_names` writes the texts, in the order of these calls.

        Parameters
        ----------
        text
            The text.
        colour, size_pt
            Colour and size of its letters.
        spots
            (1, 2) the named point or (2, 2) the ends of the named line.
        where, is_needed, turn
            See `Label`.
        """
        half, rank = half_text(text, size_pt), len(self._names)
        label = Label(spots[0], spots[-1], half, _GAP_MM, where, is_needed, rank, turn)
        self._names.append(_Name(text, colour, size_pt, label))

    def write_names(self) -> None:
        """Write all texts that have room, on white patches, with lines to their objects."""
        left, bottom, across, up = self.plan.frame_mm
        low, size = np.array([left, bottom]), np.array([across, up])
        placed = place_labels(
            [one.label for one in self._names],
            np.reshape(self._taken, (-1, 5)),
            (low, low + size),
            least=1.0,
            reach=_FARTHEST,
        )
        for one, box, line in zip(self._names, placed.boxes, placed.leaders, strict=True):
            if np.isnan(box[0]):
                self.left_out += 1
                continue
            if np.isfinite(line[0, 0]):
                self.line(line, PAPER, 4 * THIN_PT)
                self.line(line, one.colour, 1.5 * THIN_PT)
            self._write(box, one.text, one.colour, one.size_pt)

    def _write(self, place: Floats, text: str, colour: str, size_pt: float) -> None:
        self.axes.text(
            float(place[0]),
            float(place[1]),
            plain(text),
            fontsize=size_pt,
            color=colour,
            rotation=float(np.degrees(place[4])),
            rotation_mode="anchor",
            ha="center",
            va="center_baseline",
            zorder=6,
            bbox={"facecolor": PAPER, "alpha": 0.82, "linewidth": 0, "pad": 0.7},
        )


def plain(text: str) -> str:
    """Escape dollars, between which Matplotlib would see a formula."""
    return text.replace("$", r"\$")


def half_text(text: str, size_pt: float) -> Floats:
    """Return (2,) half the width and height of a text [mm]."""
    return np.array([width_mm(text, size_pt) + 0.8, _LINE * size_pt * MM_OF_POINT]) / 2


@lru_cache(maxsize=2048)
def width_mm(text: str, size_pt: float) -> float:
    """Return the width of a text [mm]."""
    if not text.strip():
        return 0.0
    path = TextPath((0.0, 0.0), plain(text), size=size_pt, prop=FontProperties())
    return float(path.get_extents().width) * MM_OF_POINT
