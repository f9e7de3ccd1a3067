"""A drawing under way, and its layers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ezdxf.document import Drawing
from ezdxf.layouts.layout import Modelspace

from uavgram.model.arrays import Floats

Place = Callable[[Floats], Floats]

_UNITS = {"m2": "m²", "m3": "m³", "deg": "°"}


def _metric(value: float, sigma: float, unit: str) -> str:
    return f"{value:.3f} ±{sigma:.3f} {_UNITS.get(unit, unit)}"


@dataclass(frozen=True)
class Words:
    """How a drawing, which is in metres, writes its numbers.

    Attributes
    ----------
    value
        Value, its standard deviation and its unit as in results.json, as text.
    length_m
        Unit of lengths that stand alone, such as those of axes.
    symbol, name
        Of that unit.
    """

    value: Callable[[float, float, str], str] = _metric
    length_m: float = 1.0
    symbol: str = "m"
    name: str = "metres"


LABELS = "LABELS"
# Name in the drawing, and colour of AutoCAD's index.
LAYERS = {
    "footprints": ("PHOTO_FOOTPRINTS", 252),
    "camera_poses": ("CAMERAS", 5),
    "ellipses_95": ("ELLIPSES_95", 30),
    "ellipses_95_within_survey": ("ELLIPSES_95_WITHIN_SURVEY", 40),
    "known_lengths": ("KNOWN_LENGTHS", 6),
    "measured_areas": ("MEASURED_AREAS", 134),
    "measured_lines": ("MEASURED_LINES", 134),
    "points": ("POINTS", 7),
    "off_ground": ("POINTS_OFF_GROUND", 1),
    "verticals": ("HEIGHTS", 1),
}


@dataclass(frozen=True)
class Sheet:
    """A drawing under way: where local metres go, the height of letters [m], and its words."""

    document: Drawing
    space: Modelspace
    place: Place
    text_m: float
    words: Words = Words()
