"""Measured profiles as drawings: stations to the right, heights up, one below the other."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result
from uavgram.views.recording.stream import Recorder
from uavgram.views.recording.view_texts import place_texts, places_below
from uavgram.views.style import FREE, GROUND, MEASURED, OBSERVED, QUIET, SPREAD, Rgb
from uavgram.views.survey.drawing import Drawing
from uavgram.views.survey.profiles import LEFT, WIDTH, ProfileDrawing, profile_drawings

PROFILES = "profiles"
# The view opens on as many as fit into this height; the others are below.
MAX_SHOWN = 600.0
# Rerun's letters and lines, in units of the drawing.
HALF_LETTER, LINE, HALF_DOT = 4.5, 24.0, 3.0
TITLE_UP, BAR_UP, NUMBER_AT = 6.0, 8.0, 26.0
GAP = 36.0

LINES: tuple[tuple[str, Rgb, float], ...] = (
    ("grid", QUIET, 0.5),
    ("ground", GROUND, 2.0),
    ("line", MEASURED, 2.0),
    ("rulers", FREE, 1.0),
    ("bars", SPREAD, 3.0),
)
"""Lines of a drawing, with their colours and widths on the screen."""


def opening_height(result: Result) -> float:
    """Return the height of the drawings on which the view opens."""
    heights = np.cumsum([one.drawing.height + GAP for one in profile_drawings(result)])
    return float(heights[heights <= max(MAX_SHOWN, heights[0])][-1])


def log_profiles(recorder: Recorder, result: Result) -> None:
    """Log all profiles, if there are any."""
    drawings = profile_drawings(result)
    if not drawings:
        return
    tops = np.cumsum([0.0, *(one.drawing.height + GAP for one in drawings[:-1])])
    both = list(zip(drawings, tops.tolist(), strict=True))

    for name, colour, width in LINES:
        lines = [_lower(line, top) for one, top in both for line in one.drawing.named(name)]
        if name == "grid":
            lines += [_scale_bar(one.drawing, top) for one, top in both]
        recorder.lines(f"{PROFILES}/{name}", lines, colour, width)
    dots = [_lower(dot[0], top) for one, top in both for dot in one.drawing.named("points")]
    recorder.dots(f"{PROFILES}/points", dots, OBSERVED, 3.0)
    words = [(at, text, line) for one, top in both for at, text, line in _words(one, top)]
    leaders = [line for _, _, line in words if np.isfinite(line[0, 0])]
    recorder.lines(f"{PROFILES}/texts/lines", leaders, QUIET, 1.0)
    recorder.texts(f"{PROFILES}/texts", [at for at, _, _ in words], [text for _, text, _ in words])


def _lower(places: Floats, top: float) -> Floats:
    """Shift the (..., 2) places of one drawing to below the drawings before it."""
    return np.asarray(places + np.array([0.0, top]))


def _scale_bar(drawing: Drawing, top: float) -> Floats:
    below = top + drawing.height - BAR_UP
    return np.array([[LEFT, below], [LEFT + drawing.bar, below]])


def _words(one: ProfileDrawing, top: float) -> Iterator[tuple[Floats, str, Floats]]:
    """Yield title, length of the bar, heights of the level lines, and the names that have room.

    Each has the place (2,) below which it is written, and the (2, 2) line to it, NaN if none.
    """
    drawing, factor = one.drawing, one.exaggeration
    scale = "to one scale" if factor == 1 else f"heights {factor} times too large"
    levels = [line[0, 1] for line in drawing.named("grid")]
    fixed = [
        ((WIDTH / 2, -TITLE_UP), f"{one.name}: 95 % intervals, {scale}"),
        ((LEFT + drawing.bar / 2, drawing.height + BAR_UP), drawing.bar_text),
        *(((NUMBER_AT, y), text) for y, text in zip(levels, one.levels, strict=True)),
    ]
    tops = [(bar[0], text) for bar, text in zip(drawing.named("bars"), one.labels, strict=True)]
    words = [*fixed, *tops]
    dots = np.concatenate(drawing.named("points"))
    placed = place_texts(
        np.array([at for at, _ in words]),
        [text for _, text in words],
        np.array([HALF_LETTER, LINE / 2]),
        (np.array([0.0, -GAP]), np.array([WIDTH, drawing.height + GAP])),
        np.column_stack([dots, np.tile([HALF_DOT, HALF_DOT, 0.0], (len(dots), 1))]),
        ranks=[-1] * len(fixed) + list(range(len(tops))),
    )
    hung = places_below(placed)
    for k, (_, text) in enumerate(words):
        if np.isfinite(hung[k, 0]):
            ends = np.stack([placed.leaders[k, 0], hung[k]])
            yield _lower(hung[k], top), text, _lower(ends, top)
