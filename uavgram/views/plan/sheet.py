"""A sheet of paper under way: everything is drawn in millimetres from its lower left corner."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.textpath import TextPath

from uavgram.model.arrays import Floats
from uavgram.model.maps import Plan, PlanSheet
from uavgram.stages.products.text_places import TextPlaces, around

MM_OF_POINT = 25.4 / 72.0
INK, QUIET, PAPER = "#1d232b", "#5b6470", "#ffffff"
THIN_PT = 0.4
_LINE = 1.5
"""Height of a line of text, of the size of its letters."""


Rounds = Callable[[Floats], list[Floats]]
"""Of half a text's width and height, its (c, 5) places round by round; the best first."""


def only_at(middle: Floats, turn: float = 0.0) -> Rounds:
    """A text stands at (2,) its place, turned by an angle [rad], or nowhere."""
    return lambda half: [np.array([[*middle, *half, turn]])]


def beside(spot: Floats, gap_mm: float, most: int) -> Rounds:
    """A text stands around a place (2,), farther and farther out.

    Parameters
    ----------
    spot
        The place.
    gap_mm
        Between place and text, at first.
    most
        How many rounds are tried.
    """
    return lambda half: [around(spot, half, gap_mm, ring) for ring in range(most)]


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
        self._places = TextPlaces()
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
        self._places.reserve(np.array([*middle, *half, 0.0]))

    def name(
        self,
        text: str,
        colour: str,
        size_pt: float,
        rounds: Rounds,
    ) -> Floats | None:
        """Write a text where there is room, on a white patch.

        Parameters
        ----------
        text
            What is written.
        colour, size_pt
            Of its letters.
        rounds
            Where it may stand.

        Returns
        -------
        (5,) its place; None where there is none, which is counted.
        """
        half = half_text(text, size_pt)
        for places in rounds(half):
            fitting = places[self._fits(places)]
            if len(fitting) and (which := self._places.take(fitting)) is not None:
                self._write(fitting[which], text, colour, size_pt)
                return np.asarray(fitting[which])
        self.left_out += 1
        return None

    def _fits(self, places: Floats) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """(c,) whether texts lie in the frame."""
        left, bottom, across, up = self.plan.frame_mm
        cos, sin = np.abs(np.cos(places[:, 4])), np.abs(np.sin(places[:, 4]))
        reach = np.column_stack(
            [
                cos * places[:, 2] + sin * places[:, 3],
                sin * places[:, 2] + cos * places[:, 3],
            ]
        )
        low, high = places[:, :2] - reach, places[:, :2] + reach
        return np.asarray(
            (low >= [left, bottom]).all(axis=1) & (high <= [left + across, bottom + up]).all(axis=1)
        )

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
