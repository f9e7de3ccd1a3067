"""Measured profiles as drawings: stations to the right, heights up, one below the other."""

from __future__ import annotations

import numpy as np
import rerun as rr

from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result
from uavgram.views.recording.stream import Recorder
from uavgram.views.style import FREE, GROUND, MEASURED, OBSERVED, QUIET, SPREAD, Rgb
from uavgram.views.survey.drawing import uncovered
from uavgram.views.survey.profiles import LEFT, WIDTH, Place, ProfileDrawing, profile_drawings

PROFILES = "profiles"
# The view opens on as many as fit into this height; the others are below.
MOST_SHOWN = 600.0
# Rerun's letters, and the box around its texts, in units of the drawing.
HALF_LETTER, BOX, LINE = 4.5, 6.0, 24.0
# It puts a text below its place.
RAISE = 10.0
TITLE_UP, BAR_UP, NUMBER_AT = 6.0, 8.0, 26.0
GAP = 36.0

Word = tuple[Place, str]


def shown_height(result: Result) -> float:
    """How much of the drawings the view opens on."""
    heights = np.cumsum([one.height + GAP for one in profile_drawings(result)])
    return float(heights[heights <= max(MOST_SHOWN, heights[0])][-1])


def log_profiles(recorder: Recorder, result: Result) -> None:
    """Log all of them, if there is any."""
    drawings = profile_drawings(result)
    if not drawings:
        return
    tops = np.cumsum([0.0, *(one.height + GAP for one in drawings[:-1])])
    both = list(zip(drawings, tops.tolist(), strict=True))

    def log_lines(name: str, lines: list[Floats], colour: Rgb, width: float) -> None:
        radii = rr.Radius.ui_points(width / 2)
        recorder.static(f"{PROFILES}/{name}", rr.LineStrips2D(lines, colors=colour, radii=radii))

    def log_uprights(name: str, colour: Rgb, width: float) -> None:
        uprights = [(bar, top) for one, top in both for bar in getattr(one, name)]
        lines = [_lower(((x, a), (x, b)), top) for (x, a, b), top in uprights]
        log_lines(name, lines, colour, width)

    log_lines("grid", [_lower(line, top) for one, top in both for line in _grid(one)], QUIET, 0.5)
    log_lines("ground", [_lower(one.ground, top) for one, top in both], GROUND, 2.0)
    log_lines("line", [_lower(one.dots, top) for one, top in both], MEASURED, 2.0)
    log_uprights("rulers", FREE, 1.0)
    log_uprights("bars", SPREAD, 3.0)
    dots = np.concatenate([_lower(one.dots, top) for one, top in both])
    recorder.static(
        f"{PROFILES}/points", rr.Points2D(dots, radii=rr.Radius.ui_points(3.0), colors=OBSERVED)
    )
    words = [((at[0], at[1] + top - RAISE), text) for one, top in both for at, text in _words(one)]
    recorder.static(
        f"{PROFILES}/texts",
        rr.Points2D(
            [at for at, _ in words],
            radii=rr.Radius.ui_points(0.0),
            colors=OBSERVED,
            labels=[text for _, text in words],
            show_labels=True,
        ),
    )


def _lower(places: Floats | tuple[Place, ...], top: float) -> Floats:
    """(n, 2) the places of one drawing where it stands below others."""
    lowered: Floats = np.asarray(places) + np.array([0.0, top])
    return lowered


def _grid(drawing: ProfileDrawing) -> list[Floats]:
    """Level lines, and a bar to compare lengths along with."""
    below = drawing.height - BAR_UP
    bar = np.array([[LEFT, below], [LEFT + drawing.bar, below]])
    return [*(np.array([[LEFT, y], [WIDTH, y]]) for y, _ in drawing.grid), bar]


def _words(drawing: ProfileDrawing) -> list[Word]:
    """Title, length of the bar, heights of the level lines, and the names that cover nothing."""
    factor = drawing.exaggeration
    scale = "to one scale" if factor == 1 else f"heights {factor} times too large"
    words: list[Word] = [
        ((WIDTH / 2, -TITLE_UP), f"{drawing.name}: 95 % intervals, {scale}"),
        ((LEFT + drawing.bar / 2, drawing.height + BAR_UP), drawing.bar_text),
        *(((NUMBER_AT, y), text) for y, text in drawing.grid),
        *drawing.names,
    ]
    anchors = np.array([at for at, _ in words])
    half = HALF_LETTER * np.array([len(text) for _, text in words]) + BOX
    return [words[i] for i in uncovered(anchors, half, LINE, len(words))]
