"""What the labels in the pictures say, and where they fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.result import Result
from uavgram.views.drawing import longest_middle, measured_strips, reference_strips, uncovered
from uavgram.views.recording.scene import Scene, on_screen
from uavgram.views.wording import UNIT_WORDS, decimals_for, worst_first

# Rerun does not keep labels from covering each other: beyond a dozen, tables are read instead.
MOST_LABELS = 14
# Size of a letter on a usual screen: half the width of one, and the height of a line. In the survey
# as tangents of angles of view, in the photo as shares of its width and height.
HALF_LETTER_ON_SCREEN, LINE_ON_SCREEN = 0.0052, 0.034
HALF_LETTER, LINE_HEIGHT = 0.0062, 0.062
MANY_LINES = 20


@dataclass(frozen=True, eq=False)
class Labels:
    """(N, 3) places in the world and (N,) texts."""

    anchor_m: Floats
    text: tuple[str, ...]


def line_width(count: int) -> float:
    """Points on the screen: many lines are drawn thinner."""
    return 4.0 if count <= MANY_LINES else 1.5


def reference_text(result: Result, row: int) -> str:
    """``R1 lane: 34.00 m (known)``."""
    lines = result.lines
    taped = f"{lines.name[row]}: {lines.length_m[row]:.2f} m"
    if lines.status[row] in ("suspect", "removed"):
        return f"{lines.status[row].upper()} {taped} taped, {lines.adjusted_m[row]:.2f} m found"
    return f"{taped} (withheld)" if lines.status[row] == "checked" else f"{taped} (known)"


def measured_text(result: Result, row: int) -> str:
    """``road width 6.31 m ± 0.02``."""
    rows = result.measurements
    unit, sigma = rows.unit[row], float(rows.sigma[row])
    places = decimals_for(sigma, unit)
    value = f"{rows.value[row]:.{places}f} {UNIT_WORDS.get(unit, unit)} ± {sigma:.{places}f}"
    return f"{rows.name[row]} {value}"


def survey_labels(result: Result, scene: Scene) -> Labels:
    """Suspect lines first, then measurements (worst first), then the other known lengths.

    A label that would cover one before it is left out: the tables have them all.
    """
    known, measured = reference_strips(result), measured_strips(result)
    suspect = [i for i in known if result.lines.status[i] in ("suspect", "removed")]
    rows = [(reference_text(result, i), longest_middle([known[i]])) for i in suspect]
    rows += [
        (measured_text(result, int(i)), longest_middle(measured[int(i)]))
        for i in worst_first(result.measurements)
        if measured.get(int(i))
    ]
    rows += [
        (reference_text(result, i), longest_middle([strip]))
        for i, strip in known.items()
        if i not in suspect
    ]
    anchors = np.reshape([anchor for _, anchor in rows], (-1, 3))
    half_widths = HALF_LETTER_ON_SCREEN * np.array([len(text) for text, _ in rows])
    kept = uncovered(on_screen(scene, anchors), half_widths, LINE_ON_SCREEN, MOST_LABELS)
    return Labels(anchors[kept], tuple(rows[i][0] for i in kept))
