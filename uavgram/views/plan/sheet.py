"""A sheet of paper under way: everything is drawn in millimetres from its lower left corner."""

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
"""Height of a line of text, of the size of its letters."""

_GAP_MM, _FARTHEST = 0.7, 12.0
"""Between a text and what it names, and how far it may be from that, in its heights."""


class _Name(NamedTuple):
    """A text to be placed: colour and size of its letters, and what it names."""

    text: str
    colour: str
    size_pt: float
    label: Label


class Sheet:
    """Paper with a frame that shows the ground; texts in it do not cover each other.

    Attributes
    ----------
    plan, sheet
        Which ground lies where.
    figure, axes
        The drawing: its coordinates are millimetres on paper.
    """

    def __init__(self, plan: Plan, sheet: PlanSheet) -> None:
        """Take an empty sheet."""
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
        """(..., 2) millimetres of places in the world."""
        return self.plan.on_paper(self.sheet, world_m)

    def in_world(self, drawn_mm: Floats) -> Floats:
        """(..., 2) places in the world of millimetres on paper."""
        corner = np.array([self.sheet.west_m, self.sheet.south_m])
        frame = np.array(self.plan.frame_mm[:2])
        return np.asarray(corner + (drawn_mm - frame) * self.plan.scale / 1000.0)

    def line(
        self, drawn: Floats, colour: str, width_pt: float, dashes: tuple[float, ...] = ()
    ) -> None:
        """Draw a polyline as it is, no vertex left out; what lies off the frame is cut.

        Parameters
        ----------
        drawn
            (n, 2) millimetres.
        colour, width_pt
            Of the line.
        dashes
            Lengths of dashes and gaps in widths of the line; by default it is whole.
        """
        # not by plot(), which takes most of the time to find limits that are known
        line = Line2D(*drawn.T, color=colour, linewidth=width_pt, zorder=4)
        self.axes.add_artist(line)
        line.get_path().should_simplify = False
        line.set_solid_capstyle("butt")
        if dashes:
            line.set_dashes(dashes)
        line.set_clip_path(self.frame)

    def inside(self, drawn: Floats) -> bool:
        """Whether a place (2,) lies in the frame."""
        left, bottom, across, up = self.plan.frame_mm
        return bool(left <= drawn[0] <= left + across and bottom <= drawn[1] <= bottom + up)

    def reserve(self, middle: Floats, half: Floats) -> None:
        """Keep a level rectangle free of texts."""
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
        """Name an object; the text is written by `write_names`, those named first before others.

        Parameters
        ----------
        text
            What is written.
        colour, size_pt
            Of its letters.
        spots
            (1, 2) the point or (2, 2) the ends of the line that it names.
        where, is_needed, turn
            As of `Label`.
        """
        half, rank = half_text(text, size_pt), len(self._names)
        label = Label(spots[0], spots[-1], half, _GAP_MM, where, is_needed, rank, turn)
        self._names.append(_Name(text, colour, size_pt, label))

    def write_names(self) -> None:
        """Write all texts that there is room for, on white patches, with lines to their objects."""
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
    """A text to be written as it is: between dollars, Matplotlib would see a formula."""
    return text.replace("$", r"\$")


def half_text(text: str, size_pt: float) -> Floats:
    """(2,) half the width and height that a text takes [mm]."""
    return np.array([width_mm(text, size_pt) + 0.8, _LINE * size_pt * MM_OF_POINT]) / 2


@lru_cache(maxsize=2048)
def width_mm(text: str, size_pt: float) -> float:
    """Width of a text [mm]."""
    if not text.strip():
        return 0.0
    path = TextPath((0.0, 0.0), plain(text), size=size_pt, prop=FontProperties())
    return float(path.get_extents().width) * MM_OF_POINT
