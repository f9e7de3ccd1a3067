"""Colours, one for each meaning, in the recording, the report and on maps, and styles of layers."""

from __future__ import annotations

import numpy as np

from uavgram.imaging.photos.preview import Pixels
from uavgram.model.arrays import Floats
from uavgram.model.maps import LayerStyle
from uavgram.model.result.reliability import MeasurementStatus, VerdictLevel
from uavgram.model.result.tables import HeightSource

Rgb = tuple[int, int, int]

SEED: Rgb = (255, 140, 26)
REFINED: Rgb = (64, 150, 255)
REFERENCE: Rgb = (255, 80, 185)
WITHHELD: Rgb = (190, 130, 255)
BAD: Rgb = (255, 59, 48)
MEASURED: Rgb = (40, 215, 185)
MEASURED_QUIET: Rgb = (30, 140, 122)
OBSERVED: Rgb = (255, 255, 255)
FOUND: Rgb = (120, 235, 255)
TIE: Rgb = (214, 222, 120)
TIE_FAINT: Rgb = (107, 111, 60)
FREE: Rgb = (150, 235, 70)
UNASKED: Rgb = (255, 200, 40)
SPREAD: Rgb = (248, 149, 64)
GROUND: Rgb = (176, 140, 84)
QUIET: Rgb = (140, 145, 155)
GOOD: Rgb = (40, 150, 80)
WARNING: Rgb = (200, 140, 20)

LINE_COLOURS: dict[str, Rgb] = {
    "used": REFERENCE,
    "suspect": BAD,
    "removed": BAD,
    "checked": WITHHELD,
    "unseen": QUIET,
}
MEASURED_COLOURS: dict[MeasurementStatus, Rgb] = {
    "ok": MEASURED,
    "not-checked": MEASURED,
    "doubtful": QUIET,
    "contradicted": QUIET,
}
"""Contradicted measurements are also dashed."""
LEVEL_COLOURS: dict[VerdictLevel | None, Rgb] = {
    "green": GOOD,
    "amber": WARNING,
    "red": BAD,
    None: QUIET,
}
HEIGHT_COLOURS: dict[HeightSource, Rgb] = {"free": FREE, "stated": REFERENCE, "found": UNASKED}
FRAME_COLOURS: dict[str, Rgb] = {
    "refined": GOOD,
    "check": WARNING,
    "seeded": REFINED,
    "unmatched": QUIET,
    "rejected": BAD,
}

# Five anchors of matplotlib's "plasma" (Smith and van der Walt 2015): even steps of lightness.
_SCALE = np.array(
    [(13, 8, 135), (126, 3, 168), (204, 71, 120), (248, 149, 64), (240, 249, 33)], dtype=np.float64
)
# The darkest fifth cannot be seen on a dark background.
_DARKEST = 0.2

# "RdBu" of ColorBrewer (Harrower and Brewer 2003), blue to red: safe for the colour-blind.
_DIVERGING = np.array(
    [(5, 113, 176), (146, 197, 222), (247, 247, 247), (244, 165, 130), (202, 0, 32)],
    dtype=np.float64,
)
ABOVE: Rgb = (202, 0, 32)
BELOW: Rgb = (5, 113, 176)


def scale_colours(share: Floats) -> Pixels:
    """Return (N, 3) colours from dark (0) to light (1)."""
    return _between(_SCALE, _DARKEST + (1 - _DARKEST) * np.clip(share, 0.0, 1.0))


def diverging_colours(share: Floats) -> Pixels:
    """Return (N, 3) colours from blue (-1) over white (0) to red (1)."""
    return _between(_DIVERGING, (1 + np.clip(share, -1.0, 1.0)) / 2)


def hex_colour(colour: Rgb | Pixels) -> str:
    """Format a colour for HTML: ``#ca0020``."""
    return "#" + "".join(f"{int(part):02x}" for part in colour)


def _between(anchors: Floats, share: Floats) -> Pixels:
    at = share * (len(anchors) - 1)
    channels = [np.interp(at, np.arange(len(anchors)), anchors[:, c]) for c in range(3)]
    return np.stack(channels, axis=-1).round().astype(np.uint8)


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


_BLUE, _WHITE, _FAINT, _LAID = "ffffaa55", "ffffffff", "99ffffff", "ff7a12b0"
_MEASURED = "ff6b7900"
_BY_STATUS = {status: INK[status] for status in ("suspect", "removed", "checked", "unseen")}

LOOKS = {
    "points": LayerStyle(
        title="points", colour=INK["point"], globe="ff00ffff", width_mm=1.6, label="label"
    ),
    "off_ground": LayerStyle(
        title="points off the ground", colour=INK["point"], cad="POINTS_OFF_GROUND", cad_colour=1,
    ),
    "verticals": LayerStyle(
        title="heights over the ground", colour=INK["above"], width_mm=0.4, cad="HEIGHTS",
        cad_colour=1,
    ),
    "measured_lines": LayerStyle(
        title="measured", colour=INK["measured"], globe=_MEASURED, width_mm=0.5, label="text",
        cad_colour=134,
    ),
    "measured_areas": LayerStyle(
        title="measured areas", colour=INK["measured"], globe=_MEASURED, width_mm=0.5, filled=0.15,
        label="text", cad_colour=134,
    ),
    "known_lengths": LayerStyle(
        title="known lengths", colour=INK["used"], globe=_LAID, width_mm=0.5, dashed=True,
        label="text", by_status=_BY_STATUS, cad_colour=6,
    ),
    "control_lines": LayerStyle(
        title="lines of known position", colour=INK["position"], globe="ff9c27b0", width_mm=0.35,
        label="name", by_status=_BY_STATUS, cad="LINES_OF_KNOWN_POSITION", cad_colour=200,
    ),
    "ellipses_95_within_survey": LayerStyle(
        title="95 % ellipses within the survey", colour=INK["ellipse"], globe="ff00c8ff",
        cad_colour=42,
    ),
    "ellipses_95": LayerStyle(
        title="95 % ellipses on the earth", colour=INK["ellipse"], globe="ff007be0", width_mm=0.2,
        shown=False, cad_colour=32,
    ),
    "camera_poses": LayerStyle(
        title="photos", colour=hex_colour(REFINED), globe=_BLUE, width_mm=2.0, label="frame",
        shown=False, cad="CAMERAS", cad_colour=150,
    ),
    "footprints": LayerStyle(
        title="what photos show", colour=hex_colour(REFINED), globe=_FAINT, width_mm=0.2,
        shown=False, cad="PHOTO_FOOTPRINTS", cad_colour=252,
    ),
    **{
        name: LayerStyle(
            title=title, colour=INK["measured"], globe=globe, shown=name != "planned_footprints"
        )
        for name, title, globe in (
            ("planned_footprints", "what photos will show", _FAINT),
            ("planned_area", "area", _WHITE),
            ("planned_no_go", "keep out", "ff0000ff"),
            ("planned_corners", "corners of the area", _WHITE),
            ("planned_flight", "flight", _BLUE),
            ("planned_photos", "photos to take", _BLUE),
            ("planned_measurements", "planned measurements", _MEASURED),
            ("planned_points", "points to measure", _MEASURED),
            ("planned_lines", "lines to lay and tape", _LAID),
            ("planned_plates", "plates to lay", _LAID),
            ("planned_line_ends", "ends of lines", _LAID),
        )
    },
}  # fmt: skip
"""Style of each layer by its name; the first is on top.

Layers that files hide at first cover others; ellipses on the earth are metres wide by the receiver.
"""
