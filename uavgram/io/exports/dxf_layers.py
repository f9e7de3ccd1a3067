"""Shared parts of CAD drawings (layers, texts and their size), and sheets of profiles.

Each is a block in metres, with one reference below the plan, and another in a layout of its own, to
scale on paper.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from ezdxf.document import Drawing
from ezdxf.enums import TextEntityAlignment
from ezdxf.fonts.fonts import AbstractFont, make_font
from ezdxf.layouts.blocklayout import BlockLayout
from ezdxf.layouts.layout import Modelspace

from uavgram.model.arrays import Floats
from uavgram.model.maps import Looks, ProfileSheet, look_of
from uavgram.stages.products.map_layers import TWO_SIDED_95
from uavgram.stages.products.text_places import Label, place_labels

Place = Callable[[Floats], Floats]

_UNITS = {"m2": "m²", "m3": "m³", "deg": "°"}


def _metric(value: float, sigma: float, unit: str) -> str:
    return f"{value:.3f} ±{sigma:.3f} {_UNITS.get(unit, unit)}"


@dataclass(frozen=True)
class NumberFormat:
    """Format of the numbers in a drawing, which is in metres.

    Attributes
    ----------
    value
        Function that writes a value, its standard deviation and its unit as in results.json.
    length_m
        Unit of plain lengths, such as those of axes.
    symbol, name
        Of that unit.
    """

    value: Callable[[float, float, str], str] = _metric
    length_m: float = 1.0
    symbol: str = "m"
    name: str = "metres"


ALIGNED = {
    -1: TextEntityAlignment.MIDDLE_LEFT,
    0: TextEntityAlignment.MIDDLE_CENTER,
    1: TextEntityAlignment.MIDDLE_RIGHT,
}
"""Alignment by the side of a text at which its leader ends, where its letters begin or end."""


def cad_layer(looks: Looks, layer: str) -> str:
    """Return the name of a layer in the drawing."""
    return look_of(looks, layer).cad or layer.upper()


@dataclass(frozen=True)
class Sheet:
    """Drawing being written: transformation of local metres, height of letters [m], and styles."""

    document: Drawing
    space: Modelspace
    place: Place
    text_m: float
    looks: Looks

    def on(self, layer: str) -> dict[str, str]:
        """Return the attributes of an entity on a layer."""
        return {"layer": cad_layer(self.looks, layer)}


class Text(NamedTuple):
    """A text to be placed and written.

    Attributes
    ----------
    words
        Text as displayed.
    label
        Position of its object, and its size with letters at full height.
    layer
        Its layer: of the survey, or for texts only.
    ends
        (2, 3) ends of a dimension; (1, 3) position of the object of any other text.
    share
        Relative height of the letters.
    """

    words: str
    label: Label
    layer: str
    ends: Floats
    share: float = 1.0


def place_beside_point(
    words: str, spot: Floats, layer: str, text_m: float, share: float = 1.0
) -> Text:
    """Return a text next to a point.

    Parameters
    ----------
    words
        Text as displayed.
    spot
        (3,) the point.
    layer
        Of the text.
    text_m
        Full height of letters.
    share
        Relative height of the letters of this text.
    """
    label = Label(spot[:2], spot[:2], compute_half_size(words, share * text_m), 0.1 * text_m)
    return Text(words, label, layer, spot[None], share)


def escape_text(words: str) -> str:
    """Escape words for TEXT, where some signs begin a code (percent twice, caret, backslash)."""
    return re.sub(r"\\(?=U\+)", r"\\U+005C", _plain(words))


def escape_mtext(words: str) -> str:
    """Escape words for MTEXT and dimensions, where backslash, braces and ``<>`` are codes too."""
    shown = re.sub(r"[\\{}]", r"\\\g<0>", _plain(words))
    # an empty group separates characters that would form a code
    return re.sub(r"\\(?=U\+)", r"\\{}", shown).replace("<>", "<{}>")


def _plain(words: str) -> str:
    """Return words in one line, without the codes common to TEXT and MTEXT."""
    return re.sub(r"[\x00-\x1f]", " ", words).replace("%%", 2 * "%%%").replace("^", "^ ")


TEXT_MARGIN = 1.15
"""Factor for the fonts of other programs, which are wider than the one measured here."""
_LINE_SPACING = 1.6
"""Height of a line of text relative to its capitals: letters reach below and above them."""


def compute_half_size(text: str, height_m: float) -> Floats:
    """Return (2,) half the width and height of a text [m], for the fonts of all programs."""
    return np.array([TEXT_MARGIN * (_width(text) * height_m), _LINE_SPACING * height_m]) / 2


@lru_cache(maxsize=10_000)  # both drawings of a survey have the same texts
def _width(text: str) -> float:
    """Return the width of a text whose capitals have a height of 1."""
    return float(_font().text_width(text))


@lru_cache(maxsize=1)
def _font() -> AbstractFont:
    return make_font("txt", 1.0)


# name in the drawing, and colour of AutoCAD's index
_AXES, _TEXTS = ("PROFILE_AXES", 8), ("PROFILE_TEXTS", 7)
_LINE, _GROUND, _INTERVALS = ("PROFILE_POINTS", 150), ("PROFILE_GROUND", 32), ("PROFILE_95", 42)
_LAYERS = (_AXES, _TEXTS, _LINE, _GROUND, _INTERVALS)

_TEXT_SHARE = 1 / 110  # letter height relative to the profile's length
_PAPER_MM, _MARGIN_MM = (420.0, 297.0), 20.0  # A3
_SCALES = (1, 2, 5, 10, 20, 25, 50, 100, 200, 250, 500)  # and tens of these
_ROWS = ("point", "station", "height", "± 1 sigma", "ground", "± 1 sigma")
_FAR = 1e3  # of letters and of the profile, beyond any extent
_ROW_SHARE = 6.0  # height of a row in letter heights: its numbers are vertical


def draw_profiles(
    document: Drawing,
    sheets: tuple[ProfileSheet, ...],
    corner: tuple[float, float],
    text_m: float,
    words: NumberFormat,
) -> None:
    """Draw the profiles below the plan, and each on a sheet of A3.

    Parameters
    ----------
    document
        The drawing.
    sheets
        Profiles to draw.
    corner
        East and north of the free area below.
    text_m
        Height of the plan's letters.
    words
        Unit of the numbers.
    """
    if not sheets:
        return
    for name, colour in _LAYERS:
        document.layers.add(name, color=colour)
    east, top = corner[0], corner[1] - 4.0 * text_m
    for number, sheet in enumerate(sheets, start=1):
        block = document.blocks.new(f"PROFILE_{number}")
        paper = _Paper.of(sheet, block, words)
        _draw(paper)
        at = (east + paper.left, top - paper.above)
        document.modelspace().add_blockref(block.name, at, dxfattribs={"layer": _TEXTS[0]})
        top -= paper.above + paper.below + 4.0 * text_m
        _layout(document, paper, number)


@dataclass(frozen=True)
class _Paper:
    """Sheet being drawn: x are stations less the first tick, y drawn heights above the lowest.

    Attributes
    ----------
    sheet, block
        The profile, and the block to draw it in.
    text
        Height of the letters [m].
    across
        (N,) x of the numbers of each point, spread so that they do not overlap.
    words
        Unit of the numbers.
    """

    sheet: ProfileSheet
    block: BlockLayout
    text: float
    across: Floats
    words: NumberFormat

    @classmethod
    def of(cls, sheet: ProfileSheet, block: BlockLayout, words: NumberFormat) -> _Paper:
        text = float(np.ptp(sheet.station_ticks_m)) * _TEXT_SHARE
        across = spread_places(sheet.station_m - sheet.station_ticks_m[0], 1.5 * text)
        return cls(sheet, block, text, across, words)

    @property
    def left(self) -> float:
        return 13.0 * self.text

    @property
    def width(self) -> float:
        axis = float(np.ptp(self.sheet.station_ticks_m))
        return self.left + max(axis, float(self.across.max())) + 3.0 * self.text

    @property
    def above(self) -> float:
        return self.y(self.sheet.height_ticks_m[-1]) + 8.0 * self.text

    @property
    def below(self) -> float:
        return (6.0 + _ROW_SHARE * len(_ROWS)) * self.text

    def x(self, station_m: float) -> float:
        return float(station_m - self.sheet.station_ticks_m[0])

    def y(self, height_m: float) -> float:
        return float(height_m - self.sheet.height_ticks_m[0]) * self.sheet.exaggeration

    def line(self, ends: list[tuple[float, float]], layer: tuple[str, int]) -> None:
        self.block.add_lwpolyline(ends, dxfattribs={"layer": layer[0]})

    def write(
        self,
        text: str,
        at: tuple[float, float],
        align: TextEntityAlignment,
        turned: float = 0.0,
        share: float = 1.0,
    ) -> None:
        height, on = share * self.text, {"layer": _TEXTS[0]}
        written = self.block.add_text(
            escape_text(text), height=height, rotation=turned, dxfattribs=on
        )
        written.set_placement(at, align=align)


def spread_places(places: Floats, least: float) -> Floats:
    """Shift places (N,) to the right until no two are closer than `least`."""
    moved = places.astype(np.float64)
    order = np.argsort(places, kind="stable")
    for before, after in itertools.pairwise(order):
        moved[after] = max(moved[after], moved[before] + least)
    return moved


def _draw(paper: _Paper) -> None:
    _axes(paper)
    sheet = paper.sheet
    x = [paper.x(one) for one in sheet.station_m]
    lines = (
        (sheet.ground_m, sheet.ground_sigma_m, _GROUND),
        (sheet.height_m, sheet.height_sigma_m, _LINE),
    )
    for height, sigma, layer in lines:
        paper.line([(a, paper.y(b)) for a, b in zip(x, height, strict=True)], layer)
        for a, b, one in zip(x, height, TWO_SIDED_95 * sigma, strict=True):
            if one > 0:
                paper.line([(a, paper.y(b - one)), (a, paper.y(b + one))], _INTERVALS)
    circle = {"layer": _LINE[0]}
    for a, height in zip(x, sheet.height_m, strict=True):
        paper.block.add_circle((a, paper.y(height)), 0.25 * paper.text, dxfattribs=circle)
    _names(paper)
    _band(paper)


def _names(paper: _Paper) -> None:
    """Write labels around the tops of the bars, with a leader where others are in the way."""
    sheet, text = paper.sheet, paper.text
    tops = sheet.height_m + TWO_SIDED_95 * sheet.height_sigma_m
    spots = np.array([[paper.x(a), paper.y(b)] for a, b in zip(sheet.station_m, tops, strict=True)])
    labels = [
        Label(spot, spot, compute_half_size(label, text), 0.5 * text)
        for label, spot in zip(sheet.label, spots, strict=True)
    ]
    right, top = paper.x(sheet.station_ticks_m[-1]), paper.y(sheet.height_ticks_m[-1])
    title = np.array([right / 2, top + 6.0 * text, right, 3.0 * text, 0.0])
    below = np.array([right / 2, -_FAR * text, _FAR * right, _FAR * text, 0.0])
    placed = place_labels(labels, np.stack([title, below]))
    for label, box, line, side in zip(sheet.label, *placed[:3], strict=True):
        at = (float(box[0] + side * box[2]), float(box[1]))
        paper.write(label, at, ALIGNED[int(side)], share=placed.size)
        if np.isfinite(line[0, 0]):
            paper.line([tuple(end) for end in line.tolist()], _TEXTS)


def _axes(paper: _Paper) -> None:
    sheet, text, unit = paper.sheet, paper.text, paper.words.length_m
    right = paper.x(sheet.station_ticks_m[-1])
    top = paper.y(sheet.height_ticks_m[-1])
    for height in sheet.height_ticks_m:
        y = paper.y(height)
        paper.line([(-0.6 * text, y), (right, y)], _AXES)
        said = f"{height / unit:.{count_decimals(sheet.height_ticks_m / unit)}f}"
        paper.write(said, (-text, y), TextEntityAlignment.MIDDLE_RIGHT)
    for station in sheet.station_ticks_m:
        x = paper.x(station)
        paper.line([(x, -0.6 * text), (x, top)], _AXES)
        said = f"{station / unit:.{count_decimals(sheet.station_ticks_m / unit)}f}"
        paper.write(said, (x, -text), TextEntityAlignment.TOP_CENTER)
    larger = f"heights drawn {sheet.exaggeration} times as large as lengths"
    for row, words in enumerate(
        (
            f"PROFILE {sheet.name}",
            f"{paper.words.name}; stations and heights from {sheet.origin}; "
            + (larger if sheet.exaggeration > 1 else "heights and lengths at one scale")
            + "; bars: 95 %",
        )
    ):
        at = (0.0, top + (5.5 - 2.0 * row) * text)
        paper.write(words, at, TextEntityAlignment.BOTTOM_LEFT)


def _band(paper: _Paper) -> None:
    """Write the numbers of all points below the drawing, vertically, as surveyors do."""
    sheet, text = paper.sheet, paper.text
    columns = (
        list(sheet.label),
        *(
            [f"{one / paper.words.length_m:.3f}" for one in values]
            for values in (
                *(sheet.station_m, sheet.height_m, sheet.height_sigma_m),
                *(sheet.ground_m, sheet.ground_sigma_m),
            )
        ),
    )
    right = paper.width - paper.left
    for row, (head, cells) in enumerate(zip(_ROWS, columns, strict=True)):
        top = -(4.0 + _ROW_SHARE * row) * text
        middle = top - 0.5 * _ROW_SHARE * text
        paper.line([(-paper.left, top), (right, top)], _AXES)
        paper.write(head, (-paper.left + text, middle), TextEntityAlignment.MIDDLE_LEFT)
        for x, cell in zip(paper.across.tolist(), cells, strict=True):
            paper.write(cell, (x, middle), TextEntityAlignment.MIDDLE_CENTER, 90.0)
    bottom = -(4.0 + _ROW_SHARE * len(_ROWS)) * text
    paper.line([(-paper.left, bottom), (right, bottom)], _AXES)
    for station, x in zip(sheet.station_m, paper.across.tolist(), strict=True):
        paper.line([(paper.x(station), -2.4 * text), (x, -4.0 * text)], _AXES)


def count_decimals(ticks: Floats) -> int:
    """Return the number of decimals that distinguishes ticks (n,)."""
    return max(0, -int(np.floor(np.log10(ticks[1] - ticks[0]) + 1e-9)))


def _layout(document: Drawing, paper: _Paper, number: int) -> None:
    """Add a sheet of A3 with the profile at a round scale, in millimetres."""
    layout = document.layouts.new(f"Profile {number}")
    layout.page_setup(size=_PAPER_MM, margins=(0.0, 0.0, 0.0, 0.0), units="mm")
    room = [size - 2.0 * _MARGIN_MM for size in _PAPER_MM]
    needed = 1000.0 * max(paper.width / room[0], (paper.above + paper.below) / room[1])
    scale = next(s * 10**p for p in range(9) for s in _SCALES if s * 10**p >= needed)
    millimetres = 1000.0 / scale
    at = (
        _MARGIN_MM + paper.left * millimetres,
        _PAPER_MM[1] - _MARGIN_MM - paper.above * millimetres,
    )
    layout.add_blockref(
        paper.block.name,
        at,
        dxfattribs={
            "layer": _TEXTS[0],
            **dict.fromkeys(("xscale", "yscale", "zscale"), millimetres),
        },
    )
    heights = f"{scale / paper.sheet.exaggeration:g}"
    layout.add_text(
        f"lengths 1:{scale}, heights 1:{heights} on A3", height=3.0, dxfattribs={"layer": _TEXTS[0]}
    ).set_placement((_MARGIN_MM, 0.5 * _MARGIN_MM))
