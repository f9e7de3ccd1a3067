"""Style of each layer on maps, as in the report's plan, and on globes."""

from __future__ import annotations

from uavgram.model.maps import LayerStyle
from uavgram.views.style import INK, REFINED, hex_colour

_BLUE, _WHITE, _FAINT, _LAID = "ffffaa55", "ffffffff", "99ffffff", "ff7a12b0"
_MEASURED = "ff6b7900"
_BY_STATUS = {status: INK[status] for status in ("suspect", "removed", "checked", "unseen")}

LOOKS = {
    "points": LayerStyle(
        title="points", colour=INK["point"], globe="ff00ffff", width_mm=1.6, label="label"
    ),
    "verticals": LayerStyle(title="heights over the ground", colour=INK["above"], width_mm=0.4),
    "measured_lines": LayerStyle(
        title="measured", colour=INK["measured"], globe=_MEASURED, width_mm=0.5, label="text"
    ),
    "measured_areas": LayerStyle(
        title="measured areas", colour=INK["measured"], globe=_MEASURED, width_mm=0.5, filled=0.15,
        label="text",
    ),
    "known_lengths": LayerStyle(
        title="known lengths", colour=INK["used"], globe=_LAID, width_mm=0.5, dashed=True,
        label="text", by_status=_BY_STATUS,
    ),
    "control_lines": LayerStyle(
        title="lines of known position", colour=INK["position"], globe="ff9c27b0", width_mm=0.35,
        label="name", by_status=_BY_STATUS,
    ),
    "ellipses_95_within_survey": LayerStyle(
        title="95 % ellipses within the survey", colour=INK["ellipse"], globe="ff00c8ff"
    ),
    "ellipses_95": LayerStyle(
        title="95 % ellipses on the earth", colour=INK["ellipse"], globe="ff007be0", width_mm=0.2,
        shown=False,
    ),
    "camera_poses": LayerStyle(
        title="photos", colour=hex_colour(REFINED), globe=_BLUE, width_mm=2.0, label="frame",
        shown=False,
    ),
    "footprints": LayerStyle(
        title="what photos show", colour=hex_colour(REFINED), globe=_FAINT, width_mm=0.2,
        shown=False,
    ),
    **{
        name: LayerStyle(title=title, colour=INK["measured"], globe=globe)
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
"""Style of each layer by its name; the first is on top."""
