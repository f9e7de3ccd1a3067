"""Legend as a picture: Rerun has neither a legend in 3-D nor a colour bar."""

from __future__ import annotations

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from uavgram.imaging.photos.preview import Pixels
from uavgram.model.observations import Source
from uavgram.model.result.result import Result
from uavgram.views import style
from uavgram.views.formatting import size_text
from uavgram.views.recording.points import has_outlines, sigma_shares
from uavgram.views.recording.scene import Scene
from uavgram.views.recording.stream import Recorder
from uavgram.views.survey.key_facts import frame_states
from uavgram.views.survey.verdict import STATUS_WORDS, summarise_result
from uavgram.views.units import units_of

LEGEND = "legend"
# Twice the displayed size, for sharp letters; wider if the texts need it.
WIDTH_PX, HEIGHT_PX = 2400, 160
LEGEND_BACKGROUND: style.Rgb = (13, 16, 17)
TEXT: style.Rgb = (225, 228, 232)
FONT_PX = 30
BAND_PX = 44
BAR_PX = 300
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
    legend = LegendPicture(HEIGHT_PX, ROWS_PX)
    legend.band(summarise_result(result), style.LEVEL_COLOURS[result.verdict.level])
    for row, text, colour in _entries(result, scene):
        legend.swatch(row, text, colour)
    legend.align()
    if scene.worst_point is not None:
        _, low, high = sigma_shares(result)
        words = "points by the half axis of their 95 % ellipses:"
        if has_outlines(result):
            size = describe_exaggeration(scene.ellipse_factor)
            words = f"95 % ellipses, drawn {size}; half axis:"
        legend.write(0, words)
        first, last = (size_text(one, units_of(result)) for one in (low, high))
        legend.scale(1, first, last, style.scale_colours(np.linspace(0, 1, BAR_PX)))
        legend.align()
    remarks = ["± is one sigma"]
    if brightened:
        remarks.append("ground brightened")
    if scene.off_ground is not None:
        remarks.append(f"ellipsoids off the ground {describe_exaggeration(scene.ellipsoid_factor)}")
    for k, text in enumerate(remarks):
        legend.write(k % 2, text)
    return legend.cut()


class LegendPicture:
    """Legend under construction: rows of texts, from left to right.

    Parameters
    ----------
    height_px
        Height of the picture.
    rows_px
        Upper edges of the rows.
    """

    def __init__(self, height_px: int, rows_px: tuple[int, ...]) -> None:
        self._image = Image.new("RGB", (2 * WIDTH_PX, height_px), LEGEND_BACKGROUND)
        self._pen = ImageDraw.Draw(self._image)
        self._font = ImageFont.load_default(FONT_PX)
        self._tops, self._ends = rows_px, [20.0] * len(rows_px)

    def band(self, text: str, colour: style.Rgb) -> None:
        """Write a text on a band of a colour above everything else."""
        self._pen.rectangle((0, 0, 2 * WIDTH_PX, BAND_PX), fill=colour)
        self._pen.text((20, 4), text, fill=(0, 0, 0), font=self._font)

    def swatch(self, row: int, text: str, colour: style.Rgb) -> None:
        """Write the meaning of a colour.

        Parameters
        ----------
        row
            Index of the row.
        text, colour
            Meaning and colour.
        """
        x, y = self._ends[row], self._tops[row] + FONT_PX / 2 + 3
        self._pen.line([(x, y), (x + 56, y)], fill=colour, width=9)
        self._ends[row] += 70
        self.write(row, text, FONT_PX)

    def write(self, row: int, text: str, gap_px: float = GAP_PX) -> None:
        """Write a text.

        Parameters
        ----------
        row
            Index of the row.
        text, gap_px
            The text, and the gap after it.
        """
        self._pen.text((self._ends[row], self._tops[row]), text, fill=TEXT, font=self._font)
        self._ends[row] += self._pen.textlength(text, font=self._font) + gap_px

    def scale(self, row: int, low: str, high: str, colours: Pixels) -> None:
        """Draw a scale between the words for its ends.

        Parameters
        ----------
        row
            Index of the row.
        low, high
            Words for its ends.
        colours
            (n, 3) colours.
        """
        self.write(row, low, 16)
        y = self._tops[row] + 6
        for colour in colours.tolist():
            self._pen.line([(self._ends[row], y), (self._ends[row], y + 26)], fill=tuple(colour))
            self._ends[row] += 1
        self._ends[row] += 16
        self.write(row, high)

    def align(self) -> None:
        """Let all rows continue at the same place."""
        self._ends = [max(self._ends)] * len(self._ends)

    def cut(self) -> Image.Image:
        """Return the picture, as wide as usual, or as its rows need."""
        width = max(WIDTH_PX, int(max(self._ends)) - GAP_PX // 2)
        return self._image.crop((0, 0, width, self._image.height))


def _entries(result: Result, scene: Scene) -> list[tuple[int, str, style.Rgb]]:
    """Return row, text and colour of each swatch; only of objects that can be seen."""
    on_lines = [(1, "line of known position", style.REFERENCE)] * bool(result.control_lines.name)
    return [
        *_cameras_and_lines(result),
        *on_lines,
        *_heights(scene),
        *_automatic_pick_entries(result),
    ]


def _cameras_and_lines(result: Result) -> list[tuple[int, str, style.Rgb]]:
    status = set(result.lines.status)
    entries: list[tuple[int, str, style.Rgb]] = []
    if result.has_seed.any():
        entries.append((0, "camera, flight log", style.SEED))
    if result.has_refined.any():
        entries.append((1, "camera, refined", style.REFINED))
    states = frame_states(result)
    for row, state, text in ((0, "rejected", "rejected"), (1, "check", "to check")):
        if state in states:
            entries.append((row, f"camera, {text}", style.FRAME_COLOURS[state]))
    if "used" in status:
        entries.append((0, "known length", style.REFERENCE))
    if status & {"suspect", "removed"}:
        entries.append((0, "known length, suspect", style.BAD))
    if "checked" in status:
        entries.append((1, "known length, withheld", style.WITHHELD))
    measured = result.measurements
    found = {s for s, v in zip(measured.status, measured.value, strict=True) if np.isfinite(v)}
    if found & {"ok", "not-checked"}:
        entries.append((1, "measured", style.MEASURED))
    doubts = [STATUS_WORDS[s] for s in ("doubtful", "contradicted") if s in found]
    if doubts:
        entries.append((1, " or ".join(doubts), style.QUIET))
    return entries


def _heights(scene: Scene) -> list[tuple[int, str, style.Rgb]]:
    entries: list[tuple[int, str, style.Rgb]] = []
    if scene.uneven is not None:
        times = "" if scene.departure_factor == 1 else f", bars {scene.departure_factor} x as tall"
        entries += [
            (0, "ground above its plane", style.ABOVE),
            (1, f"below it{times}", style.BELOW),
        ]
    sources = scene.off_ground.source if scene.off_ground else ()
    for k, (source, colour) in enumerate(style.HEIGHT_COLOURS.items()):
        if source in sources:
            entries.append((k % 2, HEIGHT_WORDS[source], colour))
    return entries


def _automatic_pick_entries(result: Result) -> list[tuple[int, str, style.Rgb]]:
    """Return swatches of automatic picks, and of manual ones if there are any automatic ones."""
    entries: list[tuple[int, str, style.Rgb]] = []
    marks = [SOURCE_MARKS[s] for s in SOURCE_MARKS if s in result.picks.source]
    if marks:
        entries += [(0, "picked by hand", style.OBSERVED), (1, " and ".join(marks), style.FOUND)]
    if result.ties is not None:
        entries.append((0, "tie points", style.TIE))
    return entries


def describe_exaggeration(factor: int) -> str:
    """Describe the exaggeration of ellipses, in letters that the legend's font has."""
    return "at true size" if factor == 1 else f"{factor} times too large"
