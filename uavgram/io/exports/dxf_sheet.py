"""A drawing under way, and its layers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ezdxf.document import Drawing
from ezdxf.layouts.layout import Modelspace

from uavgram.model.arrays import Floats

Place = Callable[[Floats], Floats]

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
    """A drawing under way: where local metres go, and the height of letters [m]."""

    document: Drawing
    space: Modelspace
    place: Place
    text_m: float
