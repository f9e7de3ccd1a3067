"""Legend of a plan as a picture: Rerun has none in 3-D, and no colour bar."""

from __future__ import annotations

import numpy as np
import rerun as rr
from PIL import Image, ImageDraw, ImageFont

from uavgram.model.naming import Units
from uavgram.model.planned import FlightPlanned
from uavgram.views.planned.numbers import centimetres, metres
from uavgram.views.planned_recording.space import accuracy_range, map_colours
from uavgram.views.recording.stream import Recorder
from uavgram.views.recording.world.legend import (
    BACKGROUND,
    FONT_PX,
    GAP_PX,
    LEGEND,
    TEXT,
    WIDTH_PX,
)
from uavgram.views.style import BAD, MEASURED, OBSERVED, REFERENCE, REFINED, Rgb
from uavgram.views.unit_words import in_units

ROWS_PX = (12, 62)
HEIGHT_PX = 108
BAR_PX = 300


def log_plan_legend(recorder: Recorder, planned: FlightPlanned, units: Units) -> None:
    """Log the picture.

    Parameters
    ----------
    recorder
        The open recording.
    planned
        The plan.
    units
        Units of the lengths shown.
    """
    image = np.asarray(draw_plan_legend(planned, units))
    recorder.static(LEGEND, rr.Image(image, color_model="RGB").compress(jpeg_quality=92))


def draw_plan_legend(planned: FlightPlanned, units: Units) -> Image.Image:
    """Draw swatches for the objects that occur, then the colours of the map."""
    image = Image.new("RGB", (WIDTH_PX, HEIGHT_PX), BACKGROUND)
    pen, font = ImageDraw.Draw(image), ImageFont.load_default(FONT_PX)
    x = 20.0
    for text, colour in _entries(planned):
        y = ROWS_PX[0] + FONT_PX / 2 + 3
        pen.line([(x, y), (x + 56, y)], fill=colour, width=9)
        pen.text((x + 70, ROWS_PX[0]), text, fill=TEXT, font=font)
        x += 70 + pen.textlength(text, font=font) + GAP_PX
    reach = accuracy_range(planned)
    if reach is None:
        pen.text((20, ROWS_PX[1]), "nothing can be measured in the area", fill=TEXT, font=font)
        return image
    length = in_units(metres(planned.grid.length_m), units)
    words = f"ground: lengths of {length} will be known to ± "
    low, high = (in_units(centimetres(one), units) for one in reach)
    x = 20.0
    pen.text((x, ROWS_PX[1]), words + low, fill=TEXT, font=font)
    x += pen.textlength(words + low, font=font) + 16
    for k, colour in enumerate(map_colours(np.linspace(0, 1, BAR_PX))):
        ends = [(x + k, ROWS_PX[1] + 4), (x + k, ROWS_PX[1] + 32)]
        pen.line(ends, fill=tuple(colour.tolist()))
    pen.text((x + BAR_PX + 16, ROWS_PX[1]), high, fill=TEXT, font=font)
    return image


def _entries(planned: FlightPlanned) -> list[tuple[str, Rgb]]:
    entries: list[tuple[str, Rgb]] = []
    if planned.lines.name:
        entries.append(("line to lay and tape", REFERENCE))
    if planned.plates.name:
        entries.append(("plate to lay", REFERENCE))
    entries += [("photo to take", REFINED), ("this photo and its footprint", OBSERVED)]
    if planned.measurements.name:
        entries.append(("will be measured", MEASURED))
    if planned.no_go_world_m:
        entries.append(("keep out", BAD))
    return entries
