"""Shared parts of CAD drawings: layers, texts, and the size of texts."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from ezdxf.document import Drawing
from ezdxf.enums import TextEntityAlignment
from ezdxf.fonts.fonts import AbstractFont, make_font
from ezdxf.layouts.layout import Modelspace

from uavgram.model.arrays import Floats
from uavgram.stages.products.text_places import Label

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


LABELS = "LABELS"
# name in the drawing, and colour of AutoCAD's index, visible on black and on white
LAYERS = {
    "footprints": ("PHOTO_FOOTPRINTS", 252),
    "camera_poses": ("CAMERAS", 150),
    "ellipses_95": ("ELLIPSES_95", 32),
    "ellipses_95_within_survey": ("ELLIPSES_95_WITHIN_SURVEY", 42),
    "known_lengths": ("KNOWN_LENGTHS", 6),
    "control_lines": ("LINES_OF_KNOWN_POSITION", 200),
    "measured_areas": ("MEASURED_AREAS", 134),
    "measured_lines": ("MEASURED_LINES", 134),
    "points": ("POINTS", 7),
    "off_ground": ("POINTS_OFF_GROUND", 1),
    "verticals": ("HEIGHTS", 1),
}

ALIGNED = {
    -1: TextEntityAlignment.MIDDLE_LEFT,
    0: TextEntityAlignment.MIDDLE_CENTER,
    1: TextEntityAlignment.MIDDLE_RIGHT,
}
"""Alignment by the side of a text at which its leader ends, where its letters begin or end."""


def cad_layer(name: str) -> tuple[str, int]:
    """Return name and colour of a survey layer in the drawing; by default its own name, black."""
    return LAYERS.get(name, (name.upper(), 7))


@dataclass(frozen=True)
class Sheet:
    """Drawing being written: transformation of local metres, height of letters [m], and format."""

    document: Drawing
    space: Modelspace
    place: Place
    text_m: float
    words: NumberFormat = NumberFormat()


class Text(NamedTuple):
    """A text to be placed and written.

    Attributes
    ----------
    words
        Text as displayed.
    label
        Position of its object, and its size with letters at full height.
    layer
        Its layer.
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
_LINE = 1.6
"""Height of a line of text relative to its capitals: letters reach below and above them."""


def compute_half_size(text: str, height_m: float) -> Floats:
    """Return (2,) half the width and height of a text [m], for the fonts of all programs."""
    return np.array([TEXT_MARGIN * (_width(text) * height_m), _LINE * height_m]) / 2


@lru_cache(maxsize=10_000)  # both drawings of a survey have the same texts
def _width(text: str) -> float:
    """Return the width of a text whose capitals have a height of 1."""
    return float(_font().text_width(text))


@lru_cache(maxsize=1)
def _font() -> AbstractFont:
    return make_font("txt", 1.0)
