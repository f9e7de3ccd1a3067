"""Legend as a picture: Rerun has neither a legend in 3-D nor a colour bar."""

from __future__ import annotations

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from uavgram.model.result.result import Result
from uavgram.model.survey.observations import Source
from uavgram.views.formatting import size_text
from uavgram.views.recording.scene import Scene
from uavgram.views.recording.stream import Recorder
from uavgram.views.recording.world.points import has_outlines, sigma_shares
from uavgram.views.sentence_units import convert_sentence
from uavgram.views.style import (
    ABOVE,
    BAD,
    BELOW,
    FOUND,
    FRAME_COLOURS,
    HEIGHT_COLOURS,
    LEVEL_COLOURS,
    MEASURED,
    OBSERVED,
    QUIET,
    REFERENCE,
    REFINED,
    SEED,
    TIE,
    WITHHELD,
    Rgb,
    scale_colours,
)
from uavgram.views.survey.key_facts import frame_states
from uavgram.views.survey.verdict import STATUS_WORDS, summarise_result
from uavgram.views.units import units_of

LEGEND = "legend"
# Twice the displayed size, for sharp letters; wider if the texts need it.
WIDTH_PX, HEIGHT_PX = 2400, 160
LEGEND_BACKGROUND: Rgb = (13, 16, 17)
TEXT: Rgb = (225, 228, 232)
FONT_PX = 30
BAND_PX = 44
ROWS_PX = (60, 110)
GAP_PX = 40
HEIGHT_WORDS = {
    "free": "height found",
    "stated": "height stated",
    "found": "found, not free in picks",
}
SOURCE_MARKS: dict[Source, str] = {"match": "matched (x)", "target": "target (square)"}


def log_legend(recorder: Recorder, result: Result, scene: Scene, *, brightened: bool) -> None:
    """Log the picture.

    Parameters
    ----------
    recorder
        The open recording.
    result
        Result of the run.
    scene
        Extent of the scene, from which drawings are scaled.
    brightened
        Whether the ground is brighter than in the photos.
    """
    recorder.picture(LEGEND, draw_legend(result, scene, brightened=brightened))


def draw_legend(result: Result, scene: Scene, *, brightened: bool = False) -> Image.Image:
    """Draw the verdict, swatches of the lines that occur, the ellipses' colour scale, and remarks.

    Parameters
    ----------
    result
        Result of the run.
    scene
        Extent of the scene, from which drawings are scaled.
    brightened
        Whether the ground is brighter than in the photos.
    """
    image = Image.new("RGB", (2 * WIDTH_PX, HEIGHT_PX), LEGEND_BACKGROUND)
    pen = ImageDraw.Draw(image)
    font = ImageFont.load_default(FONT_PX)
    rows = [20.0, 20.0]
    for row, text, colour in _entries(result, scene):
        y = ROWS_PX[row] + FONT_PX / 2 + 3
        x = rows[row]
        pen.line([(x, y), (x + 56, y)], fill=colour, width=9)
        pen.text((x + 70, ROWS_PX[row]), text, fill=TEXT, font=font)
        rows[row] = x + 70 + pen.textlength(text, font=font) + FONT_PX
    right = int(max(rows)) + 10
    if scene.worst_point is not None:
        right = _scale(pen, font, result, scene, right)
    remarks = ["± is one sigma"]
    if brightened:
        remarks.append("ground brightened")
    if scene.off_ground is not None:
        remarks.append(f"ellipsoids off the ground {describe_exaggeration(scene.ellipsoid_factor)}")
    ends = [right, right]
    for k, text in enumerate(remarks):
        pen.text((ends[k % 2], ROWS_PX[k % 2]), text, fill=TEXT, font=font)
        ends[k % 2] += int(pen.textlength(text, font=font)) + GAP_PX
    width = max(WIDTH_PX, max(ends) - GAP_PX // 2)
    _band(pen, font, result, width)
    return image.crop((0, 0, width, HEIGHT_PX))


def _band(
    pen: ImageDraw.ImageDraw,
    font: ImageFont.FreeTypeFont | ImageFont.ImageFont,
    result: Result,
    width: int,
) -> None:
    """Draw the verdict above everything else: its words on its colour."""
    pen.rectangle((0, 0, width, BAND_PX), fill=LEVEL_COLOURS[result.verdict.level])
    pen.text((20, 4), summarise_result(result), fill=(0, 0, 0), font=font)


def _entries(result: Result, scene: Scene) -> list[tuple[int, str, Rgb]]:
    """Return row, text and colour of each swatch; only of objects that can be seen."""
    on_lines = [(1, "line of known position", REFERENCE)] * bool(result.control_lines.name)
    return [
        *_cameras_and_lines(result),
        *on_lines,
        *_heights(scene),
        *_automatic_pick_entries(result),
    ]


def _cameras_and_lines(result: Result) -> list[tuple[int, str, Rgb]]:
    status = set(result.lines.status)
    entries: list[tuple[int, str, Rgb]] = []
    if result.has_seed.any():
        entries.append((0, "camera, flight log", SEED))
    if result.has_refined.any():
        entries.append((1, "camera, refined", REFINED))
    states = frame_states(result)
    for row, state, text in ((0, "rejected", "rejected"), (1, "check", "to check")):
        if state in states:
            entries.append((row, f"camera, {text}", FRAME_COLOURS[state]))
    if "used" in status:
        entries.append((0, "known length", REFERENCE))
    if status & {"suspect", "removed"}:
        entries.append((0, "known length, suspect", BAD))
    if "checked" in status:
        entries.append((1, "known length, withheld", WITHHELD))
    measured = result.measurements
    found = {s for s, v in zip(measured.status, measured.value, strict=True) if np.isfinite(v)}
    if found & {"ok", "not-checked"}:
        entries.append((1, "measured", MEASURED))
    doubts = [STATUS_WORDS[s] for s in ("doubtful", "contradicted") if s in found]
    if doubts:
        entries.append((1, " or ".join(doubts), QUIET))
    return entries


def _heights(scene: Scene) -> list[tuple[int, str, Rgb]]:
    entries: list[tuple[int, str, Rgb]] = []
    if scene.uneven is not None:
        times = "" if scene.departure_factor == 1 else f", bars {scene.departure_factor} x as tall"
        entries += [(0, "ground above its plane", ABOVE), (1, f"below it{times}", BELOW)]
    sources = scene.off_ground.source if scene.off_ground else ()
    for k, (source, colour) in enumerate(HEIGHT_COLOURS.items()):
        if source in sources:
            entries.append((k % 2, HEIGHT_WORDS[source], colour))
    return entries


def _automatic_pick_entries(result: Result) -> list[tuple[int, str, Rgb]]:
    """Return swatches of automatic picks, and of manual ones if there are any automatic ones."""
    entries: list[tuple[int, str, Rgb]] = []
    marks = [SOURCE_MARKS[s] for s in SOURCE_MARKS if s in result.picks.source]
    if marks:
        entries += [(0, "picked by hand", OBSERVED), (1, " and ".join(marks), FOUND)]
    if result.ties is not None:
        entries.append((0, "tie points", TIE))
    return entries


def describe_exaggeration(factor: int) -> str:
    """Describe the exaggeration of ellipses, in letters that the legend's font has."""
    return "at true size" if factor == 1 else f"{factor} times too large"


def _scale(
    pen: ImageDraw.ImageDraw,
    font: ImageFont.FreeTypeFont | ImageFont.ImageFont,
    result: Result,
    scene: Scene,
    left: int,
) -> int:
    """Draw the colour scale from `left` on; return its right end."""
    _, low, high = sigma_shares(result)
    colours = scale_colours(np.linspace(0, 1, 300))
    words = "points by the half axis of their 95 % ellipses:"
    if has_outlines(result):
        words = f"95 % ellipses, drawn {describe_exaggeration(scene.ellipse_factor)}; half axis:"
    pen.text((left, ROWS_PX[0]), words, fill=TEXT, font=font)
    end = left + int(pen.textlength(words, font=font))
    y = ROWS_PX[1] + 6
    units = units_of(result)
    first = convert_sentence(size_text(low), units)
    pen.text((left, ROWS_PX[1]), first, fill=TEXT, font=font)
    x = left + int(pen.textlength(first, font=font)) + 16
    for k, colour in enumerate(colours):
        pen.line([(x + k, y), (x + k, y + 26)], fill=tuple(int(c) for c in colour))
    last = convert_sentence(size_text(high), units)
    pen.text((x + 316, ROWS_PX[1]), last, fill=TEXT, font=font)
    return max(end, x + 316 + int(pen.textlength(last, font=font))) + GAP_PX
